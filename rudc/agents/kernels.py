"""The agents' arithmetic as kernels; the docstrings of the modules that call them give the formulas."""

from __future__ import annotations

import math

import numpy as np

from rudc.env.kernels import interpolated, seen_from_line
from rudc.kernels import Marks, NewRowTable, NewTable, NewVector, Rows, Table, Vector, half_turn, kernel


@kernel
def two_way(
    x: float, y: float, knots: Vector, values: Table, other_knots: Vector, other_values: Table
) -> tuple[float, float, float]:
    """f(x) + g(y) for three pairs of functions that are linear between knots: f has K knots and `values`
    (3, K), g has `other_knots` (L,) and `other_values` (3, L).
    """
    return (
        interpolated(x, knots, values[0]) + interpolated(y, other_knots, other_values[0]),
        interpolated(x, knots, values[1]) + interpolated(y, other_knots, other_values[1]),
        interpolated(x, knots, values[2]) + interpolated(y, other_knots, other_values[2]),
    )


@kernel
def rear_in_band(
    s: float, offset: float, cos: float, sin: float, length: float, width: float, band: float
) -> float:
    """m along a line to the rearmost place of a rectangle that is within 0.5 * band m of the line; inf if no
    part of it is. Its centre is s m along the line and `offset` m to its left, at an angle of this cosine and
    sine.
    """
    rear, centre, half = math.inf, complex(s, offset), 0.5 * band
    along = complex(cos, sin) * (0.5 * length)
    aside = complex(-sin, cos) * (0.5 * width)
    corners = (centre + along + aside, centre - along + aside, centre - along - aside, centre + along - aside)
    for k in range(4):
        one, way = corners[k], corners[(k + 1) % 4] - corners[k]
        low, high = 0.0, 1.0  # the part of this side within the band
        if abs(way.imag) > 1e-9:
            first, last = (-half - one.imag) / way.imag, (half - one.imag) / way.imag
            low, high = max(low, min(first, last)), min(high, max(first, last))
        elif abs(one.imag) >= half:
            continue
        if low < high:
            rear = min(rear, one.real + low * way.real, one.real + high * way.real)
    return rear


@kernel
def who_leads(
    line: Table, course: Vector, spacing: float, position: Table, heading: Vector, velocity: Table,
    size: Table, ego_s: float, ego_length: float, ego_width: float, slowest: float, same_way: float,
    reach: float,
) -> tuple[float, float]:  # fmt: skip
    """m from the ego's front to the rear of its leader along its `line` (M, 2) m, whose directions are
    `course` (M,) rad, and the leader's speed along it, m/s; (inf, 0) if there is none.

    It is the first in the band that the ego will drive over, of those who are faster than `slowest` m/s and
    drive in the ego's direction, within `reach` m. Somebody does so if the cosine of the angle to the line is
    above `same_way`. Whoever is in the band beside the ego already is not a leader.
    """
    first = min(max(int(ego_s / spacing), 0), len(course) - 1)
    last = first + int(reach / spacing) + 1
    seen = seen_from_line(line[first:last], course[first:last], spacing, position, heading)
    front = ego_s - first * spacing + 0.5 * ego_length
    nearest, towards = math.inf, 0.0
    for i in range(len(heading)):
        speed = math.hypot(velocity[i, 0], velocity[i, 1])
        if speed <= slowest or seen[i, 2] <= same_way:
            continue
        rear = rear_in_band(seen[i, 0], seen[i, 1], seen[i, 2], seen[i, 3], size[i, 0], size[i, 1], ego_width)
        if front < rear < nearest:
            nearest, towards = rear, speed * seen[i, 2]
    return nearest - front, towards


# ---- what sensors show


@kernel
def sighted(position: Table, velocity: Table, heading: Vector, most: int, slowest: float) -> NewTable:
    """(N, 6) for the first `most` others: position (m, m), speed (m/s, negative for backwards), direction of
    motion (cosine, sine), and heading (rad). The direction of motion of somebody who is no faster than
    `slowest` m/s is that of the body.
    """
    seen = np.empty((min(len(heading), most), 6))
    for i in range(len(seen)):
        cos, sin = math.cos(heading[i]), math.sin(heading[i])
        speed = math.hypot(velocity[i, 0], velocity[i, 1])
        x, y = cos, sin
        if speed > slowest:
            x, y = velocity[i, 0] / speed, velocity[i, 1] / speed
        if x * cos + y * sin < 0.0:
            speed, x, y = -speed, -x, -y
        seen[i, 0], seen[i, 1], seen[i, 2] = position[i, 0], position[i, 1], speed
        seen[i, 3], seen[i, 4], seen[i, 5] = x, y, heading[i]
    return seen


@kernel
def unexplained(now: Table, before: Table, rows: Rows, acceleration: Vector, dt: float) -> NewTable:
    """(K, 4) for those of the sightings `now` (N, 6) that have a row in `before` (M, 6), dt s ago: the
    part of the change that motion does not explain, of x and y (m), speed (m/s), and heading (rad, full turns
    included). `rows` (N,): the row of each in `before`, -1 for none; `acceleration` (N,) m/s2.
    """
    count = 0
    found = np.empty((len(now), 4))
    for i in range(len(now)):
        if rows[i] < 0:
            continue
        one, last = now[i], before[rows[i]]
        for axis in range(2):
            way = 0.5 * dt * (last[2] * last[3 + axis] + one[2] * one[3 + axis])
            found[count, axis] = abs(one[axis] - last[axis] - way)
        found[count, 2] = abs(one[2] - last[2] - dt * acceleration[i])
        bend = math.atan2(one[4] * last[3] - one[3] * last[4], one[3] * last[3] + one[4] * last[4])
        found[count, 3] = one[5] - last[5] - bend
        count += 1
    return found[:count].copy()


@kernel
def keep(found: Table, least: Vector, kept: NewTable, counts: NewRowTable) -> int:
    """Keep what `unexplained` has `found` (K, 4) in ring buffers `kept` (3, M): of positions, speeds,
    headings.

    `counts` (3, 2): how many were ever kept, and how many of those now in the buffer exceed `least` (3,).
    Returns 0.
    """
    for i in range(len(found)):
        for column in range(4):
            kind, difference = max(column - 1, 0), found[i, column]
            if kind == 2:
                difference = abs(half_turn(difference))
            place = counts[kind, 0] % kept.shape[1]
            if counts[kind, 0] >= kept.shape[1] and kept[kind, place] > least[kind]:
                counts[kind, 1] -= 1
            if difference > least[kind]:
                counts[kind, 1] += 1
            kept[kind, place] = difference
            counts[kind, 0] += 1
    return 0


@kernel
def listen(
    position: Table, velocity: Table, heading: Vector, acceleration: Vector, most: int, slowest: float,
    before: Table, rows: Rows, dt: float, least: Vector, kept: NewTable, counts: NewRowTable,
) -> NewTable:  # fmt: skip
    """The others as `sighted`; what is `unexplained` of them since `before` is kept (`keep`)."""
    seen = sighted(position, velocity, heading, most, slowest)
    keep(unexplained(seen, before, rows, acceleration, dt), least, kept, counts)
    return seen


# ---- who stands


@kernel
def any_slower(velocity: Table, speed: float) -> bool:
    """Whether the size of any of the velocities (N, 2) m/s is below `speed` m/s."""
    found = False
    for i in range(len(velocity)):
        found = found or math.hypot(velocity[i, 0], velocity[i, 1]) < speed
    return found


@kernel
def all_have_ways(path: Rows, kind: Rows, walker: int) -> bool:
    """Whether everybody is on a path or is a pedestrian: `path` (N,) is -1 for none, `kind` (N,) is `walker`
    for pedestrians.
    """
    found = True
    for i in range(len(path)):
        found = found and (path[i] >= 0 or kind[i] == walker)
    return found


# ---- who gives way


@kernel
def any_unbraked(
    path: Rows, path_s: Vector, size: Table, velocity: Table, acceleration: Vector, origin: Rows,
    own_origin: int, gives_way: Marks, table: Table, again: Table, front: float, least: float,
    needed: float, share: float, nearest: float,
) -> bool:  # fmt: skip
    """Whether one of the others (N,), from another arm than the ego's, needs more than `needed` m/s2 to stop
    before a conflict in which it gives way to the ego, and brakes with less than `share` of that.

    Conflicts are those of `Crossings`, `table` and `again` (P, 4): the ego gives way in the first one to the
    rows `gives_way` (P,). Only those more than `least` m ahead of the ego's `front` m count. Distances to
    them are at least `nearest` m.
    """
    for i in range(len(path)):
        row, half = path[i], 0.5 * size[i, 0]
        if row < 0 or origin[row] == own_origin:
            continue
        v2 = velocity[i, 0] ** 2 + velocity[i, 1] ** 2
        for second in range(2):
            if second == 0 and gives_way[row]:
                continue
            met = again[row] if second else table[row]
            ahead = met[0] - front > least and path_s[i] - half < met[3]  # False for nan: no conflict
            braking = v2 / (2.0 * max(met[2] - path_s[i] - half, nearest))
            if ahead and braking > needed and -acceleration[i] < share * braking:
                return True
    return False


@kernel
def bars(box: Vector, x0: float, y0: float, x1: float, y1: float) -> bool:
    """Whether the line from (x0, y0) to (x1, y1) m meets a box: x m, y m, heading rad, length m, width m."""
    cos, sin = math.cos(box[2]), math.sin(box[2])
    enter, leave = 0.0, 1.0
    for axis in range(2):
        along, across = (cos, sin) if axis == 0 else (-sin, cos)
        start = (x0 - box[0]) * along + (y0 - box[1]) * across
        step = (x1 - x0) * along + (y1 - y0) * across
        half = 0.5 * box[3 + axis]
        if abs(step) < 1e-12:
            step = 1e-12
        first, second = (-half - start) / step, (half - start) / step
        enter, leave = max(enter, min(first, second)), min(leave, max(first, second))
    return enter <= leave


@kernel
def nearest_hidden(
    eye_x: float, eye_y: float, x: Vector, y: Vector, psi: Vector, half_width: float, aside: Vector,
    boxes: Table,
) -> NewVector:  # fmt: skip
    """(S,) m, for each place of a line (x, y in m and psi in rad, (S,) each) the least of the distances
    `aside` (A,) m from the side of an ego on the line, on either side, that is hidden from the eye by one of
    the `boxes` (K, 5) and from which none of them bars the way to the line; inf if there is none.
    """
    found = np.full(len(x), np.inf)
    for i in range(len(x)):
        for side in (1.0, -1.0):
            for away in aside:
                if away >= found[i]:
                    break
                left = side * (half_width + away)
                px, py = x[i] - left * math.sin(psi[i]), y[i] + left * math.cos(psi[i])
                hidden, free = False, True
                for k in range(len(boxes)):
                    hidden = hidden or bars(boxes[k], eye_x, eye_y, px, py)
                    free = free and not bars(boxes[k], x[i], y[i], px, py)
                if hidden and free:
                    found[i] = away
                    break
    return found
