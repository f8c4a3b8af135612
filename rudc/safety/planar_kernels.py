"""Quadratic programmes in the plane, exactly, as kernels.

    minimise 1/2 x' P x + q' x + sum_i r_i s_i^2 / 2   subject to   a_i' x + s_i >= b_i,  lower <= x <= upper

x has two variables. A row that must hold has s_i = 0. Any other row has a price r_i for its violation s_i,
which is max(b_i - a_i' x, 0) at the solution. The rows that must hold, and the bounds, leave a polygon. If no
row with a price is violated, the solution is the point of the polygon with the least cost: a point inside it,
or one on an edge. Which rows are violated is found by Newton's method. At a point x, the cost with the rows
that are violated there is quadratic; the step goes towards the best point of the polygon for that cost, as
far as the true cost falls. The true cost is convex, its slope is continuous, and there are finitely many sets
of violated rows, so a few steps suffice.

A quadratic cost is kept as |R x - c|^2 / 2 with R upper triangular, in the order (R_00, R_01, R_11, c_0,
c_1). A row's r (b - a' x)^2 / 2 is added to it by rotations: sums of weights a million apart would lose
digits. Bounds are treated as rows too; a row is kept as a line (a_0, a_1, b).
"""

from __future__ import annotations

import math

import numpy as np

from rudc.kernels import NewRows, NewTable, NewVector, Rows, Table, Vector, kernel
from rudc.safety.qp_kernels import optimality_gap

SOLVED, NOTHING, NOT_PLANAR = 0, 1, 2
"""statuses that `planar_solution` returns"""
EASE = 1e-9
"""by how much a row may be violated, so that rounding does not empty a polygon that is a single point"""
MOST_STEPS = 50
"""steps of Newton's method at most; it seldom needs more than five"""
LEAST_STEP = 1e-15
"""change of a variable in a step up to which no further step is made"""


@kernel
def violation_prices(P: Table, q: Vector, A: Table, lower: Vector, upper: Vector) -> tuple[bool, NewVector]:
    """Whether the problem has two variables between finite bounds and, if more, violations of single rows;
    and the price r (m,) of each row's violation, inf for a row that must hold.
    """
    n, m = len(q), len(A)
    prices = np.full(m, np.inf)
    fits = n >= 2 and A.shape[1] == n
    for j in range(min(n, 2)):
        fits = fits and math.isfinite(lower[j]) and math.isfinite(upper[j]) and lower[j] <= upper[j]
    for j in range(2, n):
        row, entries = -1, 0
        for i in range(m):
            if A[i, j] != 0.0:
                row, entries = i, entries + 1
        apart = 0.0
        for k in range(n):
            apart += abs(P[j, k]) + abs(P[k, j]) if k != j else 0.0
        free = lower[j] == -np.inf and upper[j] == np.inf and q[j] == 0.0 and apart == 0.0
        if not (fits and free and entries == 1 and A[row, j] == 1.0 and prices[row] == np.inf):
            return False, prices
        prices[row] = P[j, j]
    return fits, prices


@kernel
def all_lines(A: Table, b: Vector, lower: Vector, upper: Vector) -> NewTable:
    """Lines (m + 4, 3): of the rows, then of the bounds lower[1], upper[0], upper[1], lower[0]."""
    m = len(b)
    lines = np.zeros((m + 4, 3))
    for i in range(m):
        lines[i, 0], lines[i, 1], lines[i, 2] = A[i, 0], A[i, 1], b[i]
    lines[m, 1], lines[m, 2] = 1.0, lower[1]
    lines[m + 1, 0], lines[m + 1, 2] = -1.0, -upper[0]
    lines[m + 2, 1], lines[m + 2, 2] = -1.0, -upper[1]
    lines[m + 3, 0], lines[m + 3, 2] = 1.0, lower[0]
    return lines


@kernel
def beyond(line: Vector, x: float, y: float) -> float:
    """a' x - b of a line at (x, y): negative where the row does not hold."""
    return line[0] * x + line[1] * y - line[2]


@kernel
def polygon(lines: Table, prices: Vector) -> tuple[NewTable, NewRows]:
    """Corners (k, 2), in order, of the polygon that the rows that must hold leave of the rectangle between
    the bounds; and for each corner the line (k,) of the edge that begins in it.
    """
    m = len(prices)
    corners, cut = np.empty((m + 4, 2)), np.empty((m + 4, 2))
    makers, cut_makers = np.empty(m + 4, np.int64), np.empty(m + 4, np.int64)
    for k in range(4):  # the corners of the rectangle, from the lowest on
        corners[k, 0] = lines[m + 3, 2] if k in (0, 3) else -lines[m + 1, 2]
        corners[k, 1] = lines[m, 2] if k < 2 else -lines[m + 2, 2]
        makers[k] = m + k
    count = 4
    for i in range(m):
        if prices[i] != np.inf or count == 0:
            continue
        kept, x, y, maker = 0, corners[count - 1, 0], corners[count - 1, 1], makers[count - 1]
        before = beyond(lines[i], x, y) + EASE
        for k in range(count):
            x_next, y_next = corners[k, 0], corners[k, 1]
            after = beyond(lines[i], x_next, y_next) + EASE
            if (before < 0.0) != (after < 0.0):  # the edge crosses the line
                t = before / (before - after)
                cut[kept, 0], cut[kept, 1] = x + t * (x_next - x), y + t * (y_next - y)
                cut_makers[kept] = maker if before < 0.0 else i
                kept += 1
            if after >= 0.0:
                cut[kept, 0], cut[kept, 1], cut_makers[kept] = x_next, y_next, makers[k]
                kept += 1
            x, y, before, maker = x_next, y_next, after, makers[k]
        corners, cut, makers, cut_makers, count = cut, corners, cut_makers, makers, kept
    return corners[:count], makers[:count]


@kernel
def with_row(cost: Vector, weight: float, line: Vector) -> NewVector:
    """The cost with weight (b - a' x)^2 / 2 added."""
    new, root = np.empty(5), math.sqrt(weight)
    first, second, right = root * line[0], root * line[1], root * line[2]
    length = math.sqrt(cost[0] ** 2 + first**2)
    c, s = cost[0] / length, first / length
    new[0], new[1], new[3] = length, c * cost[1] + s * second, c * cost[3] + s * right
    second, right = c * second - s * cost[1], c * right - s * cost[3]
    length = math.sqrt(cost[2] ** 2 + second**2)
    c, s = cost[2] / length, second / length
    new[2], new[4] = length, c * cost[4] + s * right
    return new


@kernel
def best_point(cost: Vector, lines: Table, prices: Vector, corners: Table) -> tuple[float, float, bool]:
    """x_0 and x_1 where a quadratic cost is least in the polygon; whether it is nowhere less outside."""
    m, count = len(prices), len(corners)
    y = cost[4] / cost[2]
    x = (cost[3] - cost[1] * y) / cost[0]
    inside = True
    for i in range(m + 4):
        if i >= m or prices[i] == np.inf:
            inside = inside and beyond(lines[i], x, y) >= 0.0
    if inside:
        return x, y, True
    least, best_x, best_y = np.inf, x, y
    for k in range(count):
        x, y = corners[k, 0], corners[k, 1]
        other = k + 1 if k + 1 < count else 0
        dx, dy = corners[other, 0] - x, corners[other, 1] - y
        up, down = cost[0] * dx + cost[1] * dy, cost[2] * dy  # R d
        over, under = cost[0] * x + cost[1] * y - cost[3], cost[2] * y - cost[4]  # R x - c
        square = up * up + down * down
        t = min(max(-(up * over + down * under) / square, 0.0), 1.0) if square > 0.0 else 0.0
        over, under = over + t * up, under + t * down
        if over * over + under * under < least:
            least, best_x, best_y = over * over + under * under, x + t * dx, y + t * dy
    return best_x, best_y, False


@kernel
def slope_at(base: Vector, lines: Table, prices: Vector, x: float, y: float) -> tuple[float, float]:
    """The two components of the true cost's gradient at (x, y): of `base` and of the rows violated there."""
    over, under = base[0] * x + base[1] * y - base[3], base[2] * y - base[4]
    slope, other = base[0] * over, base[1] * over + base[2] * under
    for i in range(len(prices)):
        excess = beyond(lines[i], x, y)
        if prices[i] != np.inf and excess < 0.0:
            slope += prices[i] * excess * lines[i, 0]
            other += prices[i] * excess * lines[i, 1]
    return slope, other


@kernel
def way_to_go(base: Vector, lines: Table, prices: Vector, x: float, y: float, dx: float, dy: float) -> float:
    """t in [0, 1] where the true cost at (x, y) + t (dx, dy) is least. Its slope along the way rises, and is
    linear in t between the points where a row begins or ceases to hold.
    """
    low, high = 0.0, 1.0
    slope, other = slope_at(base, lines, prices, x, y)
    at_low = slope * dx + other * dy
    slope, other = slope_at(base, lines, prices, x + dx, y + dy)
    at_high = slope * dx + other * dy
    if at_high <= 0.0:
        return 1.0
    if at_low >= 0.0:
        return 0.0
    for i in range(len(prices)):
        along = lines[i, 0] * dx + lines[i, 1] * dy
        if prices[i] == np.inf or along == 0.0:
            continue
        t = -beyond(lines[i], x, y) / along
        if not low < t < high:
            continue
        slope, other = slope_at(base, lines, prices, x + t * dx, y + t * dy)
        here = slope * dx + other * dy
        if here <= 0.0:
            low, at_low = t, here
        else:
            high, at_high = t, here
    return low - at_low * (high - low) / (at_high - at_low)


@kernel
def what_pushes(lines: Table, makers: Rows, x: float, y: float, slope: float, other: float) -> NewVector:
    """Multipliers (m + 4,) of the lines at a point on the polygon's edge, where the cost has the gradient
    (slope, other). Of the lines through the point, the one or the two are taken whose combination with
    multipliers >= 0 comes closest to the gradient.
    """
    found = np.zeros(len(lines))
    touching, count = np.empty(len(makers), np.int64), 0
    for i in makers:
        if abs(beyond(lines[i], x, y)) <= 2.0 * EASE:
            touching[count] = i
            count += 1
    least, one, two, of_one, of_two = np.inf, -1, -1, 0.0, 0.0
    for k in range(count):
        a, b = lines[touching[k], 0], lines[touching[k], 1]
        push = max((a * slope + b * other) / (a * a + b * b), 0.0)
        rest = (slope - push * a) ** 2 + (other - push * b) ** 2
        if rest < least:
            least, one, two, of_one = rest, touching[k], -1, push
        for j in range(k):
            c, d = lines[touching[j], 0], lines[touching[j], 1]
            area = a * d - b * c
            if area == 0.0:
                continue
            push, second = (slope * d - other * c) / area, (a * other - b * slope) / area
            rest = (slope - push * a - second * c) ** 2 + (other - push * b - second * d) ** 2
            if push >= 0.0 and second >= 0.0 and rest < least:
                least, one, two, of_one, of_two = rest, touching[k], touching[j], push, second
    if one >= 0:
        found[one] += of_one
    if two >= 0:
        found[two] += of_two
    return found


@kernel
def least_cost(
    base: Vector, lines: Table, prices: Vector, corners: Table, newton: bool
) -> tuple[float, float, bool]:
    """x_0 and x_1 of the solution; whether no line limits it. `newton`: whether any row has a price."""
    m = len(prices)
    x, y, inside = best_point(base, lines, prices, corners)
    for _ in range(MOST_STEPS if newton else 0):
        cost, changes = base, False
        for i in range(m):
            if prices[i] != np.inf and beyond(lines[i], x, y) < 0.0:
                cost = with_row(cost, prices[i], lines[i])
        to_x, to_y, inside = best_point(cost, lines, prices, corners)
        for i in range(m):
            other = (beyond(lines[i], x, y) < 0.0) != (beyond(lines[i], to_x, to_y) < 0.0)
            changes = changes or (prices[i] != np.inf and other)
        dx, dy = to_x - x, to_y - y
        t = way_to_go(base, lines, prices, x, y, dx, dy) if changes else 1.0
        x, y = x + t * dx, y + t * dy
        if not changes or t * max(abs(dx), abs(dy)) <= LEAST_STEP:
            break
    return x, y, inside


@kernel
def planar_solution(
    P: Table, q: Vector, A: Table, b: Vector, lower: Vector, upper: Vector, unbounded: float
) -> tuple[int, NewVector, NewVector, float]:
    """A status, x (n,), the multipliers of the rows (m,), and the optimality gap (see `optimality_gap`, also
    for `unbounded`). The status is SOLVED; NOTHING, if no x satisfies all rows that must hold; or NOT_PLANAR,
    if the problem is of another form. The rest has a meaning only with SOLVED.
    """
    n, m = len(q), len(b)
    x, y, y_lower, y_upper = np.zeros(n), np.zeros(m), np.zeros(n), np.zeros(n)
    fits, prices = violation_prices(P, q, A, lower, upper)
    base = np.zeros(5)
    if fits:
        base[0] = math.sqrt(max(P[0, 0], 0.0))
        base[1] = P[0, 1] / base[0]
        base[2] = math.sqrt(max(P[1, 1] - base[1] ** 2, 0.0))
        base[3] = -q[0] / base[0]
        base[4] = (-q[1] - base[1] * base[3]) / base[2]
    if not (base[0] > 0.0 and base[2] > 0.0):
        return NOT_PLANAR, x, y, np.inf
    lines = all_lines(A, b, lower, upper)
    corners, makers = polygon(lines, prices)
    if len(corners) == 0:
        return NOTHING, x, y, np.inf
    x[0], x[1], inside = least_cost(base, lines, prices, corners, n > 2)
    if not inside:
        slope, other = slope_at(base, lines, prices, x[0], x[1])
        pushes = what_pushes(lines, makers, x[0], x[1], slope, other)
        y[:] = pushes[:m]
        y_lower[1], y_upper[0], y_upper[1], y_lower[0] = pushes[m:]
    for j in range(2, n):
        for i in range(m):
            if A[i, j] != 0.0:
                x[j] = max(-beyond(lines[i], x[0], x[1]), 0.0)
                y[i] = prices[i] * x[j]
    gap, multipliers = optimality_gap(P, q, A, b, lower, upper, x, y, y_lower, y_upper, unbounded)
    return SOLVED, x, multipliers, gap
