"""Affine rows A u >= b, one for each constraint, in u = (a, z): what the QP must respect.

Both filters (paper, Appx. "Details of High-Order Control Barrier Functions") are one family,

    s0 h + s1 h' + s2 h'' + w + delta >= c0

    TTCBF   s0 = lambda                     s1 = dt                            s2 = dt^2/2   c0 = Gamma dt^3
    ECBF    s0 = dt^2/2 lambda1 lambda2     s1 = dt^2/2 (lambda1 + lambda2)    s2 = dt^2/2   c0 = 0

in m2 per step. The ECBF is the appendix's inequality times dt^2/2, which changes nothing but the unit,
and gives the residual w and the slack delta (paper, Sec. "Uncertainty-embedded Constraints") their
place: w is what one step's prediction dh = dt h' + dt^2/2 h'' lacks, h(x_next) = h + dh + w. For TTCBF
that condition is dh + w + delta + lambda h >= Gamma dt^3, and w stands where the paper has it. For
ECBF, the same one-step error seen as an error of h'' is 2 w / dt^2, hence h'' + 2 (w + delta) / dt^2 +
(lambda1 + lambda2) h' + lambda1 lambda2 h >= 0, and times dt^2/2 the row above. So w and delta are m2
per step for both, and a delta of 1 m2 is worth 200 m2/s2 of ECBF.

h' = L_f h + L_g h z and h'' = L_f^2 h + H u + X a z + Y z^2 (see `barrier`); the last two are
linearised about some action (a0, z0): a z -> a0 z + z0 a - a0 z0, z^2 -> 2 z0 z - z0^2. There the row
is exact. At another u it is off by s2 (X (a - a0)(z - z0) + Y (z - z0)^2), up to 0.03 m2 at 10 m/s for
a steering correction of 0.05. That is little beside Gamma dt^3, but ECBF has nothing to set against it:
with rows about the nominal action only, h sinks below 0 however short the steps. So the filter
linearises again about its solution.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rudc.arrays import Array
from rudc.safety.barrier import Terms
from rudc.safety.barrier_kernels import rows


@dataclass(frozen=True, slots=True)
class RowWeights:
    """The four numbers that make a row out of h, h' and h''; the first two may differ between rows."""

    h: float | Array
    """s0, 1 per step; (K,) or one for all"""
    first: float | Array
    """s1, s; (K,) or one for all"""
    second: float
    """s2, s2"""
    required: float
    """c0, m2 per step"""

    def of(self, rows: slice) -> RowWeights:
        """Those of some of the K rows."""
        h, first = (part[rows] if isinstance(part, np.ndarray) else part for part in (self.h, self.first))
        return RowWeights(h, first, self.second, self.required)


def ttcbf_weights(rate: float, gamma: float, dt: float) -> RowWeights:
    """Truncated Taylor CBF: class-K factor `rate` (lambda) in (0, 1], `gamma` m2/s3, `dt` s."""
    return RowWeights(h=rate, first=dt, second=0.5 * dt * dt, required=gamma * dt**3)


def ecbf_weights(rate1: float, rate2: float, dt: float) -> RowWeights:
    """Exponential CBF with poles -rate1, -rate2 (1/s), times dt^2/2; `dt` s."""
    scale = 0.5 * dt * dt
    return RowWeights(h=scale * rate1 * rate2, first=scale * (rate1 + rate2), second=scale, required=0.0)


def per_row(vehicles: RowWeights, road: RowWeights, mode: Array) -> RowWeights:
    """Weights for K constraints of which those with `mode` (K,) 1 are vehicles, those with 0 road-edge
    points.
    """
    return RowWeights(
        h=road.h + mode * (vehicles.h - road.h),
        first=road.first + mode * (vehicles.first - road.first),
        second=vehicles.second,
        required=vehicles.required,
    )


def affine_rows(
    terms: Terms, weights: RowWeights, a0: float, z0: float, relief: Array | float = 0.0
) -> tuple[Array, Array]:
    """A (K, 2) and b (K,) of A u >= b, linearised about acceleration `a0` m/s2 and z0 = tan of the steering
    angle.

    `relief`: w + delta, (K,) or one for all, m2 per step; positive relaxes.
    """
    k = len(terms.h)
    lg_a = np.zeros(k) if terms.lg_a is None else terms.lg_a
    return rows(
        *terms[:9], lg_a, _each(weights.h, k), _each(weights.first, k), weights.second, weights.required,
        a0, z0, _each(relief, k),
    )  # fmt: skip


def _each(value: Array | float, k: int) -> Array:
    """(K,) of one number for all, or of K."""
    return value if isinstance(value, np.ndarray) and value.ndim else np.full(k, float(value))
