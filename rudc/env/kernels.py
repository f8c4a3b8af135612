"""The observation's arithmetic as kernels; the docstrings of the modules that call them give the formulas."""

from __future__ import annotations

import cmath
import math
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from rudc.kernels import (
    Layout,
    NewCube,
    NewRows,
    NewSingle,
    NewTable,
    NewVector,
    Rows,
    Table,
    Vector,
    kernel,
    rectangle_gap,
)

FARTHEST = 10.0
"""m, larger gaps count as this"""
UNIT = 0.04
"""m, unit of the whole numbers by which tables keep gaps"""

Gaps = Annotated[NDArray[np.uint8], Layout("uint8", 1, "A", readonly=True)]
Entries = Annotated[NDArray[np.int64], Layout("int64", 2, "A", readonly=True)]
Ten = tuple[float, float, float, float, float, float, float, float, float, float]

# ---- who is where


@kernel
def seen_from_line(line: Table, course: Vector, spacing: float, position: Table, heading: Vector) -> NewTable:
    """(N, 4) for poses (N, 2) m, (N,) rad, seen from a line (M, 2) m with directions `course` (M,) rad: arc
    length along the line (m), offset to its left (m), cosine and sine of the angle to it.
    """
    seen = np.empty((len(heading), 4))
    for i in range(len(heading)):
        nearest, least = 0, 1e300
        for k in range(len(course)):
            squared = (position[i, 0] - line[k, 0]) ** 2 + (position[i, 1] - line[k, 1]) ** 2
            if squared < least:
                nearest, least = k, squared
        cos, sin, turn = math.cos(course[nearest]), math.sin(course[nearest]), heading[i] - course[nearest]
        x, y = position[i, 0] - line[nearest, 0], position[i, 1] - line[nearest, 1]
        seen[i, 0], seen[i, 1] = nearest * spacing + x * cos + y * sin, y * cos - x * sin
        seen[i, 2], seen[i, 3] = math.cos(turn), math.sin(turn)
    return seen


@kernel
def looked_up(lines: Table, per_row: int, spacing: float, path: Rows, path_s: Vector) -> NewTable:
    """(N, 4) as `seen_from_line`, from tables `lines` (P * per_row, 4); 0 for those who are on no path."""
    seen = np.zeros((len(path), 4))
    for i in range(len(path)):
        if path[i] >= 0:
            station = int(min(max(np.rint(path_s[i] * (1.0 / spacing)), 0.0), per_row - 1.0))
            for k in range(4):
                seen[i, k] = lines[path[i] * per_row + station, k]
    return seen


@kernel
def relevant(
    seen: Table, rows: Table, path: Rows, path_s: Vector, size: Table, ego_s: float, ego_length: float
) -> NewRows:
    """(K,) indices of those who have a path, have not yet passed where it meets the ego's path (nor has the
    ego), and do not drive behind the ego. `rows` (P, 5) as `RouteTables.rows`.
    """
    found = np.empty(len(path), np.int64)
    count = 0
    for i in range(len(path)):
        if path[i] < 0:
            continue
        touching = 0.5 * (size[i, 0] + ego_length)
        meets = path_s[i] < rows[path[i], 1] + touching and ego_s < rows[path[i], 0] + touching
        follows = seen[i, 0] < ego_s and abs(seen[i, 1]) < 2.0 and seen[i, 2] > 0.7
        if meets and not follows:
            found[count] = i
            count += 1
    return found[:count].copy()


@kernel
def leader(seen: Table, size: Table, ego_s: float, ego_width: float) -> tuple[int, float]:
    """Index of the first in the band that the ego will drive over; m along the path to its rear, or inf."""
    first, gap = 0, math.inf
    for i in range(len(seen)):
        parallel, crosswise = abs(seen[i, 2]), abs(seen[i, 3])
        length, width = 0.5 * size[i, 0], 0.5 * size[i, 1]
        inside = abs(seen[i, 1]) < 0.5 * ego_width + length * crosswise + width * parallel
        if inside and seen[i, 0] > ego_s and seen[i, 0] - length * parallel - width * crosswise < gap:
            first, gap = i, seen[i, 0] - length * parallel - width * crosswise
    return first, gap


# ---- where they will be


@kernel
def interpolated(x: float, xp: Vector, fp: Vector) -> float:
    """The function with values fp (n,) at rising xp (n,), linear in between, constant beyond."""
    if x <= xp[0]:
        return fp[0]
    if x >= xp[len(xp) - 1]:
        return fp[len(xp) - 1]
    low, high = 0, len(xp) - 1
    while high - low > 1:
        middle = (low + high) // 2
        if xp[middle] <= x:
            low = middle
        else:
            high = middle
    return fp[low] + (fp[high] - fp[low]) / (xp[high] - xp[low]) * (x - xp[low])


@kernel
def braking_way(v: float, acceleration: float, time: float) -> float:
    """m driven in `time` s from v m/s at the present deceleration; an acceleration counts as 0."""
    braking = max(-acceleration, 1e-6)
    t = min(time, v / braking)
    return t * (v - 0.5 * braking * t)


@kernel
def free_way(
    v: float, limit: float, accel: float, most: float, tau: Vector, u: Vector, y: Vector, times: Vector
) -> NewVector:
    """(T,) m in `times` (T,) s on a free road: v0^2 / a (y(tau + a t / v0) - y(tau)), u(tau) = v / v0."""
    v0 = max(limit, v)
    rate = accel / v0
    start = interpolated(min(v / v0, most), u, tau)
    way = np.empty(len(times))
    for t in range(len(times)):
        later = interpolated(start + rate * times[t], tau, y)
        way[t] = (later - interpolated(start, tau, y)) * (v0 / rate)
    return way


@kernel
def others_s(
    which: Rows, rows: Table, path: Rows, path_s: Vector, velocity: Table, acceleration: Vector,
    accel: float, most: float, tau: Vector, u: Vector, y: Vector, times: Vector,
) -> NewCube:  # fmt: skip
    """(K, 2, T) m, arc lengths of others `which` (K,) on their paths at `times` (T,) s: free, and braking."""
    s = np.empty((len(which), 2, len(times)))
    for k in range(len(which)):
        i = which[k]
        v = math.hypot(velocity[i, 0], velocity[i, 1])
        free = free_way(v, rows[path[i], 4], accel, most, tau, u, y, times)
        for t in range(len(times)):
            s[k, 0, t] = path_s[i] + free[t]
            s[k, 1, t] = path_s[i] + braking_way(v, acceleration[i], times[t])
    return s


@kernel
def ego_s(s: float, v: float, top: float, accelerations: Vector, times: Vector) -> NewTable:
    """(A, T) m, arc lengths of an ego that keeps each acceleration until it drives `top` m/s or stands."""
    result = np.empty((len(accelerations), len(times)))
    for k in range(len(accelerations)):
        a = accelerations[k]
        end, until = (top, (top - v) / a) if a > 0.0 else (0.0, -v / a if a < 0.0 else math.inf)
        for i in range(len(times)):
            t = min(times[i], until)
            result[k, i] = s + t * (v + 0.5 * a * t) + end * (times[i] - t)
    return result


@kernel
def code(row: int, length: float, width: float) -> int:
    """One number that stands for a path's row and a size (m, m), rounded to decimetres."""
    return row * 1_000_000 + 1000 * int(np.rint(length * 10.0)) + int(np.rint(width * 10.0))


@kernel
def foreseen(
    lines: Table, per_row: int, spacing: float, line: Table, course: Vector, rows: Table,
    position: Table, heading: Vector, velocity: Table, acceleration: Vector, size: Table,
    path: Rows, path_s: Vector, ego_s: float, ego_length: float, ego_width: float,
    accel: float, most: float, tau: Vector, u: Vector, y: Vector, times: Vector,
) -> tuple[NewRows, NewCube, NewRows, float, float]:  # fmt: skip
    """Those who are `relevant` (K,), their arc lengths (K, 2, T) m as `others_s`, and the `code` (K,) of
    each; m along the path to the rear of the `leader`, and its speed (m/s) along it.

    Where those on paths are is looked up in the tables `lines`; for the others it is computed from `line`.
    """
    seen = looked_up(lines, per_row, spacing, path, path_s)
    for i in range(len(path)):
        if path[i] < 0:
            seen[i] = seen_from_line(line, course, spacing, position[i : i + 1], heading[i : i + 1])[0]
    which = relevant(seen, rows, path, path_s, size, ego_s, ego_length)
    s = others_s(which, rows, path, path_s, velocity, acceleration, accel, most, tau, u, y, times)
    codes = np.empty(len(which), np.int64)
    for k in range(len(which)):
        codes[k] = code(path[which[k]], size[which[k], 0], size[which[k], 1])
    first, rear = leader(seen, size, ego_s, ego_width)
    if rear == math.inf:
        return which, s, codes, rear, 0.0
    return which, s, codes, rear, math.hypot(velocity[first, 0], velocity[first, 1]) * seen[first, 2]


# ---- gaps


@kernel
def table_gaps(
    table: Gaps, entries: Entries, spacing: float, ego_s: Table, s: NewCube, least: NewCube
) -> int:
    """Lower `least` (A, H, T) m to the gaps in the tables, for arc lengths `ego_s` (A, T) and s (K, H, T) m.

    `entries` (K, 6) as `RouteTables.find` returns them. Returns 0.
    """
    per_m = 1.0 / spacing
    for k in range(len(entries)):
        base, first, last, their_first, their_last, width = entries[k]
        for t in range(ego_s.shape[1]):
            for h in range(s.shape[1]):
                theirs = int(min(max(np.rint(s[k, h, t] * per_m), float(their_first)), float(their_last)))
                for a in range(len(ego_s)):
                    ours = int(min(max(np.rint(ego_s[a, t] * per_m), float(first)), float(last)))
                    gap = table[base + (ours - first) * width + theirs - their_first]
                    least[a, h, t] = min(least[a, h, t], gap * UNIT)
    return 0


@kernel
def stray_gaps(
    line: Table, course: Vector, spacing: float, ego_s: Table, length: float, width: float, times: Vector,
    path: Rows, position: Table, heading: Vector, velocity: Table, acceleration: Vector, size: Table,
    least: NewCube,
) -> int:  # fmt: skip
    """Lower `least` (A, H, T) m to the gaps towards those without a path, who go straight ahead and brake.

    Returns 0.
    """
    for i in range(len(path)):
        if path[i] >= 0:
            continue
        here, facing = complex(position[i, 0], position[i, 1]), cmath.exp(1j * heading[i])
        drift = complex(velocity[i, 0], velocity[i, 1])
        speed = abs(drift)
        drift /= max(speed, 1e-6)
        for t in range(len(times)):
            there = here + braking_way(speed, acceleration[i], times[t]) * drift
            for a in range(len(ego_s)):
                at = ego_s[a, t] * (1.0 / spacing)
                k = int(min(max(at, 0.0), len(course) - 2.0))
                x = line[k, 0] + (at - k) * (line[k + 1, 0] - line[k, 0])
                y = line[k, 1] + (at - k) * (line[k + 1, 1] - line[k, 1])
                r = there - complex(x, y)
                if r.real**2 + r.imag**2 >= (FARTHEST + 12.0) ** 2:
                    continue
                turn = course[k] + min(max(at - k, 0.0), 1.0) * (course[k + 1] - course[k])
                half = 0.5 * size[i, 0], 0.5 * size[i, 1]
                gap = rectangle_gap(
                    r, cmath.exp(1j * turn), facing, 0.5 * length, 0.5 * width, half[0], half[1]
                )
                for h in range(least.shape[1]):
                    least[a, h, t] = min(least[a, h, t], gap)
    return 0


@kernel
def gap_features(least: NewCube, touch: float) -> NewVector:
    """(2 H A,): for each hypothesis and acceleration the least of the gaps `least` (A, H, T) m / `FARTHEST`;
    then the first of the T instants with a gap below `touch` m, as a share of T (1: none before the last).
    """
    ego, others, count = least.shape
    result = np.empty(2 * others * ego)
    for h in range(others):
        for a in range(ego):
            smallest, first = least[a, h, 0], count
            for t in range(count):
                smallest = min(smallest, least[a, h, t])
                if least[a, h, t] < touch and t < first:
                    first = t + 1
            result[h * ego + a] = smallest / FARTHEST
            result[(others + h) * ego + a] = first / count
    return result


@kernel
def occupied(which: Rows, rows: Table, path: Rows, size: Table, s: NewCube, bins: int) -> NewVector:
    """(bins + 2,): whether anyone of `which` (hypothesis free) is on the ego's conflict zone in each of
    `bins` equal parts of the time; then the first part that is free, and the first that is not, as shares.
    """
    result = np.zeros(bins + 2)
    each = s.shape[2] // bins
    for k in range(len(which)):
        i = which[k]
        entry, leaving = rows[path[i], 2] - 0.5 * size[i, 0], rows[path[i], 3] + 0.5 * size[i, 0]
        for t in range(bins * each):
            if entry < s[k, 0, t] < leaving:
                result[t // each] = 1.0
    for wanted in range(2):
        result[bins + wanted] = 1.0
        for b in range(bins - 1, -1, -1):
            if result[b] == wanted:
                result[bins + wanted] = b / bins
    return result


@kernel
def meetings(
    table: Gaps, entries: Entries, spacing: float, s: NewCube, which: Rows, rows: Table,
    ego_at: float, v: float, top: float, accelerations: Vector, times: Vector, touch: float, bins: int,
    line: Table, course: Vector, length: float, width: float,
    position: Table, heading: Vector, velocity: Table, acceleration: Vector, size: Table, path: Rows,
) -> NewVector:  # fmt: skip
    """(4 A + bins + 2,): `gap_features` and `occupied` for an ego at `ego_at` m and v m/s, towards others
    `which` (K,), with arc lengths s (K, 2, T) m and `entries` (K, 6), and towards those without a path.
    """
    ours, count = ego_s(ego_at, v, top, accelerations, times), 4 * len(accelerations)
    least = np.full((len(accelerations), 2, len(times)), FARTHEST)
    table_gaps(table, entries, spacing, ours, s, least)
    stray_gaps(
        line, course, spacing, ours, length, width, times,
        path, position, heading, velocity, acceleration, size, least,
    )  # fmt: skip
    found = np.empty(count + bins + 2)
    found[:count] = gap_features(least, touch)
    found[count:] = occupied(which, rows, path, size, s, bins)
    return found


# ---- the paper's observation


@kernel
def others_features(
    x: float, y: float, psi: float, velocity_x: float, velocity_y: float, most: int,
    position: Table, heading: Vector, velocity: Table, per_m: float, per_speed: float, cut: float,
) -> NewVector:  # fmt: skip
    """(6 most,): validity, dx, dy, dv_x, dv_y, dphi of the first `most` others, in the ego's body frame."""
    result = np.zeros(6 * most)
    cos, sin = math.cos(psi), math.sin(psi)
    for i in range(min(len(heading), most)):
        away_x, away_y = position[i, 0] - x, position[i, 1] - y
        faster_x, faster_y = velocity[i, 0] - velocity_x, velocity[i, 1] - velocity_y
        turned = (heading[i] - psi) / math.pi
        result[6 * i] = 1.0
        result[6 * i + 1] = (away_x * cos + away_y * sin) * per_m
        result[6 * i + 2] = (away_y * cos - away_x * sin) * per_m
        result[6 * i + 3] = (faster_x * cos + faster_y * sin) * per_speed
        result[6 * i + 4] = (faster_y * cos - faster_x * sin) * per_speed
        result[6 * i + 5] = turned - 2.0 * math.ceil(0.5 * (turned - cut))
    return result


@kernel
def waypoints(
    line: Table, station: float, stride: int, count: int, x: float, y: float, psi: float, per_m: float
) -> NewVector:
    """(2 count,) dx, dy of the line's points 1, 2, ... strides ahead of a station, in the body frame."""
    result = np.empty(2 * count)
    cos, sin, i = math.cos(psi), math.sin(psi), int(station)
    for k in range(count):
        j = i + (k + 1) * stride
        away_x = line[j, 0] + (station - i) * (line[j + 1, 0] - line[j, 0]) - x
        away_y = line[j, 1] + (station - i) * (line[j + 1, 1] - line[j, 1]) - y
        result[2 * k] = (away_x * cos + away_y * sin) * per_m
        result[2 * k + 1] = (away_y * cos - away_x * sin) * per_m
    return result


@kernel
def observed(
    ego: Ten, x: float, y: float, psi: float, velocity_x: float, velocity_y: float,
    most: int, position: Table, heading: Vector, velocity: Table, per_m: float, per_speed: float, cut: float,
    line: Table, station: float, stride: int, count: int, per_waypoint: float,
    task: int, tasks: int, conflict: Vector, limit: float,
) -> NewSingle:  # fmt: skip
    """The whole observation, part after part: `ego`, `others_features`, `waypoints`, the task one-hot in
    `tasks` numbers, and `conflict`; each number is cut to [-limit, limit].
    """
    result = np.zeros(len(ego) + 6 * most + 2 * count + tasks + len(conflict))
    for k in range(len(ego)):
        result[k] = ego[k]
    at, end = len(ego), len(ego) + 6 * most
    result[at:end] = others_features(
        x, y, psi, velocity_x, velocity_y, most, position, heading, velocity, per_m, per_speed, cut
    )
    at, end = end, end + 2 * count
    result[at:end] = waypoints(line, station, stride, count, x, y, psi, per_waypoint)
    result[end + task] = 1.0
    result[end + tasks :] = conflict
    flat = np.empty(len(result), np.float32)
    for k in range(len(result)):
        value = result[k]
        flat[k] = limit if value > limit else -limit if value < -limit else value
    return flat
