"""How much the filter may be relaxed when the policy is sure, and how much tightened when it is not.

Paper, Sec. "Uncertainty-embedded Constraints": with sigma_l and sigma_h the 95th and 97.5th percentiles of
the policy's uncertainty and eta > 0 a gain,

    delta(sigma) = eta (sigma_l - sigma)                                  sigma <  sigma_h
    delta(sigma) = eta (sigma_l - sigma_h) - 2 eta (sigma - sigma_h)      sigma >= sigma_h

continuous, strictly decreasing, positive (relaxing) below sigma_l, and falling twice as fast beyond sigma_h.
sigma is in reward units, delta in those of the constraint it is added to; eta carries the difference.

What delta does to a row s0 h + s1 h' + s2 h'' + w >= c0 (rudc/safety/rows.py):

    level   s0 h + s1 h' + s2 h'' + w + delta >= c0        as in the paper
    rate    s0 k h + s1 h' + s2 h'' + w >= c0              ours; a factor on the class-K function's slope,
            k = exp(delta) where h >= 0, exp(-delta) where h < 0, and always 1/M <= k <= M

So k h - h has the sign of delta: whatever h is, the row is easier than the fixed filter's when delta > 0 and
harder when delta < 0, that is from sigma_l on; at h = 0 nothing is given away. The slope stays positive and
k h is continuous and rising through 0: a class-K function for each sigma. M is the rule's, the most by which
it may be multiplied so that rows still keep h >= 0 (rudc/safety/rules.py). At rest, all rates being 0, a row
holds from this h on, M apart:

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
    """(K,) the factor k on the weight of h of K rows with barrier values h (K,) m2; `most` M >= 1, one for
    all or (K,).
    """
    bound = np.log(most)
    return np.exp(np.minimum(np.maximum(np.where(h >= 0.0, delta, -delta), -bound), bound))


@dataclass(frozen=True, slots=True)
class Slack:
    """The slack delta(sigma)."""

    eta: float
    """gain, units of the constraint (level) or 1 (rate) over units of sigma"""
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
