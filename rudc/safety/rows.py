"""Affine rows A u >= b, one for each constraint, in u = (a, z): what the QP must respect.

Both filters (paper, Appx. "Details of High-Order Control Barrier Functions") are one family,

    s0 h + s1 h' + s2 h'' + w + delta >= c0

    TTCBF   s0 = lambda                     s1 = dt                            s2 = dt^2/2   c0 = Gamma dt^3
    ECBF    s0 = dt^2/2 lambda1 lambda2     s1 = dt^2/2 (lambda1 + lambda2)    s2 = dt^2/2   c0 = 0

in m2 per step. The ECBF row is the appendix's inequality times dt^2/2. This changes only the unit, and shows
where the residual w and the slack delta (paper, Sec. "Uncertainty-embedded Constraints") enter: w is the
error of the one-step prediction dh = dt h' + dt^2/2 h'', that is, h(x_next) = h + dh + w. For TTCBF the
condition is dh + w + delta + lambda h >= Gamma dt^3, with w where the paper has it. For ECBF, the same
one-step error, seen as an error of h'', is 2 w / dt^2. So the condition is h'' + 2 (w + delta) / dt^2 +
(lambda1 + lambda2) h' + lambda1 lambda2 h >= 0, and times dt^2/2 it is the row above. Hence w and delta are
in m2 per step for both, and a delta of 1 m2 equals 200 m2/s2 in the ECBF's own unit (dt = 0.1 s).

h' = L_f h + L_g h u and h'' = L_f^2 h + H u + X a z + Y z^2 (see `Terms` in barrier.py). The last two terms
are linearised about some action (a0, z0): a z -> a0 z + z0 a - a0 z0, z^2 -> 2 z0 z - z0^2. There the row
is exact. At another u it is off by s2 (X (a - a0)(z - z0) + Y (z - z0)^2), up to 0.03 m2 at 10 m/s for a
steering correction of 0.05. That is little compared with Gamma dt^3, but ECBF has no such reserve: with rows
about the nominal action only, h would fall below 0 however short the steps are. So the filter linearises
again about its solution.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rudc.arrays import Array
from rudc.safety.barrier import Terms
from rudc.safety.barrier_kernels import rows


@dataclass(frozen=True, slots=True)
class RowWeights:
    """The four numbers that make a row from h, h' and h''; the first two may differ between rows."""

    h: float | Array
    """s0, without unit, per step; (K,) or one for all"""
    first: float | Array
    """s1 in s; (K,) or one for all"""
    second: float
    """s2 in s2 (seconds squared)"""
    required: float
    """c0, m2 per step"""

    def of(self, rows: slice) -> RowWeights:
        """The weights of some of the K rows."""
        h, first = (part[rows] if isinstance(part, np.ndarray) else part for part in (self.h, self.first))
        return RowWeights(h, first, self.second, self.required)


def ttcbf_weights(rate: float, gamma: float, dt: float) -> RowWeights:
    """Weights of the truncated Taylor CBF (paper, appendix "Truncated Taylor Control Barrier Functions"):
    class-K factor `rate` (lambda) in (0, 1], `gamma` m2/s3, `dt` s.
    """
    return RowWeights(h=rate, first=dt, second=0.5 * dt * dt, required=gamma * dt**3)


def ecbf_weights(rate1: float, rate2: float, dt: float) -> RowWeights:
    """Weights of the exponential CBF (paper, appendix "Exponential Control Barrier Functions") with poles
    -rate1, -rate2 (1/s), times dt^2/2; `dt` s.
    """
    scale = 0.5 * dt * dt
    return RowWeights(h=scale * rate1 * rate2, first=scale * (rate1 + rate2), second=scale, required=0.0)


def per_row(vehicles: RowWeights, road: RowWeights, mode: Array) -> RowWeights:
    """Weights of K constraints: `vehicles` where `mode` (K,) is 1, `road` where it is 0."""
    return RowWeights(
        h=road.h + mode * (vehicles.h - road.h),
        first=road.first + mode * (vehicles.first - road.first),
        second=vehicles.second,
        required=vehicles.required,
    )


def affine_rows(
    terms: Terms, weights: RowWeights, a0: float, z0: float, relief: Array | float = 0.0
) -> tuple[Array, Array]:
    """A (K, 2) and b (K,) of A u >= b, linearised about acceleration `a0` m/s2 and `z0`, the tangent of the
    front-wheel angle.

    `relief`: w + delta, (K,) or one for all, m2 per step; positive values relax the rows.
    """
    k = len(terms.h)
    lg_a = np.zeros(k) if terms.lg_a is None else terms.lg_a
    return rows(
        *terms[:9], lg_a, _each(weights.h, k), _each(weights.first, k), weights.second, weights.required,
        a0, z0, _each(relief, k),
    )  # fmt: skip


def _each(value: Array | float, k: int) -> Array:
    """(K,) numbers from one for all, or from K."""
    return value if isinstance(value, np.ndarray) and value.ndim else np.full(k, float(value))
