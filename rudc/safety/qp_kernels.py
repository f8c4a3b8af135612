"""Small quadratic programmes as kernels; the docstrings of qp.py and filter.py give the formulas."""

from __future__ import annotations

import math

import numpy as np

from rudc.kernels import Marks, NewColumns, NewRows, NewTable, NewVector, Rows, Table, Vector, kernel


@kernel
def optimality_gap(
    P: Table, q: Vector, A: Table, b: Vector, lower: Vector, upper: Vector, x: Vector, y: Vector,
    y_lower: Vector, y_upper: Vector, unbounded: float,
) -> tuple[float, NewVector]:  # fmt: skip
    """Largest violation of the optimality conditions, inf if a number is not finite; and y (m,) with 0 where
    it is negative. `unbounded`: largest distance to a bound that is counted, for bounds that are infinite.
    """
    m, n = len(b), len(x)
    multipliers, largest = np.empty(m), 0.0
    for i in range(m):
        multipliers[i] = max(y[i], 0.0)
        largest = max(largest, multipliers[i])
    for j in range(n):
        largest = max(largest, abs(q[j]))
    scale, gap, unknown = 1.0 / (1.0 + largest), 0.0, 0.0
    for i in range(m):
        excess = -b[i]
        for j in range(n):
            excess += A[i, j] * x[j]
        gap = max(gap, max(-excess, abs(multipliers[i] * excess) * scale))
        unknown += y[i] * excess * 0.0
    for j in range(n):
        slope = q[j] - y_lower[j] + y_upper[j]
        for k in range(n):
            slope += P[j, k] * x[k]
        for i in range(m):
            slope -= multipliers[i] * A[i, j]
        above, below = min(x[j] - lower[j], unbounded), min(upper[j] - x[j], unbounded)
        bounds = max(abs(y_lower[j] * above), abs(y_upper[j] * below))
        gap = max(gap, max(max(-above, -below), max(abs(slope), bounds) * scale))
        unknown += slope * 0.0
    return (gap if unknown == 0.0 else math.inf), multipliers


@kernel
def least_excess(A: Table, b: Vector, u: Vector) -> float:
    """The least of A u - b, nan if any of these numbers is not finite."""
    least, unknown = np.inf, 0.0
    for i in range(len(b)):
        excess = -b[i]
        for j in range(len(u)):
            excess += A[i, j] * u[j]
        least = min(least, excess)
        unknown += excess * 0.0
    return least if unknown == 0.0 else np.nan


@kernel
def undecided(A: Table, b: Vector, lower: Vector, upper: Vector) -> tuple[NewRows, bool]:
    """Indices (k,) of the rows that do not hold everywhere between the bounds; whether any row holds nowhere
    there.
    """
    kept, count, hopeless = np.empty(len(b), np.int64), 0, False
    for i in range(len(b)):
        middle, reach = -b[i], 0.0
        for j in range(len(lower)):
            middle += A[i, j] * (0.5 * (lower[j] + upper[j]))
            reach += abs(A[i, j]) * (0.5 * (upper[j] - lower[j]))
        hopeless |= middle + reach < 0.0
        if middle < reach:
            kept[count] = i
            count += 1
    return kept[:count].copy(), hopeless


@kernel
def some_rows(A: Table, b: Vector, kept: Rows) -> tuple[NewColumns, NewVector]:
    """A and b of the rows `kept` (k,) only."""
    columns, right = np.empty((A.shape[1], len(kept))), np.empty(len(kept))
    for i in range(len(kept)):
        right[i] = b[kept[i]]
        for j in range(A.shape[1]):
            columns[j, i] = A[kept[i], j]
    return columns.T, right


@kernel
def pulls(A: Table, mode: Vector) -> tuple[float, float]:
    """Least and largest coefficient of the acceleration in the rows of mode 1; at most 0, and at least 0."""
    least, most = 0.0, 0.0
    for i in range(len(mode)):
        if mode[i] > 0.0:
            least, most = min(least, A[i, 0]), max(most, A[i, 0])
    return least, most


@kernel
def with_violations(
    q: Vector, A: Table, lower: Vector, upper: Vector, prices: Vector, mode: Vector, hard: Marks, road: float,
    vehicle: float,
) -> tuple[NewTable, NewVector, NewColumns, NewVector, NewVector]:  # fmt: skip
    """P, q, A, lower and upper of a problem in two variables with the diagonal cost `prices` (2,), after the
    violation of every row that is not `hard` (k,) has been added as a further variable.

    A squared violation costs `road` in rows of mode 0 and `vehicle` in those of mode 1. All costs are
    multiplied by (road vehicle)^(-1/2).
    """
    k, scale = len(mode), 1.0 / math.sqrt(road * vehicle)
    n = 2
    for i in range(k):
        n += 0 if hard[i] else 1
    cost, slope, columns = np.zeros((n, n)), np.zeros(n), np.zeros((n, k))
    low, high = np.full(n, -np.inf), np.full(n, np.inf)
    for j in range(2):
        cost[j, j], slope[j] = scale * prices[j], scale * q[j]
        low[j], high[j] = lower[j], upper[j]
        for i in range(k):
            columns[j, i] = A[i, j]
    n = 2
    for i in range(k):
        if not hard[i]:
            cost[n, n] = scale * (road + mode[i] * (vehicle - road))
            columns[n, i] = 1.0
            n += 1
    return cost, slope, columns.T, low, high


@kernel
def on_the_road(
    x: Vector, A: Table, b: Vector, lower: Vector, upper: Vector, mode: Vector, least_lever: float
) -> NewVector:
    """A relaxed solution (a, z, violations), its steering changed as little as the road's rows (mode 0)
    require at its acceleration. It stays as it is if both edges push. `least_lever`: LEAST_LEVER of
    filter.py.

    The ego brakes for the vehicles already; if it left the road for them as well, nothing would be gained.
    """
    low, high = -np.inf, np.inf
    for i in range(len(b)):
        lever = A[i, 1]
        if mode[i] == 0.0 and abs(lever) > least_lever:
            wanted = (b[i] - A[i, 0] * x[0]) / lever
            low, high = (max(low, wanted), high) if lever > 0.0 else (low, min(high, wanted))
    z = min(max(max(x[1], low), lower[1]), min(high, upper[1]))
    if low > high or z == x[1]:  # low > high: both edges push
        return x.copy()
    moved = np.empty(2 + len(b))
    moved[0], moved[1] = x[0], z
    for i in range(len(b)):
        moved[2 + i] = max(b[i] - (A[i, 0] * x[0] + A[i, 1] * z), 0.0)
    return moved
