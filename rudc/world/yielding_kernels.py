"""The yielding layer's arithmetic as kernels; the head of rudc/world/yielding.py says what it decides.

Places are complex numbers x + iy in m, and directions complex numbers of magnitude 1.
"""

from __future__ import annotations

import cmath
import math

import numpy as np

from rudc.kernels import (
    Marks,
    NewFlags,
    NewPlaces,
    NewRows,
    NewVector,
    Places,
    Rows,
    Table,
    Vector,
    kernel,
    separation,
)
from rudc.network.line_kernels import body_along_line, body_on_line, on_line
from rudc.world.scene import STANDING

STEP_S = 0.25
"""s between the instants that are predicted"""
INSTANTS = 9
"""how many instants are predicted; the first is now"""
HORIZON_S = STEP_S * (INSTANTS - 1)
"""s, the last instant"""
LAYER_S = 0.5
"""s from one pass of the yielding layer to the next, in whole decisions: 2 Hz, as in the paper's simulator"""
GROW_LENGTH, GROW_WIDTH = 1.0, 0.4
"""m, added to an SV's length and width"""
SQUEEZED = 0.1
"""m, added instead to the width of an SV that stands or creeps, where the ego stands; then only its front
reaches farther, since its tail follows"""
BRAKE_FROM = 1.5
"""m/s2, needed deceleration above which an SV brakes, even if the overlap is not near"""
SHARE = 0.5
"""of the hardest braking there is, above which it brakes, too: on ice it could not stop from BRAKE_FROM on"""
CREEP = 1.0
"""m/s, speed at which a standing SV is taken to set off"""
LINGERS = 1.0
"""m/s, below which the ego is taken to stay where it is: twice STANDING, since an ego that creeps is still in
the way for the next 2 s"""
PICKS_UP = 2.5
"""m/s2, with which a vehicle that creeps or stands is taken to drive on when it may"""
CREEPS = 3.0
"""m/s, up to which an SV inside the junction yields to faster ones"""
FACED_M = 20.0
"""m that an SV leaves free before an ego that faces it in the SV's lane, so that the ego can return to its
own
"""
FACED_AHEAD = 60
"""m of an SV's way on which it looks for such an ego"""
FACING = -math.cos(math.pi / 6)
"""cosine of the angle between an SV's lane and the ego, below which the ego faces it"""
STEADY = 4.5
"""m/s2, with which an SV stops that is already nearer to such an ego than FACED_M"""
SWEPT_M = 2.5
"""m between the INSTANTS places that an SV, driving on through the junction, is taken to sweep over"""
NEAR_M = 10.0
"""m: bodies whose centres are farther apart than both drive within the horizon, and this, cannot overlap"""


@kernel
def in_lane(
    poses: Table, stations: int, row: int, s: float, x: float, y: float, length: float, step: float,
    growth: float,
) -> tuple[NewPlaces, NewPlaces]:  # fmt: skip
    """Places (INSTANTS,) m and directions (INSTANTS,) of a body `length` m long that is at (x, y) m now,
    after t = 0, 1, 2, ... instants, step * t + growth * t^2 / 2 m along its row from s m on. Its lateral
    offset from the row stays as now.

    A vehicle may drive beside its row: it passes an obstacle on a lane that does not lead to its destination.
    """
    start, along = body_on_line(poses, stations, row, s, length)
    beside = ((complex(x, y) - start) * along.conjugate()).imag
    way = np.empty(INSTANTS)
    for t in range(INSTANTS):
        way[t] = t * step + 0.5 * growth * t**2
    return body_along_line(poses, stations, row, s, length, 1j * beside, complex(1.0), way)


@kernel
def straight_on(x: float, y: float, psi: float, velocity: complex) -> tuple[NewPlaces, NewPlaces]:
    """Places (INSTANTS,) m and directions (INSTANTS,) of a body with a constant velocity (m/s) and heading
    psi (rad), from (x, y) m on.
    """
    place = np.empty(INSTANTS, np.complex128)
    for t in range(INSTANTS):
        place[t] = complex(x, y) + velocity * (t * STEP_S)
    return place, np.full(INSTANTS, cmath.exp(1j * psi))


@kernel
def near_ego(
    position: Table, heading: Vector, velocity: Table, size: Table, path: Rows, heeds: Marks,
    x: float, y: float, v: float,
) -> NewFlags:  # fmt: skip
    """(N,) whether each is an SV whose path must heed the ego (`heeds` (P,)), that has the ego, at (x, y) m,
    ahead and could meet it, in whatever direction the ego drives at v m/s.
    """
    found = np.zeros(len(path), np.bool_)
    for i in range(len(path)):
        away_x, away_y = x - position[i, 0], y - position[i, 1]
        ahead = math.cos(heading[i]) * away_x + math.sin(heading[i]) * away_y
        speed = math.hypot(velocity[i, 0], velocity[i, 1])
        near = math.hypot(away_x, away_y) < HORIZON_S * (speed + v) + NEAR_M
        found[i] = path[i] >= 0 and heeds[path[i]] and near and ahead > -0.5 * size[i, 0] - 3.0
    return found


@kernel
def mark_overlaps(
    hits: NewFlags, place: Places, facing: Places, length: float, width: float,
    its_place: Places, its_facing: Places, its_length: float, its_width: float,
) -> int:  # fmt: skip
    """Set `hits` (INSTANTS,) where two rectangles overlap, given their places (m) and directions (INSTANTS,)
    and half their lengths and widths (m). Returns 0.
    """
    reach = length + width + its_length + its_width
    for t in range(INSTANTS):
        r = its_place[t] - place[t]
        if hits[t] or abs(r.real) > reach or abs(r.imag) > reach:
            continue
        hits[t] = separation(r, facing[t], its_facing[t], length, width, its_length, its_width) <= 0.0
    return 0


@kernel
def braking(hits: NewFlags, speed: float, passed: bool, most: float) -> float:
    """m/s2, how hard a vehicle at `speed` m/s brakes that would overlap with another at `hits` (INSTANTS,).

    0: it only must not go faster; negative: it need do nothing. `hits` are at max(speed, CREEP). `passed`: it
    stands and the other passes it.
    """
    sets_off, first, always = max(speed, CREEP), 0, hits[0]
    for t in range(INSTANTS - 1, 0, -1):
        always = always and hits[t]
        if hits[t]:
            first = t
    # An overlap that is there already cannot be braked away, and the SV may be driving out of it.
    if first == 0 or (hits[0] and not always and not passed):
        return -1.0
    room = sets_off * (STEP_S * (first - 1))
    need = sets_off**2 / (2.0 * max(room - 0.3, 0.05))
    if need > min(BRAKE_FROM, SHARE * most) or first <= 2:
        return min(need, most)
    # On a slippery road who creeps may not be able to stop after picking up speed until the next pass.
    faster = speed + PICKS_UP * LAYER_S
    way = 0.5 * (speed + faster) * LAYER_S + faster**2 / (2.0 * most)
    return 0.0 if speed > CREEP or way > room + 0.5 * GROW_LENGTH else -1.0


@kernel
def room_before(
    poses: Table, stations: int, row: int, s: float, width: float, ego: complex, facing: complex
) -> float:
    """m along an SV's row, from s m on, to an ego at `ego` m with direction `facing`, if the ego faces the SV
    and is less than `width` m beside the row, so that the SV cannot pass it. inf otherwise, and beyond
    FACED_AHEAD m.
    """
    for m in range(FACED_AHEAD):
        here, heading = on_line(poses, stations, row, s + m)
        r = (ego - here) * cmath.exp(-1j * heading)
        if 0.0 <= r.real < 1.0:
            faces = (facing * cmath.exp(-1j * heading)).real < FACING
            return m + r.real if faces and abs(r.imag) < width else math.inf
    return math.inf


@kernel
def braking_before(room: float, speed: float, most: float) -> float:
    """m/s2, how hard an SV at `speed` m/s brakes to stop within `room` m; negative if it need not yet."""
    need = STEADY if room <= 0.3 else speed**2 / (2.0 * room)
    return min(need, most) if need > min(BRAKE_FROM, SHARE * most) else -1.0


@kernel
def braking_for_others(
    place: Places, facing: Places, length: float, width: float, most: float, i: int,
    obstacles_only: bool, speed: Vector, inside: NewFlags, position: Table, heading: Vector, velocity: Table,
    size: Table, path: Rows, path_s: Vector, poses: Table, stations: int, origin: Rows,
) -> float:  # fmt: skip
    """m/s2, as `braking`: how hard SV i, with predicted places `place` m and directions `facing` (INSTANTS,),
    brakes for obstacles, and, unless it yields to `obstacles_only`, if it creeps in the junction, for places
    that faster SVs from other arms will sweep over. The largest value counts.

    Each is tested by itself, so that an SV that already overlaps with one of them still brakes for the next.
    """
    need = -1.0
    for j in range(len(path)):
        half = 0.5 * size[j, 0], 0.5 * size[j, 1]
        x, y = position[j, 0], position[j, 1]
        away = math.hypot(position[i, 0] - x, position[i, 1] - y)
        if path[j] < 0:
            if away < HORIZON_S * (speed[i] + speed[j]) + NEAR_M + size[j, 0]:
                hits, drift = np.zeros(INSTANTS, np.bool_), complex(velocity[j, 0], velocity[j, 1])
                there, turned = straight_on(x, y, heading[j], drift)
                mark_overlaps(hits, place, facing, length, width, there, turned, half[0], half[1])
                goes_by = hits[0] and speed[i] < STANDING <= speed[j]
                need = max(need, braking(hits, speed[i], goes_by, most))
            continue
        passes = inside[i] and inside[j] and speed[i] <= CREEPS < speed[j]
        if obstacles_only or not passes or origin[path[i]] == origin[path[j]]:
            continue
        hits = np.zeros(INSTANTS, np.bool_)
        swept, along = in_lane(poses, stations, path[j], path_s[j], x, y, size[j, 0], SWEPT_M, 0.0)
        for k in range(INSTANTS):
            there, turned = np.full(INSTANTS, swept[k]), np.full(INSTANTS, along[k])
            mark_overlaps(hits, place, facing, length, width, there, turned, half[0], half[1])
        need = max(need, braking(hits, speed[i], False, most))
    return need


@kernel
def yielding(
    position: Table, heading: Vector, velocity: Table, size: Table, path: Rows, path_s: Vector,
    poses: Table, stations: int, origin: Rows, inside: NewFlags,
    heeding: NewFlags, obstacles_only: NewFlags, ego: Places, ego_facing: Places, length: float, width: float,
    moves: bool, astray: bool, most: float,
) -> tuple[NewRows, NewVector, NewFlags]:  # fmt: skip
    """Rows (m,) of the SVs that must brake or must not go faster, how hard each brakes (m,) m/s2, and whether
    it has to for the ego (m,).

    `inside` (N,): which SVs are in the junction; `heeding` (N,): which yield to the ego; `obstacles_only`
    (N,): which yield to nothing else; `ego`, `ego_facing` (INSTANTS,): the ego's predicted places (m) and
    directions; `length`, `width`: the ego's, m; `moves`: whether it moves; `astray`: whether it is off its
    path; `most`: m/s2, hardest braking.
    """
    n, count, obstacles = len(path), 0, False
    rows, needs, speed = np.empty(n, np.int64), np.empty(n), np.empty(n)
    for_ego = np.zeros(n, np.bool_)
    for i in range(n):
        speed[i] = math.hypot(velocity[i, 0], velocity[i, 1])
        obstacles = obstacles or path[i] < 0
    for i in range(n):
        if path[i] < 0 or not (heeding[i] or astray or obstacles or (inside[i] and speed[i] <= CREEPS)):
            continue
        need = -1.0
        half = 0.5 * (size[i, 0] + GROW_LENGTH), 0.5 * (size[i, 1] + GROW_WIDTH)
        beside, shorter = half[1], 0.0
        if not moves and speed[i] <= CREEP:
            beside, shorter = 0.5 * (size[i, 1] + SQUEEZED), 0.25 * GROW_LENGTH
        x, y = position[i, 0], position[i, 1]
        step = max(speed[i], CREEP) * STEP_S
        place, facing = in_lane(poses, stations, path[i], path_s[i], x, y, size[i, 0], step, 0.0)
        if heeding[i]:
            hits = np.zeros(INSTANTS, np.bool_)
            mark_overlaps(
                hits, place + shorter * facing, facing, half[0] - shorter, beside,
                ego, ego_facing, 0.5 * length, 0.5 * width,
            )  # fmt: skip
            need = braking(hits, speed[i], hits[0] and moves and speed[i] < STANDING, most)
            if moves and speed[i] <= CREEPS and not hits[0]:
                step = speed[i] * STEP_S
                soon, turned = in_lane(
                    poses, stations, path[i], path_s[i], x, y, size[i, 0], step, PICKS_UP * STEP_S**2
                )
                mark_overlaps(hits, soon, turned, half[0], beside, ego, ego_facing, 0.5 * length, 0.5 * width)
                need = max(need, 0.0 if hits.any() else -1.0)
        if astray and not obstacles_only[i]:
            beyond = 0.5 * (size[i, 0] + length) + FACED_M
            clear = 0.5 * (size[i, 1] + width + SQUEEZED)
            room = room_before(poses, stations, path[i], path_s[i], clear, ego[0], ego_facing[0])
            need = max(need, braking_before(room - beyond, speed[i], most))
        others = braking_for_others(
            place, facing, half[0], half[1], most, i, obstacles_only[i], speed, inside,
            position, heading, velocity, size, path, path_s, poses, stations, origin,
        )  # fmt: skip
        if need >= 0.0 or others >= 0.0:
            rows[count], needs[count], for_ego[count] = i, max(need, others), need >= 0.0
            count += 1
    return rows[:count].copy(), needs[:count].copy(), for_ego[:count].copy()
