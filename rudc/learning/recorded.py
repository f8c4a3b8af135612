"""`Recorded`: a computation that a GPU repeats from a recording (a CUDA graph).

An update is some 500 kernels of a few microseconds each, and Python takes longer to launch them than the GPU
to compute them. A recording is launched as a whole. It does the same on the same memory each time, so
whatever differs between calls is an input, and nothing may be read back on the way.
"""

from __future__ import annotations

from collections.abc import Callable

import torch
from torch import Tensor

WARM_UPS = 3
"""calls before the one that is recorded, in which libraries and optimisers set themselves up"""


class Recorded:
    """A function of tensors. Only GPUs record; elsewhere it is called.

    What the function changes besides, such as weights, must stay where it is between calls; else `forget`.
    Inputs of other shapes are recorded anew.
    """

    def __init__(self, compute: Callable[..., Tensor], device: torch.device) -> None:
        self._compute, self._device = compute, device
        self.forget()

    def forget(self) -> None:
        """Record anew, since what the function changes is elsewhere from now on."""
        self._graph: torch.cuda.CUDAGraph | None = None
        self._inputs: list[Tensor] = []
        self._calls = 0

    def __call__(self, *inputs: Tensor) -> Tensor:
        """What the function gives; on a GPU it holds until the next call."""
        if self._device.type != "cuda":
            return self._compute(*inputs)
        with torch.cuda.device(self._device):
            if self._graph is not None and [i.shape for i in inputs] != [i.shape for i in self._inputs]:
                self.forget()
            if self._calls < WARM_UPS:
                self._calls += 1
                return self._aside(*inputs)
            if self._graph is None:
                self._record(*inputs)
            for kept, given in zip(self._inputs, inputs, strict=True):
                kept.copy_(given)
            assert self._graph is not None
            self._graph.replay()
            return self._output

    def _record(self, *inputs: Tensor) -> None:
        self._inputs = [given.clone() for given in inputs]
        graph = torch.cuda.CUDAGraph()
        with torch.cuda.graph(graph, stream=torch.cuda.Stream()):  # torch's own is of one device
            self._output = self._compute(*self._inputs)
        self._graph = graph

    def _aside(self, *inputs: Tensor) -> Tensor:
        """A call on a stream of its own, as a recording needs it before."""
        here, aside = torch.cuda.current_stream(), torch.cuda.Stream()
        aside.wait_stream(here)
        with torch.cuda.stream(aside):
            result = self._compute(*inputs)
        here.wait_stream(aside)
        return result
