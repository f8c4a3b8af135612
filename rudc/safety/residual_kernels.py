"""The residual predictor's arithmetic as kernels (see rudc/safety/residual.py)."""

from __future__ import annotations

import cmath
import math

import numpy as np

from rudc.kernels import NewTable, NewVector, Places, Rows, Table, Vector, kernel
from rudc.learning.kernels import Number, Single, Singles, gelu_tanh_of, mapped


@kernel
def common_features(
    own: tuple[float, float, float, float, float], position: Places, offset: Vector, ego: complex, psi: float,
    inputs: int,
) -> NewTable:  # fmt: skip
    """xi (k, inputs) with the first 8 columns written: `own`, then where each of k bodies lies in the ego's
    frame (see `COMMON` of barrier.py). The other columns are not set.
    """
    xi, back = np.empty((len(position), inputs)), cmath.exp(-1j * psi)
    for i in range(len(position)):
        for n in range(5):
            xi[i, n] = own[n]
        away = (position[i] - ego) * back - offset[i]
        xi[i, 5], xi[i, 6], xi[i, 7] = away.real / 20.0, away.imag / 20.0, abs(away) / 20.0
    return xi


@kernel
def vehicle_features(
    xi: NewTable, psi: float, direction: Places, velocity: Places, short: Table, stretch: Table,
    margin: Vector, who: Rows, acceleration: Vector, path: Rows, path_s: Vector,
    heading: Table, spacing: float,
) -> int:  # fmt: skip
    """Write the inputs of vehicles after the first 8 columns of xi (k, 17). Returns 0.

    The yaw rate is that of a vehicle that follows its path; the headings of paths are `heading` (P, M) rad.
    """
    back = cmath.exp(-1j * psi)
    for k in range(len(who)):
        i = who[k]
        relative, moving = direction[k] * back, velocity[k] * back
        xi[k, 8], xi[k, 9] = relative.real, relative.imag
        xi[k, 10], xi[k, 11], xi[k, 12] = moving.real / 10.0, moving.imag / 10.0, acceleration[i] / 6.0
        xi[k, 13] = 0.0
        if path[i] >= 0:
            at = int(min(max(path_s[i] / spacing, 1.0), heading.shape[1] - 2.0))
            bend = (heading[path[i], at + 1] - heading[path[i], at - 1]) / (2.0 * spacing)
            xi[k, 13] = bend * abs(velocity[k])
        xi[k, 14] = math.sqrt(short[1, k] + stretch[1, k]) / 5.0
        xi[k, 15], xi[k, 16] = math.sqrt(short[1, k]) / 5.0, margin[k]
    return 0


@kernel
def network(
    xi: Table,
    low: Single,
    high: Single,
    w1: Singles,
    b1: Single,
    w2: Singles,
    b2: Single,
    w3: Single,
    b3: Number,
    speed: int,
    per_speed: float,
) -> NewVector:
    """(k,): gelu(gelu(xi W1 + b1) W2 + b2) w3 + b3, with xi (k, F) clipped to `low` and `high`, times
    min(xi_s per_speed, 1), where s = `speed` is the column of the ego's speed.
    """
    w, x = np.empty(len(xi)), np.empty(len(low), np.float32)
    for i in range(len(xi)):
        for n in range(len(low)):
            x[n] = min(max(np.float32(xi[i, n]), low[n]), high[n])
        first = mapped(x, w1, b1)
        gelu_tanh_of(first)
        second = mapped(first, w2, b2)
        gelu_tanh_of(second)
        total = b3
        for n in range(len(w3)):
            total += second[n] * w3[n]
        w[i] = total * min(xi[i, speed] * per_speed, 1.0)
    return w
