"""The last resort's arithmetic as kernels (see rudc/safety/last_resort.py)."""

from __future__ import annotations

import cmath
import math

import numpy as np

from rudc.env.tracking_kernels import front_wheels
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
from rudc.network.line_kernels import projected
from rudc.network.paths import SPACING
from rudc.safety.kernels import creeping_past, drives_on, end_of, other_ahead
from rudc.world.kernels import slip_of

STRAIGHT = 1e-4
"""1/m, least curvature that is reckoned with"""
FINE = 0.2
"""m that others move, as seen from the ego, between two places that are looked at"""


@kernel
def leads(
    poses: Table, s: float, ahead: float, lane: float, along_it: float, here: complex, heading: complex
) -> bool:
    """Whether somebody drives on the line (`drives_on`), 1 m to 1 + `ahead` m ahead of an ego at s m."""
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
    """(m,) indices of others whom the ego might meet within `reach` m of it, their positions (m, T) m,
    directions (m, T) and half sizes (m, 2) m, and (m,) whether they stand still: slower than `slowest` m/s.

    First come all of them at their present speed. Those whose speed changes by more than `changing` m/s2 come
    once more, braking on or speeding up for another `speeds_up` s; then those who lead the ego, by their
    centre or their tail (`leads`), come once more, braking with `hardest` m/s2.
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
        ahead = reach + 0.5 * size[i, 0]
        tail, facing = end_of(position, heading, size, path, path_s, poses, stations, i, -0.5)
        if acceleration[i] > hardest and (
            leads(line, ego_s, ahead, lane, along, here, direction)
            or leads(line, ego_s, ahead, lane, along, tail, facing)
        ):
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
def least_between(
    before: complex, after: complex, facing: Places, other: Places,
    length: float, width: float, its_length: float, its_width: float,
) -> float:  # fmt: skip
    """m, least `separation` of two rectangles between two instants, at places FINE m apart; inf if they move
    less. The way from the first one's centre to the second one's is `before` m and then `after` m; `facing`
    and `other` (2,) are their directions, those of the nearer instant count.
    """
    moved, least = abs(after - before), math.inf
    for step in range(1, math.ceil(moved / FINE)):
        share = step * FINE / moved
        i = 1 if share > 0.5 else 0
        r = before + share * (after - before)
        least = min(least, separation(r, facing[i], other[i], length, width, its_length, its_width))
    return least


@kernel
def room_left(
    others: PlaceTable, others_facing: PlaceTable, half: Table, still: Marks, place: Places, facing: Places,
    length: float, width: float, margin: float, still_margin: float,
) -> NewVector:  # fmt: skip
    """(m,) m, least separation - min(margin, separation now) towards each of m others. Towards those who
    stand `still` (m,), the margin is `still_margin` at most, and `creeping_past` takes the place of the
    separation now.

    The others are at `others` (m, T) m with half sizes `half` (m, 2) m, the ego at `place` (T,) m with half
    sizes `length` and `width` m. Between two instants both move evenly; that is looked at in steps of FINE m
    where it could leave less room than the instants do: somebody who crosses at 15 m/s comes 1.5 m farther
    from one to the next. inf where centres stay farther apart than all half sizes and `margin` m together.
    """
    room = np.full(len(half), np.inf)
    for k in range(len(half)):
        least, farthest = 1e300, 0.0
        for t in range(len(place)):
            r = others[k, t] - place[t]
            least = min(least, r.real * r.real + r.imag * r.imag)
            if t > 0:
                farthest = max(farthest, abs(r - (others[k, t - 1] - place[t - 1])))
        if math.sqrt(least) >= half[k, 0] + half[k, 1] + length + width + margin + 0.5 * farthest:
            continue
        allowed = min(margin, still_margin) if still[k] else margin
        before, last = 0j, math.inf
        for t in range(len(place)):
            r = others[k, t] - place[t]
            apart = separation(r, facing[t], others_facing[k, t], length, width, half[k, 0], half[k, 1])
            if t == 0:
                allowed = min(allowed, creeping_past(apart) if still[k] else apart)
            room[k] = min(room[k], apart - allowed)
            moved = abs(r - before)
            if t > 0 and 0.5 * (last + apart - moved) - allowed < room[k]:
                between = least_between(
                    before, r, facing[t - 1 : t + 1], others_facing[k, t - 1 : t + 1],
                    length, width, half[k, 0], half[k, 1],
                )  # fmt: skip
                room[k] = min(room[k], between - allowed)
            before, last = r, apart
    return room


@kernel
def on_arc(
    here: complex, psi: float, way: Vector, first: float, slip: float, cg_to_rear: float
) -> tuple[NewPlaces, NewPlaces]:
    """(T,) m and (T,): position and direction of an ego, now at `here` m and heading psi rad, after `way`
    (T,) m with a slip angle of `first` rad in the first step, up to way[1], and of `slip` rad after it.
    """
    place, facing = np.empty(len(way), np.complex128), np.empty(len(way), np.complex128)
    begun = 0.0
    for t in range(len(way)):
        if t == 2 and slip != first:
            here, begun = place[1], way[1]
            psi += way[1] * (math.sin(first) / cg_to_rear)
            first = slip
        moved = way[t] - begun
        turn = 0.5 * moved * (math.sin(first) / cg_to_rear)
        chord = moved * (math.sin(turn) / turn if turn != 0.0 else 1.0)
        place[t] = here + chord * cmath.exp(1j * (psi + first + turn))
        facing[t] = cmath.exp(1j * (psi + 2.0 * turn))
    return place, facing


@kernel
def way_of_stopping(
    times: Vector, step: float, first: float, v: float, braking: float, a: float, lag: float
) -> NewVector:
    """(T,) m driven at `times` (T,) s: `first` m in a step of `step` s, and then braking from v m/s at
    `braking` m/s2. With brakes that lag by `lag` s, the acceleration is a m/s2 after the first step, and
    `times` are whole steps.
    """
    way = np.zeros(len(times))
    if lag > 0.0:
        way[1:] = first
        for t in range(2, len(times)):
            moved, v, a = lagging_step(v, a, -braking, lag, step)
            way[t] = way[t - 1] + moved
        return way
    for t in range(len(times)):
        if times[t] > 0.0:
            held = min(max(times[t] - step, 0.0), v / braking)
            way[t] = first + v * held - 0.5 * braking * held * held
    return way


@kernel
def way_of_going(
    times: Vector, step: float, first: float, v: float, a: float, top: float, braking: float,
    bends: Vector, s: float, lateral: float,
) -> NewVector:  # fmt: skip
    """(T,) m driven at `times` (T,) s, whole steps: `first` m in a step of `step` s, and then along a path of
    curvature `bends` (M,) 1/m at its stations, from s m of it on: from v m/s at a m/s2 up to `top` m/s,
    braking at `braking` m/s2 where that would need more than `lateral` m/s2 in a bend.
    """
    way = np.zeros(len(times))
    way[1:] = first
    for t in range(2, len(times)):
        station = min(int((s + way[t - 1]) / SPACING), len(bends) - 1)
        most = min(max(top, v), math.sqrt(lateral / max(abs(bends[station]), STRAIGHT)))
        after = max(min(v + a * step, most), v - braking * step, 0.0)
        way[t] = way[t - 1] + 0.5 * (v + after) * step
        v = after
    return way


@kernel
def step_onwards(v: float, a: float, step: float) -> tuple[float, float]:
    """m driven in a step of `step` s from v m/s at a m/s2, and m/s after it; never backwards."""
    after = v + a * step
    if after < 0.0:
        return v * v / (-2.0 * a), 0.0
    return 0.5 * (v + after) * step, after


@kernel
def lagging_step(v: float, a: float, command: float, lag: float, step: float) -> tuple[float, float, float]:
    """m driven in a step of `step` s from v m/s, never backwards, and m/s and m/s2 after it. The acceleration
    is a m/s2 at first and follows `command` m/s2 with a lag of `lag` s:
    command + (a - command) exp(-t / lag).
    """
    if lag <= 0.0:
        way, after = step_onwards(v, command, step)
        return way, after, command
    gained = (a - command) * lag
    kept = math.exp(-step / lag)
    moving, after = step, v + command * step + gained * (1.0 - kept)
    if after < 0.0:  # it stops within the step; when is found by halving
        moving, after, end = 0.0, 0.0, step
        for _ in range(30):
            middle = 0.5 * (moving + end)
            if v + command * middle + gained * (1.0 - math.exp(-middle / lag)) > 0.0:
                moving = middle
            else:
                end = middle
    settled = moving - lag * (1.0 - math.exp(-moving / lag))
    way = v * moving + 0.5 * command * moving * moving + gained * settled
    return max(way, 0.0), after, command + (a - command) * kept


@kernel
def steering_along(
    line: Table, curvature: Vector, s: float, place: Places, facing: Places, way: Vector,
    step: float, preview: float, seconds: float, longest: float,
    wheelbase: float, cg_to_rear: float, delta_max: float, lateral: float,
) -> tuple[NewPlaces, NewPlaces]:  # fmt: skip
    """(T,) m and (T,): position and direction, after `way` (T,) m, of an ego that drives the first step of
    `step` s as given by `place` (T,) m and `facing` (T,), and then steers along a line, on which it is at s m
    in the beginning, with a lateral acceleration of at most `lateral` m/s2.
    """
    places, directions = place.copy(), facing.copy()
    here, heading = place[1], cmath.phase(facing[1])
    for t in range(2, len(place)):
        moved = way[t] - way[t - 1]
        if moved > 0.0:
            s, offset = projected(line, here.real, here.imag, int(s / SPACING))
            delta = front_wheels(
                line, curvature, s, offset, heading, moved / step, preview, seconds, longest,
                wheelbase, cg_to_rear, delta_max,
            )  # fmt: skip
            slip, tightest = slip_of(delta, wheelbase, cg_to_rear), lateral * cg_to_rear * (step / moved) ** 2
            if abs(math.sin(slip)) > tightest:
                slip = math.copysign(math.asin(tightest), slip)
            turn = moved * math.sin(slip) / cg_to_rear
            here += moved * cmath.exp(1j * (heading + slip + 0.5 * turn))
            heading += turn
        places[t], directions[t] = here, cmath.exp(1j * heading)
    return places, directions


@kernel
def room_to_stop(
    position: Table, heading: Vector, velocity: Table, size: Table, path: Rows, path_s: Vector,
    acceleration: Vector, poses: Table, stations: int, ego: complex, reach: float, times: Vector,
    changing: float, speeds_up: float, line: Table, ego_s: float, lane: float, along: float, hardest: float,
    slowest: float, psi: float, step: float, first: float, v: float, braking: float, a: float, lag: float,
    first_slip: float, slip: float, cg_to_rear: float, length: float, width: float, margin: float,
    still_margin: float,
) -> float:  # fmt: skip
    """m, the least `room_left` for an ego that stops (`way_of_stopping`) on arcs (`on_arc`), towards those
    `in_reach`; inf if nobody comes near.
    """
    who, there, turned, half, still = in_reach(
        position, heading, velocity, size, path, path_s, acceleration, poses, stations, ego, reach,
        times, changing, speeds_up, line, ego_s, lane, along, hardest, slowest,
    )  # fmt: skip
    way = way_of_stopping(times, step, first, v, braking, a, lag)
    place, facing = on_arc(ego, psi, way, first_slip, slip, cg_to_rear)
    room = room_left(there, turned, half, still, place, facing, length, width, margin, still_margin)
    least = math.inf
    for k in range(len(who)):
        least = min(least, room[k])
    return least
