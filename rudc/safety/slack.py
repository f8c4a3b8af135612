"""How much the filter may be relaxed when the policy is sure, and how much tightened when it is not.

Paper, Sec. "Uncertainty-embedded Constraints": with sigma_l and sigma_h the 95th and 97.5th percentiles of
the policy's uncertainty and eta > 0 a gain,

    delta(sigma) = eta (sigma_l - sigma)                                  sigma <  sigma_h
    delta(sigma) = eta (sigma_l - sigma_h) - 2 eta (sigma - sigma_h)      sigma >= sigma_h

continuous, strictly decreasing, positive (relaxing) below sigma_l, and falling twice as fast beyond sigma_h.
sigma is in reward units, delta in those of the constraint it is added to; eta carries the difference.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from rudc.errors import InputError


@dataclass(frozen=True, slots=True)
class Slack:
    """The slack delta(sigma)."""

    eta: float
    """gain, units of the constraint over units of sigma"""
    low: float
    """sigma_l, where delta changes its sign"""
    high: float
    """sigma_h >= sigma_l, where the slope doubles"""

    def __post_init__(self) -> None:
        if not (self.eta > 0 and math.isfinite(self.eta)):
            raise InputError(f"the gain eta of the slack must be positive, not {self.eta}")
        if not -math.inf < self.low <= self.high < math.inf:
            raise InputError(f"the slack needs finite sigma_l <= sigma_h, not {self.low} and {self.high}")

    def __call__(self, sigma: float) -> float:
        """delta(sigma)."""
        if sigma < self.high:
            return self.eta * (self.low - sigma)
        return self.eta * (self.low - self.high) - 2.0 * self.eta * (sigma - self.high)
