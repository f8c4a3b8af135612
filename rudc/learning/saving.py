"""How a learner's parts are saved: each gives its state as named arrays, and takes it back."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from rudc.errors import AgentError
from rudc.learning.parameters import group, grouped

State = dict[str, NDArray]


class Part(Protocol):
    """Something that a training resumes exactly only if it is saved."""

    def state(self) -> State:
        """All that `load` needs, copied."""
        ...

    def load(self, state: Mapping[str, NDArray]) -> None:
        """Carry on from there. KeyError, RuntimeError or ValueError if it does not fit."""
        ...


def state_of(parts: Mapping[str, Part]) -> State:
    """The states of all parts as one, named `PART/NAME`."""
    return grouped(**{name: part.state() for name, part in parts.items()})


def load_into(parts: Mapping[str, Part], state: Mapping[str, NDArray]) -> None:
    """Give each part its own again. AgentError if it does not fit."""
    try:
        for name, part in parts.items():
            part.load(group(state, name))
    except (KeyError, RuntimeError, ValueError) as error:
        raise AgentError(f"the training state does not fit this configuration: {error}") from error


def array(tensor: Tensor) -> NDArray:
    """A copy as an array."""
    return tensor.detach().cpu().numpy().copy()


def restore(tensor: Tensor, value: NDArray, name: str) -> None:
    """Copy an array into a tensor of the same shape; ValueError names it otherwise."""
    saved = torch.from_numpy(np.array(value))
    if saved.shape != tensor.shape:
        raise ValueError(f"{name} is {tuple(saved.shape)}, not {tuple(tensor.shape)}")
    tensor.copy_(saved)


class Noise:
    """Standard normal numbers, drawn on the CPU: the same on any device."""

    def __init__(self, seed: int, device: torch.device) -> None:
        self._generator = torch.Generator()
        self._generator.manual_seed(seed)
        self._device = device

    def __call__(self, rows: int, columns: int) -> Tensor:
        """(rows, columns) new ones."""
        return torch.randn(rows, columns, generator=self._generator).to(self._device)

    def state(self) -> State:
        """Where the generator stands."""
        return {"generator": self._generator.get_state().numpy().copy()}

    def load(self, state: Mapping[str, NDArray]) -> None:
        """Carry on from there."""
        self._generator.set_state(torch.from_numpy(np.array(state["generator"], dtype=np.uint8)))
