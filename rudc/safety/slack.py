"""The slack delta(sigma): how much rows are relaxed when the policy is sure, and tightened when it is not.

Paper, Sec. "Uncertainty-embedded Constraints": with sigma_l and sigma_h the 95th and 97.5th percentiles of
the policy's uncertainty and eta > 0 a gain,

    delta(sigma) = eta (sigma_l - sigma)                                  sigma <  sigma_h
    delta(sigma) = eta (sigma_l - sigma_h) - 2 eta (sigma - sigma_h)      sigma >= sigma_h

delta is continuous and strictly decreasing, positive (relaxing) below sigma_l, and falls twice as fast beyond
sigma_h. sigma is in reward units, delta in the unit of the row that it is added to; eta converts one to the
other.

There are two kinds of slack. They change a row s0 h + s1 h' + s2 h'' + w >= c0 (rudc/safety/rows.py) to:

    level   s0 h + s1 h' + s2 h'' + w + delta >= c0        as in the paper
    rate    s0 k h + s1 h' + s2 h'' + w >= c0              ours; a factor on the class-K function's slope,
            k = exp(delta) where h >= 0, exp(-delta) where h < 0, and always 1/M <= k <= M

With `rate`, k h - h has the sign of delta: whatever h is, the row is easier to satisfy than without slack
when delta > 0, and harder when delta < 0, that is, beyond sigma_l. At h = 0 it is the same. The slope stays
positive, and k h is continuous and rises through 0, so it is a class-K function for each sigma. M is the
rule's: the largest factor with which rows still keep h >= 0 (rudc/safety/rules.py). At rest, where h' and h''
are 0, a row holds for all h from the following value on (as long as M does not limit k):

    level   h >= (c0 - w - delta) / s0           falls without end as delta rises
    rate    h >= (c0 - w) / (s0 exp(delta))      if c0 >= w; never below 0
            h >= (c0 - w) exp(delta) / s0        if c0 < w
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from rudc.arrays import Array
from rudc.errors import InputError


def rate_factor(delta: float, h: Array, most: Array | float) -> Array:
    """(K,) the factor k on the weight of h, for K rows with barrier values `h` (K,) m2 and slack `delta`;
    `most`: M >= 1, one for all or (K,).
    """
    bound = np.log(most)
    return np.exp(np.minimum(np.maximum(np.where(h >= 0.0, delta, -delta), -bound), bound))


@dataclass(frozen=True, slots=True)
class Slack:
    """The function delta(sigma). Raises InputError if its parameters are not as stated."""

    eta: float
    """gain > 0, in m2 per step (level) or without unit (rate), for each unit of sigma"""
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
