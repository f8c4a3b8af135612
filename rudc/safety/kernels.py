"""Prediction, gate and last resort as kernels; formulas stand at the heads of the modules that call them."""

from __future__ import annotations

import cmath
import math

import numpy as np

from rudc.env.kernels import front_wheels
from rudc.kernels import (
    Marks,
    NewFlags,
    NewPlaces,
    NewPlaceTable,
    NewRows,
    NewTable,
    NewVector,
    Places,
    PlaceTable,
    Rows,
    Table,
    Vector,
    kernel,
    separation,
)
from rudc.network.line_kernels import along_line, body_along_line, body_on_line, on_line, projected
from rudc.network.paths import SPACING
from rudc.safety.barrier_kernels import CLOSEST
from rudc.world.kernels import slip_of

# ---- prediction


@kernel
def follow(
    poses: Table, stations: int, row: int, s: float, here: complex, heading: complex, way: Vector
) -> tuple[NewPlaces, NewPlaces]:
    """(T,) m and (T,): who is at `here` m facing `heading`, after `way` (T,) m along a line on which that is
    s m, keeping its offset from the line and its angle to it.
    """
    start, psi = on_line(poses, stations, row, s)
    back = cmath.exp(-1j * psi)
    return along_line(poses, stations, row, s, (here - start) * back, heading * back, way)


@kernel
def other_ahead(
    position: Table, heading: Vector, velocity: Table, size: Table, path: Rows, path_s: Vector,
    poses: Table, stations: int, i: int, way: Vector,
) -> tuple[NewPlaces, NewPlaces]:  # fmt: skip
    """(T,) m and (T,): somebody else after `way` (T,) m along its path, straight on if it has none."""
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
    """(n, T) m and (n, T): others `who` (n,) after `way` (n, T) m."""
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
    """Whether somebody `here` m facing `heading` drives on a line, between its stations `first` and `end`.

    Within `lane` m of it, turned from it by a cosine of more than `along_it`. Every other station is
    looked at.
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
    """Whether somebody drives on the line, up to `tail` m behind an ego at s m; else as `drives_on`."""
    at = int(s / SPACING)
    first, end = max(at - int(tail / SPACING), 0), max(at - int(2.0 / SPACING), 1)
    return drives_on(poses, first, end, lane, along_it, here, heading)


@kernel
def driving_behind(
    poses: Table, s: float, tail: float, lane: float, along_it: float, position: Table, heading: Vector,
    who: Rows,
) -> NewFlags:  # fmt: skip
    """(n,) whether each of the others `who` (n,) drives behind the ego (`drives_behind`)."""
    behind = np.empty(len(who), np.bool_)
    for k in range(len(who)):
        here = complex(position[who[k], 0], position[who[k], 1])
        behind[k] = drives_behind(poses, s, tail, lane, along_it, here, cmath.exp(1j * heading[who[k]]))
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
    """(N,) whose ellipse comes closer than `gap` m to that of an ego at any of W x T poses (W, T).

    `times` (T,) s of the poses, the ego's longest way is `reach` m; `short`, `stretch` (2, N) m2.
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
def least_separation(
    place: Places, facing: Places, length: float, width: float, its_place: complex, its_facing: complex,
    its_length: float, its_width: float,
) -> float:  # fmt: skip
    """m, least separation of an ego at `place` (T,) m facing `facing` (T,) from a body that stands.

    Lengths and widths are half sizes, m.
    """
    least = 1e300
    for t in range(len(place)):
        apart = separation(its_place - place[t], facing[t], its_facing, length, width, its_length, its_width)
        least = min(least, apart)
    return least


@kernel
def let_through(
    position: Table, heading: Vector, velocity: Table, size: Table, path: Rows, path_s: Vector,
    poses: Table, stations: int, line: Table, ego_s: float,
    ego: complex, ego_heading: complex, speed: float, times: Vector, gap: float, short: Table, stretch: Table,
    tail: float, lane: float, along: float, still: float, passing: float, way: Vector,
    length: float, width: float,
) -> NewRows:  # fmt: skip
    """Who meets the ego, does not drive behind it (`drives_behind`), and is not passed by it while standing.

    An ego at `ego` m facing `ego_heading` at `speed` m/s; `still` m/s and less stands, and is passed if
    rectangles stay `passing` m apart on a `way` of the ego, whose half sizes are `length` and `width` m, or,
    where they are nearer already, come no nearer.
    """
    there, turned = follow(line, len(line), 0, ego_s, ego, ego_heading, speed * times)
    met = meeting(
        position, heading, velocity, size, path, path_s, poses, stations, there.reshape(1, -1),
        turned.reshape(1, -1), times, speed * times[-1], gap, short, stretch,
    )  # fmt: skip
    there, turned = follow(line, len(line), 0, ego_s, ego, ego_heading, way)
    found = np.empty(len(met), np.int64)
    count = 0
    for i in range(len(met)):
        if not met[i]:
            continue
        here, direction = complex(position[i, 0], position[i, 1]), cmath.exp(1j * heading[i])
        if drives_behind(line, ego_s, tail, lane, along, here, direction):
            continue
        half = 0.5 * size[i, 0], 0.5 * size[i, 1]
        if math.hypot(velocity[i, 0], velocity[i, 1]) < still:
            now = least_separation(there[:1], turned[:1], length, width, here, direction, half[0], half[1])
            least = least_separation(there, turned, length, width, here, direction, half[0], half[1])
            if least >= min(passing, now) and now > 0.0:
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
    """(n,) which of the others `who` (n,) meet an ego that goes on along its line at `speed` m/s, or at
    `acceleration` m/s2 up to `top` m/s, at any of `times` (T,) s, and do not drive behind it.
    """
    there, turned = np.empty((2, len(times)), np.complex128), np.empty((2, len(times)), np.complex128)
    rising = np.minimum(times, max(top - speed, 0.0) / acceleration)
    going = speed * times + acceleration * rising * (times - 0.5 * rising)
    there[0], turned[0] = follow(line, len(line), 0, ego_s, ego, ego_heading, speed * times)
    there[1], turned[1] = follow(line, len(line), 0, ego_s, ego, ego_heading, going)
    met = meeting(
        position, heading, velocity, size, path, path_s, poses, stations, there, turned, times, going[-1],
        0.0, short, stretch,
    )  # fmt: skip
    return met[who] & ~driving_behind(line, ego_s, tail, lane, along, position, heading, who)


@kernel
def all_finite(position: Table, heading: Vector, velocity: Table, path_s: Vector, size: Table) -> bool:
    """Whether all of them are."""
    total = 0.0
    for i in range(len(heading)):
        total += position[i, 0] * 0.0 + position[i, 1] * 0.0 + velocity[i, 0] * 0.0 + velocity[i, 1] * 0.0
        total += size[i, 0] * 0.0 + size[i, 1] * 0.0 + heading[i] * 0.0 + path_s[i] * 0.0
    return total == 0.0


# ---- the last resort


@kernel
def leads(
    poses: Table, s: float, ahead: float, lane: float, along_it: float, here: complex, heading: complex
) -> bool:
    """Whether somebody drives on the line, 1 to `ahead` m before an ego at s m; else as `drives_on`."""
    first = min(max(int((s + 1.0) / SPACING), 0), len(poses) - 1)
    end = min(first + int(ahead / SPACING), len(poses))
    return drives_on(poses, first, end, lane, along_it, here, heading)


@kernel
def in_reach(
    position: Table, heading: Vector, velocity: Table, size: Table, path: Rows, path_s: Vector,
    acceleration: Vector,
    poses: Table, stations: int, ego: complex, reach: float,
    times: Vector, changing: float, speeds_up: float,
    line: Table, ego_s: float, lane: float, along: float, hardest: float, slowest: float,
) -> tuple[NewRows, NewPlaceTable, NewPlaceTable, NewTable, NewFlags]:  # fmt: skip
    """Others (m,) whom the ego might meet within `reach` m of it, their places (m, T) m, directions (m, T)
    and half sizes (m, 2) m, and whether (m,) they stand: drive less than `slowest` m/s.

    Then once more those whose speed changes by more than `changing` m/s2: braking on, or speeding up for
    another `speeds_up` s. Then once more those who lead the ego (`leads`), braking with `hardest` m/s2.
    """
    n, horizon = len(heading), times[-1]
    who, rate = np.empty(3 * n, np.int64), np.zeros(3 * n)
    m = 0
    for i in range(n):
        speed = math.hypot(velocity[i, 0], velocity[i, 1])
        away = math.hypot(position[i, 0] - ego.real, position[i, 1] - ego.imag)
        if acceleration[i] > changing:
            speed += acceleration[i] * speeds_up
        if away < speed * horizon + reach + 0.5 * (size[i, 0] + size[i, 1]):
            who[m] = i
            m += 1
    near = m
    for k in range(near):
        if abs(acceleration[who[k]]) > changing:
            who[m], rate[m] = who[k], acceleration[who[k]]
            m += 1
    for k in range(near):
        i = who[k]
        here, direction = complex(position[i, 0], position[i, 1]), cmath.exp(1j * heading[i])
        if acceleration[i] > hardest and leads(line, ego_s, reach, lane, along, here, direction):
            who[m], rate[m] = i, hardest
            m += 1
    there, turned = np.empty((m, len(times)), np.complex128), np.empty((m, len(times)), np.complex128)
    half, still, way = np.empty((m, 2)), np.empty(m, np.bool_), np.empty(len(times))
    for k in range(m):
        i = who[k]
        speed = math.hypot(velocity[i, 0], velocity[i, 1])
        half[k, 0], half[k, 1], still[k] = 0.5 * size[i, 0], 0.5 * size[i, 1], speed < slowest
        for t in range(len(times)):
            way[t] = speed * times[t]
            if k >= near:
                a = rate[k]
                held = min(times[t], speed / -a if a < 0.0 else speeds_up)
                rest = times[t] - held if a > 0.0 else 0.0
                way[t] = speed * held + 0.5 * a * held * held + (speed + a * held) * rest
        there[k], turned[k] = other_ahead(
            position, heading, velocity, size, path, path_s, poses, stations, i, way
        )
    return who[:m].copy(), there, turned, half, still


@kernel
def room_left(
    others: PlaceTable, others_facing: PlaceTable, half: Table, still: Marks, place: Places, facing: Places,
    length: float, width: float, margin: float, still_margin: float,
) -> NewVector:  # fmt: skip
    """(m,) m, least separation - min(margin, separation now) towards each of m others; `still_margin`
    towards those who stand `still` (m,).

    Others at (m, T) m with half sizes (m, 2) m, the ego (T,) with half sizes `length` and `width` m; inf
    where centres stay farther apart than the sum of half sizes and `margin` m.
    """
    room = np.full(len(half), np.inf)
    for k in range(len(half)):
        least = 1e300
        for t in range(len(place)):
            r = others[k, t] - place[t]
            least = min(least, r.real * r.real + r.imag * r.imag)
        if math.sqrt(least) >= half[k, 0] + half[k, 1] + length + width + margin:
            continue
        allowed = min(margin, still_margin) if still[k] else margin
        for t in range(len(place)):
            r = others[k, t] - place[t]
            apart = separation(r, facing[t], others_facing[k, t], length, width, half[k, 0], half[k, 1])
            if t == 0:
                allowed = min(allowed, apart)
            room[k] = min(room[k], apart - allowed)
    return room


@kernel
def on_arc(
    here: complex, psi: float, way: Vector, slip: float, cg_to_rear: float
) -> tuple[NewPlaces, NewPlaces]:
    """(T,) m and (T,): an ego at `here` m, heading psi rad, after `way` (T,) m with that slip (rad) held."""
    place, facing = np.empty(len(way), np.complex128), np.empty(len(way), np.complex128)
    for t in range(len(way)):
        turn = 0.5 * way[t] * (math.sin(slip) / cg_to_rear)
        chord = way[t] * (math.sin(turn) / turn if turn != 0.0 else 1.0)
        place[t] = here + chord * cmath.exp(1j * (psi + slip + turn))
        facing[t] = cmath.exp(1j * (psi + 2.0 * turn))
    return place, facing


@kernel
def way_of_stopping(times: Vector, step: float, first: float, v: float, braking: float) -> NewVector:
    """(T,) m at `times` (T,) s: `first` m in a step of `step` s, to v m/s, and then braking, in m/s2."""
    way = np.zeros(len(times))
    for t in range(len(times)):
        if times[t] > 0.0:
            held = min(max(times[t] - step, 0.0), v / braking)
            way[t] = first + v * held - 0.5 * braking * held * held
    return way


@kernel
def step_onwards(v: float, a: float, step: float) -> tuple[float, float]:
    """m travelled in a step of `step` s from v m/s at a m/s2, and m/s after it; nobody drives backwards."""
    after = v + a * step
    if after < 0.0:
        return v * v / (-2.0 * a), 0.0
    return 0.5 * (v + after) * step, after


@kernel
def stop_along(
    line: Table, curvature: Vector, s: float, place: Places, facing: Places, v: float, braking: float,
    step: float, preview: float, way_back: float, wheelbase: float, cg_to_rear: float, delta_max: float,
) -> tuple[NewPlaces, NewPlaces]:  # fmt: skip
    """(T,) m and (T,): the first step of an ego at `place` (T,) m facing `facing` (T,), after which it drives
    v m/s, and then braking, in m/s2, while steering along a line on which it was s m.
    """
    places, directions = place.copy(), facing.copy()
    here, heading = place[1], cmath.phase(facing[1])
    for t in range(2, len(place)):
        way, v = step_onwards(v, -braking, step)
        if way > 0.0:
            s, offset = projected(line, here.real, here.imag, int(s / SPACING))
            delta = front_wheels(
                line, curvature, s, offset, heading, v, preview, way_back, wheelbase, cg_to_rear, delta_max
            )
            slip = slip_of(delta, wheelbase, cg_to_rear)
            turn = way * math.sin(slip) / cg_to_rear
            here += way * cmath.exp(1j * (heading + slip + 0.5 * turn))
            heading += turn
        places[t], directions[t] = here, cmath.exp(1j * heading)
    return places, directions


@kernel
def room_to_stop(
    position: Table, heading: Vector, velocity: Table, size: Table, path: Rows, path_s: Vector,
    acceleration: Vector, poses: Table, stations: int, ego: complex, reach: float, times: Vector,
    changing: float, speeds_up: float, line: Table, ego_s: float, lane: float, along: float, hardest: float,
    slowest: float, psi: float, step: float, first: float, v: float, braking: float, slip: float,
    cg_to_rear: float, length: float, width: float, margin: float, still_margin: float,
) -> float:  # fmt: skip
    """m, the least `room_left` to an ego that stops (`way_of_stopping`) on an arc (`on_arc`), towards those
    `in_reach`; inf for plenty.
    """
    who, there, turned, half, still = in_reach(
        position, heading, velocity, size, path, path_s, acceleration, poses, stations, ego, reach,
        times, changing, speeds_up, line, ego_s, lane, along, hardest, slowest,
    )  # fmt: skip
    place, facing = on_arc(ego, psi, way_of_stopping(times, step, first, v, braking), slip, cg_to_rear)
    room = room_left(there, turned, half, still, place, facing, length, width, margin, still_margin)
    least = math.inf
    for k in range(len(who)):
        least = min(least, room[k])
    return least
