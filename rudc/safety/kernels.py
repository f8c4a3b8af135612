"""Prediction and gate as kernels; prediction.py and gating.py, which call them, explain the method."""

from __future__ import annotations

import cmath
import math

import numpy as np

from rudc.kernels import (
    NewFlags,
    NewPlaces,
    NewPlaceTable,
    NewRows,
    Places,
    PlaceTable,
    Rows,
    Table,
    Vector,
    kernel,
    separation,
)
from rudc.network.line_kernels import along_line, body_along_line, body_on_line, on_line
from rudc.network.paths import SPACING
from rudc.safety.barrier_kernels import CLOSEST

CLOSER, LEAST = 0.03, 0.12
"""m, m: by how much an ego that is near a body that stands may come nearer still, and the gap that must be
left
"""

OPPOSITE = 0.7
"""cosine of the angle between the ego's direction and the opposite of another's, above which that one comes
towards the ego
"""

# ---- prediction


@kernel
def follow(
    poses: Table, stations: int, row: int, s: float, here: complex, heading: complex, way: Vector
) -> tuple[NewPlaces, NewPlaces]:
    """(T,) m and (T,): position and direction, after `way` (T,) m along a line, of a body that is now `here`
    m facing `heading`, at s m on the line, and keeps its offset from the line and its angle to it.
    """
    start, psi = on_line(poses, stations, row, s)
    back = cmath.exp(-1j * psi)
    return along_line(poses, stations, row, s, (here - start) * back, heading * back, way)


@kernel
def other_ahead(
    position: Table, heading: Vector, velocity: Table, size: Table, path: Rows, path_s: Vector,
    poses: Table, stations: int, i: int, way: Vector,
) -> tuple[NewPlaces, NewPlaces]:  # fmt: skip
    """(T,) m and (T,): position and direction of the other i after `way` (T,) m along its path, or straight
    on if it has none.
    """
    here, direction = complex(position[i, 0], position[i, 1]), cmath.exp(1j * heading[i])
    if path[i] >= 0:
        start, along = body_on_line(poses, stations, path[i], path_s[i], size[i, 0])
        beside, turned = (here - start) * along.conjugate(), direction * along.conjugate()
        return body_along_line(poses, stations, path[i], path_s[i], size[i, 0], beside, turned, way)
    drift = complex(velocity[i, 0], velocity[i, 1])
    drift /= max(abs(drift), 1e-9)
    there, turned = np.empty(len(way), np.complex128), np.empty(len(way), np.complex128)
    for t in range(len(way)):
        there[t], turned[t] = here + drift * way[t], direction
    return there, turned


@kernel
def others_ahead(
    position: Table, heading: Vector, velocity: Table, size: Table, path: Rows, path_s: Vector,
    poses: Table, stations: int, who: Rows, way: Table,
) -> tuple[NewPlaceTable, NewPlaceTable]:  # fmt: skip
    """(n, T) m and (n, T): positions and directions of the others `who` (n,) after `way` (n, T) m."""
    there, turned = np.empty(way.shape, np.complex128), np.empty(way.shape, np.complex128)
    for k in range(len(who)):
        there[k], turned[k] = other_ahead(
            position, heading, velocity, size, path, path_s, poses, stations, who[k], way[k]
        )
    return there, turned


@kernel
def drives_on(
    poses: Table, first: int, end: int, lane: float, along_it: float, here: complex, heading: complex
) -> bool:
    """Whether somebody `here` m facing `heading` drives on a line, between its stations `first` and `end`:
    less than `lane` m beside it, at an angle to it whose cosine is above `along_it`.

    Every second station is checked.
    """
    best, nearest = 1e300, 0
    for i in range(first, end, 2):
        squared = (here.real - poses[i, 0]) ** 2 + (here.imag - poses[i, 1]) ** 2
        if squared < best:
            best, nearest = squared, i
    back = cmath.exp(-1j * poses[nearest, 2])
    seen = (here - complex(poses[nearest, 0], poses[nearest, 1])) * back
    return abs(seen.imag) < lane and abs(seen.real) < 1.0 and (heading * back).real > along_it


@kernel
def drives_behind(
    poses: Table, s: float, tail: float, lane: float, along_it: float, here: complex, heading: complex
) -> bool:
    """Whether somebody drives on the line (`drives_on`), from `tail` m to 2 m behind an ego at s m."""
    at = int(s / SPACING)
    first, end = max(at - int(tail / SPACING), 0), max(at - int(2.0 / SPACING), 1)
    return drives_on(poses, first, min(end, len(poses)), lane, along_it, here, heading)


@kernel
def end_of(
    position: Table, heading: Vector, size: Table, path: Rows, path_s: Vector, poses: Table, stations: int,
    i: int, half: float,
) -> tuple[complex, complex]:  # fmt: skip
    """Place (m) and direction of the other i's front (`half` = 0.5) or tail (-0.5). The direction is that of
    its path there, if it has one: in a bend, a long body is at an angle to it.
    """
    direction, ahead = cmath.exp(1j * heading[i]), half * size[i, 0]
    there = complex(position[i, 0], position[i, 1]) + ahead * direction
    if path[i] >= 0:
        direction = cmath.exp(1j * on_line(poses, stations, path[i], path_s[i] + ahead)[1])
    return there, direction


@kernel
def follows(
    position: Table, heading: Vector, size: Table, path: Rows, path_s: Vector, poses: Table, stations: int,
    line: Table, s: float, tail: float, lane: float, along_it: float, i: int,
) -> bool:  # fmt: skip
    """Whether the other i, by its centre or by its front, drives behind an ego at s m of a line
    (`drives_behind`). In a bend the centre of a long one is beside the line.
    """
    here = complex(position[i, 0], position[i, 1])
    if drives_behind(line, s, tail, lane, along_it, here, cmath.exp(1j * heading[i])):
        return True
    front, facing = end_of(position, heading, size, path, path_s, poses, stations, i, 0.5)
    return drives_behind(line, s, tail, lane, along_it, front, facing)


@kernel
def driving_behind(
    position: Table, heading: Vector, velocity: Table, size: Table, path: Rows, path_s: Vector,
    poses: Table, stations: int, line: Table, s: float, tail: float, lane: float, along_it: float, who: Rows,
) -> NewFlags:  # fmt: skip
    """(n,) whether each of the others `who` (n,) drives behind the ego (`follows`)."""
    behind = np.empty(len(who), np.bool_)
    for k in range(len(who)):
        behind[k] = follows(
            position, heading, size, path, path_s, poses, stations, line, s, tail, lane, along_it, who[k]
        )
    return behind


# ---- the gate


@kernel
def ellipses_meet(
    r: complex, facing: complex, other: complex, short: float, stretch: float, its_short: float,
    its_stretch: float, gap: float,
) -> bool:  # fmt: skip
    """Whether |r| < rho + its rho + gap; rho^2 = short + stretch cos^2 theta."""
    squared = max(r.real**2 + r.imag**2, CLOSEST)
    along, own = (r * facing.conjugate()).real, (r * other.conjugate()).real
    radii = math.sqrt(short + stretch * (along**2 / squared))
    radii += math.sqrt(its_short + its_stretch * (own**2 / squared))
    return math.sqrt(squared) < radii + gap


@kernel
def meeting(
    position: Table, heading: Vector, velocity: Table, size: Table, path: Rows, path_s: Vector,
    poses: Table, stations: int, ego: PlaceTable, ego_facing: PlaceTable, times: Vector, reach: float,
    gap: float, short: Table, stretch: Table,
) -> NewFlags:  # fmt: skip
    """(N,) whether each other's ellipse comes closer than `gap` m to that of an ego which drives in W ways:
    its positions are `ego` (W, T) m and its directions `ego_facing` (W, T).

    `times`: (T,) s of the poses; `reach`: m, length of the ego's longest way; `short`, `stretch`: (2, N) m2
    as for `Gate.meeting`.
    """
    met = np.zeros(len(heading), np.bool_)
    for i in range(len(heading)):
        speed = math.hypot(velocity[i, 0], velocity[i, 1])
        away = complex(position[i, 0], position[i, 1]) - ego[0, 0]
        longest = gap
        for k in range(2):
            longest += math.sqrt(short[k, i] + max(stretch[k, i], 0.0))
        if abs(away) >= speed * times[-1] + reach + longest:
            continue
        there, turned = other_ahead(
            position, heading, velocity, size, path, path_s, poses, stations, i, speed * times
        )
        for w in range(len(ego)):
            for t in range(len(times)):
                if met[i]:
                    break
                met[i] = ellipses_meet(
                    ego[w, t] - there[t], ego_facing[w, t], turned[t],
                    short[0, i], stretch[0, i], short[1, i], stretch[1, i], gap,
                )  # fmt: skip
    return met


@kernel
def creeping_past(now: float) -> float:
    """m, gap that an ego which is `now` m from a body that stands has to keep to it, however narrow the
    passage: CLOSER less, but not less than LEAST.
    """
    return max(now - CLOSER, min(now, LEAST))


@kernel
def least_separation(
    place: Places, facing: Places, length: float, width: float, its_place: complex, its_facing: complex,
    its_length: float, its_width: float,
) -> float:  # fmt: skip
    """m, least separation (rudc/geometry.py) between an ego at `place` (T,) m facing `facing` (T,) and a body
    that stands. Lengths and widths are half sizes, m.
    """
    least = 1e300
    for t in range(len(place)):
        apart = separation(its_place - place[t], facing[t], its_facing, length, width, its_length, its_width)
        least = min(least, apart)
    return least


@kernel
def two_ways(
    line: Table, ego_s: float, ego: complex, ego_heading: complex, speed: float, acceleration: float,
    top: float, times: Vector,
) -> tuple[NewPlaceTable, NewPlaceTable, float]:  # fmt: skip
    """(2, T) m, (2, T) and m: positions and directions at `times` (T,) s of an ego that goes on along its
    line at `speed` m/s, or from there at `acceleration` m/s2 up to `top` m/s; and the longer way's length.
    """
    there, turned = np.empty((2, len(times)), np.complex128), np.empty((2, len(times)), np.complex128)
    rising = np.minimum(times, max(top - speed, 0.0) / acceleration)
    going = speed * times + acceleration * rising * (times - 0.5 * rising)
    there[0], turned[0] = follow(line, len(line), 0, ego_s, ego, ego_heading, speed * times)
    there[1], turned[1] = follow(line, len(line), 0, ego_s, ego, ego_heading, going)
    return there, turned, going[-1]


@kernel
def drives_past(
    ego: PlaceTable, ego_facing: PlaceTable, length: float, width: float, place: Places, facing: Places,
    its_length: float, its_width: float, gap: float,
) -> bool:  # fmt: skip
    """Whether a body with poses `place` (T,) m and `facing` (T,) drives past an ego with poses (W, T) in the
    opposite direction, and their rectangles stay `gap` m apart. Lengths and widths are half sizes, m.
    """
    for w in range(len(ego)):
        least, across = 1e300, 1.0
        for t in range(len(place)):
            apart = separation(
                place[t] - ego[w, t], ego_facing[w, t], facing[t], length, width, its_length, its_width
            )
            if apart < least:
                least, across = apart, (ego_facing[w, t] * facing[t].conjugate()).real
        if least < gap or across > -OPPOSITE:
            return False
    return True


@kernel
def let_through(
    position: Table, heading: Vector, velocity: Table, size: Table, path: Rows, path_s: Vector,
    poses: Table, stations: int, line: Table, ego_s: float,
    ego: complex, ego_heading: complex, speed: float, acceleration: float, top: float, times: Vector,
    gap: float, short: Table, stretch: Table, tail: float, lane: float, along: float, still: float,
    passing: float, way: Vector, length: float, width: float,
) -> NewRows:  # fmt: skip
    """(n,) indices of the others that meet the ego (`meeting`), unless they drive behind it (`follows`),
    stand and the ego passes them, or come towards it on their own path and drive past it (`drives_past`).

    The ego is at `ego` m facing `ego_heading` at `speed` m/s; it goes on at that speed or at `acceleration`
    m/s2 up to `top` m/s. Its half sizes are `length` and `width` m. A body slower than `still` m/s stands.
    The ego passes it if their rectangles stay `passing` m apart at all points of the ego's `way` (m) or,
    where they are nearer than that now but do not touch, `creeping_past`.
    """
    on, facing_on, _ = two_ways(line, ego_s, ego, ego_heading, speed, acceleration, top, times)
    met = meeting(
        position, heading, velocity, size, path, path_s, poses, stations, on[:1], facing_on[:1], times,
        speed * times[-1], gap, short, stretch,
    )  # fmt: skip
    there, turned = follow(line, len(line), 0, ego_s, ego, ego_heading, way)
    found = np.empty(len(met), np.int64)
    count = 0
    for i in range(len(met)):
        if not met[i]:
            continue
        if follows(position, heading, size, path, path_s, poses, stations, line, ego_s, tail, lane, along, i):
            continue
        here, direction = complex(position[i, 0], position[i, 1]), cmath.exp(1j * heading[i])
        half = 0.5 * size[i, 0], 0.5 * size[i, 1]
        if math.hypot(velocity[i, 0], velocity[i, 1]) < still:
            now = least_separation(there[:1], turned[:1], length, width, here, direction, half[0], half[1])
            least = least_separation(there, turned, length, width, here, direction, half[0], half[1])
            if least >= min(passing, creeping_past(now)) and now > 0.0:
                continue
        elif path[i] >= 0:
            far = times * math.hypot(velocity[i, 0], velocity[i, 1])
            its, its_facing = other_ahead(
                position, heading, velocity, size, path, path_s, poses, stations, i, far
            )
            if drives_past(on, facing_on, length, width, its, its_facing, half[0], half[1], gap):
                continue
        found[count] = i
        count += 1
    return found[:count].copy()


@kernel
def in_conflict(
    position: Table, heading: Vector, velocity: Table, size: Table, path: Rows, path_s: Vector,
    poses: Table, stations: int, line: Table, ego_s: float, ego: complex, ego_heading: complex,
    speed: float, acceleration: float, top: float, times: Vector, short: Table, stretch: Table, who: Rows,
    tail: float, lane: float, along: float,
) -> NewFlags:  # fmt: skip
    """(n,) whether each of the others `who` (n,) meets the ego at any of `times` (T,) s and does not drive
    behind it. The ego goes on along its line either at `speed` m/s or, from there, at `acceleration` m/s2 up
    to `top` m/s.
    """
    there, turned, reach = two_ways(line, ego_s, ego, ego_heading, speed, acceleration, top, times)
    met = meeting(
        position, heading, velocity, size, path, path_s, poses, stations, there, turned, times, reach,
        0.0, short, stretch,
    )  # fmt: skip
    behind = driving_behind(
        position, heading, velocity, size, path, path_s, poses, stations, line, ego_s, tail, lane, along, who
    )
    return met[who] & ~behind


@kernel
def all_sound(
    position: Table,
    heading: Vector,
    velocity: Table,
    path_s: Vector,
    acceleration: Vector,
    size: Table,
    path: Rows,
    rows: int,
) -> bool:
    """Whether all numbers of the arrays are finite, all sizes above 0, and all of `path` (N,) from -1 to
    rows - 1.
    """
    total = 0.0
    for i in range(len(heading)):
        total += position[i, 0] * 0.0 + position[i, 1] * 0.0 + velocity[i, 0] * 0.0 + velocity[i, 1] * 0.0
        total += size[i, 0] * 0.0 + size[i, 1] * 0.0 + heading[i] * 0.0 + path_s[i] * 0.0
        total += acceleration[i] * 0.0
        if not (size[i, 0] > 0.0 and size[i, 1] > 0.0 and -1 <= path[i] < rows):
            return False
    return total == 0.0
