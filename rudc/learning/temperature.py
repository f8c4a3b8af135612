"""The temperature of a soft actor-critic, which follows a target entropy.

L(alpha) = -log alpha mean_B [ log pi(a|s) + target entropy ]
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import torch
from numpy.typing import NDArray
from torch import Tensor

from rudc.learning.config import LearnerConfig
from rudc.learning.descent import adam, load_moments, moments
from rudc.learning.saving import State, array, restore


class Temperature:
    """alpha_tem, reward units a nat."""

    def __init__(self, config: LearnerConfig, actions: int, device: torch.device) -> None:
        self._log = torch.tensor([math.log(config.temperature)], device=device, requires_grad=True)
        self._target = -float(actions) if config.target_entropy is None else config.target_entropy
        self._rate, self._floor = config.temperature_rate, math.log(config.temperature_floor)
        self._adam = adam([self._log], self._rate)

    @property
    def value(self) -> Tensor:
        """(1,), without gradient."""
        return self._log.detach().exp()

    def step(self, entropy: Tensor) -> None:
        """One step towards the target, given the policy's entropy (nats)."""
        if not self._rate:
            return
        self._log.grad = (entropy - self._target).reshape(1)
        self._adam.step()
        with torch.no_grad():
            self._log.clamp_(min=self._floor)

    def state(self) -> State:
        """The temperature and its optimiser's moments."""
        return {"log": array(self._log), **moments(self._adam)}

    def load(self, state: Mapping[str, NDArray]) -> None:
        """Carry on from there."""
        with torch.no_grad():
            restore(self._log, state["log"], "temperature")
        load_moments(self._adam, state)
