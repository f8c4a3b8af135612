"""`Tracked`: networks that learn, and the targets that follow them, such as critics and policies."""

from __future__ import annotations

from collections.abc import Mapping

import torch
from numpy.typing import NDArray
from torch import Tensor

from rudc.learning.saving import State, array, restore


class Tracked:
    """A stack of networks with weights `trained`, and `target`, which may be empty."""

    trained: dict[str, Tensor]
    """what learns"""
    target: dict[str, Tensor]
    """what follows; empty where nothing does"""

    def __init__(self, target_rate: float) -> None:
        self._target_rate = target_rate

    @torch.no_grad()
    def follow(self) -> None:
        """Let the targets go a step towards the trained networks (Polyak; a rate of 1 copies)."""
        for name, target in self.target.items():
            target.lerp_(self.trained[name], self._target_rate)

    def arrays(self) -> dict[str, NDArray]:
        """The trained weights, copied."""
        return {name: array(tensor) for name, tensor in self.trained.items()}

    def state(self) -> State:
        """Trained and target weights."""
        groups = {"trained": self.trained, "target": self.target}
        return {f"{k}/{name}": array(v) for k, weights in groups.items() for name, v in weights.items()}

    @torch.no_grad()
    def load(self, state: Mapping[str, NDArray]) -> None:
        """Take over what `state` gave. KeyError or ValueError if it does not fit."""
        for group, weights in {"trained": self.trained, "target": self.target}.items():
            for name, tensor in weights.items():
                restore(tensor, state[f"{group}/{name}"], f"{group}/{name}")
