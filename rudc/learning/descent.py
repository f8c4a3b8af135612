"""`Descent`: Adam on the weights of a stack of networks, as every learner here uses it.

The gradient of each member of the stack is clipped on its own. The rate falls linearly from first to last.
Losses are divided by their unit before differentiation, so that gradients are of order one whatever the
rewards are.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from rudc.learning.saving import State, array


class Descent:
    """An optimiser whose gradients are set by `differentiate` and followed by `step`."""

    def __init__(
        self, weights: Mapping[str, Tensor], rates: tuple[float, float], max_gradient: float, updates: int
    ) -> None:
        """`weights`: (N, ..., ...) each; `rates`: the first, and the last, which is reached after `updates`
        steps."""
        self._weights = list(weights.values())
        self._rates, self._max_gradient, self._updates = rates, max_gradient, updates
        self._steps = 0
        self._adam = adam(self._weights, rates[0])

    @property
    def rate(self) -> float:
        """Learning rate of the last step."""
        return float(self._adam.param_groups[0]["lr"])

    def differentiate(self, loss: Tensor, unit: float) -> Tensor:
        """Set the weights' gradients of loss / unit, clipped for each member; norms before that, (N,)."""
        gradients = torch.autograd.grad(loss / unit, self._weights)
        squares = torch.stack([torch.linalg.vector_norm(g, dim=(1, 2)) for g in gradients]).square_()
        norms = squares.sum(dim=0).sqrt_()
        on_cpu = norms.device.type == "cpu"  # elsewhere reading them would wait for all that was launched
        if not (on_cpu and bool((norms <= self._max_gradient).all())):
            scale = (self._max_gradient / (norms + 1e-12)).clamp_(max=1.0)[:, None, None]
            gradients = [gradient * scale for gradient in gradients]
        for weight, gradient in zip(self._weights, gradients, strict=True):
            weight.grad = gradient
        return norms

    def step(self) -> None:
        """Follow the gradients that are set, at the next rate."""
        self.advance()
        self.follow()

    def advance(self) -> None:
        """Set the next rate."""
        first, last = self._rates
        rate = first + (last - first) * min(self._steps / self._updates, 1.0)
        settings = self._adam.param_groups[0]
        if isinstance(settings["lr"], Tensor):
            settings["lr"].fill_(rate)
        else:
            settings["lr"] = rate
        self._steps += 1

    def follow(self) -> None:
        """Follow the gradients that are set, at the rate that is set."""
        self._adam.step()

    def state(self) -> State:
        """Adam's moments, and how many steps were taken."""
        return {"steps": np.array([self._steps]), **moments(self._adam)}

    def load(self, state: Mapping[str, NDArray]) -> None:
        """Carry on from there."""
        load_moments(self._adam, state)
        self._steps = int(state["steps"][0])


def adam(weights: Iterable[Tensor], rate: float) -> torch.optim.Adam:
    """A new optimiser. On a GPU its rate lies there, so that a recorded step reads it anew (recorded.py)."""
    weights = list(weights)
    device = weights[0].device
    if device.type != "cuda":
        return torch.optim.Adam(weights, lr=rate, fused=True)
    return torch.optim.Adam(weights, lr=torch.tensor(rate, device=device), fused=True, capturable=True)


def moments(optimizer: torch.optim.Optimizer) -> State:
    """An optimiser's state as arrays."""
    state = optimizer.state_dict()["state"]
    return {f"adam/{i}/{k}": array(v) for i, values in state.items() for k, v in values.items()}


def load_moments(optimizer: torch.optim.Optimizer, state: Mapping[str, NDArray]) -> None:
    """Give an optimiser what `moments` gave."""
    found: dict[int, dict[str, Tensor]] = {}
    for key, value in state.items():
        head, *rest = key.split("/")
        if head == "adam":
            found.setdefault(int(rest[0]), {})[rest[1]] = torch.from_numpy(np.array(value))
    optimizer.load_state_dict(optimizer.state_dict() | {"state": found})
