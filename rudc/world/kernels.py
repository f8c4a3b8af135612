"""The world's arithmetic as kernels: the ego's motion, what is near the ego, what touches what, and the order
of a scene's rows.
"""

from __future__ import annotations

import math

import numpy as np

from rudc.kernels import (
    NewRows,
    NewRowTable,
    NewTable,
    NewVector,
    Rows,
    Table,
    Vector,
    kernel,
    rectangle_gap,
    separation,
)

State = tuple[float, float, float, float, float, float, float, float]


# ---- the ego's plant


@kernel
def slip_of(delta: float, wheelbase: float, cg_to_rear: float) -> float:
    """rad, slip angle with the front wheels at `delta` rad."""
    return math.atan(cg_to_rear / wheelbase * math.tan(delta))


@kernel
def widest(v: float, lateral: float, delta_max: float, wheelbase: float, cg_to_rear: float) -> float:
    """rad, front-wheel angle that gives a lateral acceleration of `lateral` m/s2 at v m/s; `delta_max` at a
    stand (up to 0.1 m/s).
    """
    if v <= 0.1:
        return delta_max
    sin_slip = min(lateral * cg_to_rear / (v * v), 0.999)
    return math.atan(wheelbase / cg_to_rear * math.tan(math.asin(sin_slip)))


@kernel
def within_friction(
    a: float, delta: float, v: float, limit: float, delta_max: float, wheelbase: float, cg_to_rear: float
) -> tuple[float, float]:
    """The commands a (m/s2) and delta (rad) at v m/s, cut so that the tyres give at most `limit` m/s2."""
    most = widest(v, limit, delta_max, wheelbase, cg_to_rear)
    delta = min(max(delta, -most), most)
    lateral = v * v * math.sin(slip_of(delta, wheelbase, cg_to_rear)) / cg_to_rear
    left = math.sqrt(max(limit * limit - lateral * lateral, 0.0))
    return min(max(a, -left), left), delta


@kernel
def on_an_arc(
    x: float, y: float, psi: float, v: float, a: float, delta: float, dt: float, v_max: float,
    wheelbase: float, cg_to_rear: float,
) -> State:  # fmt: skip
    """The fields of the `EgoState` after dt s of constant acceleration a (m/s2) and steering delta (rad)."""
    after, way = v + a * dt, v * dt + 0.5 * a * dt * dt
    if after < 0.0:
        after, way = 0.0, v * v / (-2.0 * a)
    elif after > v_max:
        after, way = v_max, v_max * dt - (v_max - v) * (v_max - v) / (2.0 * a)
    slip = slip_of(delta, wheelbase, cg_to_rear)
    bend = math.sin(slip) / cg_to_rear
    half = 0.5 * way * bend
    chord = way * (math.sin(half) / half) if abs(half) > 1e-6 else way
    middle = psi + slip + half
    there = x + chord * math.cos(middle), y + chord * math.sin(middle)
    return there[0], there[1], psi + 2.0 * half, after, slip, after * bend, (after - v) / dt, delta


# ---- who is near, and who touches


@kernel
def around(
    x: float, y: float, psi: float, length: float, width: float, position: Table, heading: Vector,
    size: Table, reach: float,
) -> tuple[float, int, int]:  # fmt: skip
    """Gap (m) from a rectangle at (x, y) m, turned by psi rad, to the nearest of N others, and the row of
    that one; inf and -1 if there is none. And a number of rows: all others within `reach` m are among the
    first so many.
    """
    least, nearest, close = math.inf, -1, 0
    facing, radius = complex(math.cos(psi), math.sin(psi)), 0.5 * math.hypot(length, width)
    for i in range(len(heading)):
        r = complex(position[i, 0] - x, position[i, 1] - y)
        far = abs(r) - radius - 0.5 * math.hypot(size[i, 0], size[i, 1])
        if far <= reach:
            close = i + 1
        if far >= least:
            continue
        other = complex(math.cos(heading[i]), math.sin(heading[i]))
        gap = rectangle_gap(r, facing, other, 0.5 * length, 0.5 * width, 0.5 * size[i, 0], 0.5 * size[i, 1])
        if gap < least:
            least, nearest = gap, i
    return least, nearest, close


@kernel
def overlapping(position: Table, heading: Vector, size: Table) -> NewRowTable:
    """(K, 2) rows of the pairs among N rectangles that overlap or touch, lower row first."""
    count = 0
    found = np.empty((len(heading) * (len(heading) - 1) // 2, 2), np.int64)
    for i in range(len(heading)):
        facing = complex(math.cos(heading[i]), math.sin(heading[i]))
        for j in range(i + 1, len(heading)):
            r = complex(position[j, 0] - position[i, 0], position[j, 1] - position[i, 1])
            if 2.0 * abs(r) > math.hypot(size[i, 0], size[i, 1]) + math.hypot(size[j, 0], size[j, 1]):
                continue
            other = complex(math.cos(heading[j]), math.sin(heading[j]))
            half, its_half = (0.5 * size[i, 0], 0.5 * size[i, 1]), (0.5 * size[j, 0], 0.5 * size[j, 1])
            if separation(r, facing, other, half[0], half[1], its_half[0], its_half[1]) <= 0.0:
                found[count, 0], found[count, 1] = i, j
                count += 1
    return found[:count].copy()


@kernel
def near_on_paths(
    x: float, y: float, reach: float, inside_only: bool, position: Table, size: Table, path: Rows,
    path_s: Vector, stop_s: Vector, exit_s: Vector,
) -> NewRows:  # fmt: skip
    """(K,) rows of the vehicles on paths whose centres are within `reach` m of (x, y) m.

    `inside_only`: only those of which some part is in the junction, from stop_s to exit_s (P,) m.
    """
    found = np.empty(len(path), np.int64)
    count = 0
    for i in range(len(path)):
        half = 0.5 * size[i, 0]
        if path[i] < 0 or math.hypot(position[i, 0] - x, position[i, 1] - y) >= reach:
            continue
        inside = path_s[i] + half > stop_s[path[i]] and path_s[i] - half < exit_s[path[i]]
        if inside or not inside_only:
            found[count] = i
            count += 1
    return found[:count].copy()


@kernel
def nearest_first(
    x: float, y: float, position: Table, heading: Vector, speed: Vector, course: Table,
    acceleration: Vector, size: Table, kind: Rows, path: Rows,
    half: Vector, start: Vector, scale: Vector, lane_pos: Vector,
) -> tuple[
    NewRows, NewTable, NewVector, NewTable, NewVector, NewTable, NewRows, NewRows, NewVector
]:  # fmt: skip
    """Order (N,) of the others by the distance of their centres from (x, y) m, then the arrays of a scene in
    this order. Velocities are speed (N,) m/s along course (N, 2).

    Centres are `half` (N,) m behind `position` (N, 2) m and behind `lane_pos` (N,) m. The arc length of a
    front bumper is start + scale * lane_pos, with `start` (N,) m and `scale` (N,).
    """
    n = len(heading)
    order, away, centre = np.empty(n, np.int64), np.empty(n), np.empty((n, 2))
    for i in range(n):
        for axis in range(2):
            centre[i, axis] = position[i, axis] - half[i] * course[i, axis]
        new, k = math.hypot(centre[i, 0] - x, centre[i, 1] - y), i
        while k > 0 and away[k - 1] > new:
            away[k], order[k] = away[k - 1], order[k - 1]
            k -= 1
        away[k], order[k] = new, i
    places, velocity, sizes = np.empty((n, 2)), np.empty((n, 2)), np.empty((n, 2))
    headings, accelerations, along = np.empty(n), np.empty(n), np.empty(n)
    kinds, paths = np.empty(n, np.int64), np.empty(n, np.int64)
    for k in range(n):
        i = order[k]
        for axis in range(2):
            places[k, axis], sizes[k, axis] = centre[i, axis], size[i, axis]
            velocity[k, axis] = speed[i] * course[i, axis]
        headings[k], accelerations[k] = heading[i], acceleration[i]
        along[k] = start[i] + scale[i] * lane_pos[i] - half[i]
        kinds[k], paths[k] = kind[i], path[i]
    return order, places, headings, velocity, accelerations, sizes, kinds, paths, along


@kernel
def largest(table: Table) -> float:
    """The largest absolute value in a table (N, 2), 0 for an empty one."""
    found = 0.0
    for i in range(len(table)):
        found = max(found, abs(table[i, 0]), abs(table[i, 1]))
    return found
