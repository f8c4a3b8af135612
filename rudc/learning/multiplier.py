"""The Lagrange multiplier of an expected cost (paper, appendix "Lagrangian Relaxation"), by dual ascent.

lambda <- max(0, lambda + rate (mean_B Q_c(s, a_pi) - d_th))
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from rudc.learning.saving import State


class Multiplier:
    """lambda >= 0, reward units over units of cost."""

    def __init__(self, value: float, rate: float, limit: float) -> None:
        self.value = value
        self._rate, self._limit = rate, limit

    def step(self, cost: float) -> None:
        """Rise where the policy's expected cost lies above the limit, fall where it lies below."""
        self.value = max(0.0, self.value + self._rate * (cost - self._limit))

    def state(self) -> State:
        """The multiplier."""
        return {"value": np.array([self.value])}

    def load(self, state: Mapping[str, NDArray]) -> None:
        """Carry on from there."""
        self.value = float(state["value"][0])
