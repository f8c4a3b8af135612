"""The yielding layer's arithmetic as kernels; what it decides: see the head of rudc/world/yielding.py."""

from __future__ import annotations

import cmath
import math

import numpy as np

from rudc.kernels import (
    Marks,
    NewFlags,
    NewRows,
    NewTable,
    NewVector,
    Rows,
    Table,
    Vector,
    kernel,
    separation,
)
from rudc.network.paths import SPACING
from rudc.world.scene import STANDING

STEP_S = 0.25
"""s between the instants looked at"""
INSTANTS = 9
"""how many they are; the first is now"""
HORIZON_S = STEP_S * (INSTANTS - 1)
"""s, the last of them"""
GROW_LENGTH, GROW_WIDTH = 1.0, 0.4
"""m, added to an SV's length and width"""
BRAKE_FROM = 1.5
"""m/s2, needed deceleration at which an SV begins to brake"""
CREEP = 1.0
"""m/s, speed at which a standing SV is taken to set off"""
LINGERS = 1.0
"""m/s, below which the ego is taken to stay where it is: twice STANDING, since one that creeps is in the way
for the next 2 s all the same"""
CREEPS = 3.0
"""m/s, up to which an SV in the junction looks out for faster ones"""
SWEPT_M = 2.5
"""m between the places ahead of those, INSTANTS in number, that they will sweep over"""
SPARE_M = 2.0
"""m along either path beyond bumpers within which paths are taken to meet; covers wide vehicles"""
NEAR_M = 10.0
"""m between centres beyond what both cover in the horizon, within which bodies may come to overlap"""


@kernel
def on_row(poses: Table, first: int, stations: int, s: float) -> tuple[float, float, float]:
    """x m, y m and heading rad s m along the line with `stations` stations from `first` on in poses (..., 3);
    straight on beyond its ends.
    """
    at = s * (1.0 / SPACING)
    i = int(min(max(at, 0.0), stations - 2.0))
    t, k = at - i, first + i
    x, y = (
        poses[k, 0] + t * (poses[k + 1, 0] - poses[k, 0]),
        poses[k, 1] + t * (poses[k + 1, 1] - poses[k, 1]),
    )
    return x, y, poses[k, 2] + t * (poses[k + 1, 2] - poses[k, 2])


@kernel
def along_path(
    poses: Table, stations: int, row: int, s: float, x: float, y: float, step: float
) -> NewTable:  # fmt: skip
    """(INSTANTS, 3) x m, y m and heading rad of who is at (x, y) m now, 0, 1, 2, ... steps of `step` m on.

    Along its row from s m on, as far beside it as now (`safety.prediction` says why it has one of its own).

    Somebody that passes an obstacle on a lane without a way to its destination drives beside its row.
    """
    track = np.empty((INSTANTS, 3))
    beside = 0.0
    for t in range(INSTANTS):
        path_x, path_y, psi = on_row(poses, row * stations, stations, s + t * step)
        if t == 0:
            beside = (y - path_y) * math.cos(psi) - (x - path_x) * math.sin(psi)
        track[t, 0], track[t, 1] = path_x - beside * math.sin(psi), path_y + beside * math.cos(psi)
        track[t, 2] = psi
    return track


@kernel
def straight_on(x: float, y: float, psi: float, velocity_x: float, velocity_y: float) -> NewTable:
    """(INSTANTS, 3) x m, y m and heading rad of a body with a velocity (m/s, m/s)."""
    track = np.empty((INSTANTS, 3))
    for t in range(INSTANTS):
        track[t] = x + velocity_x * (t * STEP_S), y + velocity_y * (t * STEP_S), psi
    return track


@kernel
def along_line(poses: Table, s: float, v: float) -> NewTable:
    """(INSTANTS, 3) x m, y m and heading rad at v m/s along a line (M, 3) from s m on; beyond an end its
    heading."""
    track, last = np.empty((INSTANTS, 3)), len(poses) - 1
    for t in range(INSTANTS):
        x, y, psi = on_row(poses, 0, len(poses), s + v * (t * STEP_S))
        ahead = s + v * (t * STEP_S)
        if ahead < 0.0 or ahead > last * SPACING:
            psi = poses[0 if ahead < 0.0 else last, 2]
        track[t] = x, y, psi
    return track


@kernel
def near_ego(
    position: Table, heading: Vector, velocity: Table, size: Table, path: Rows, x: float, y: float, v: float
) -> NewFlags:
    """(N,) who is on a path, has an ego at (x, y) m ahead and may meet it, wherever that goes."""
    found = np.zeros(len(path), np.bool_)
    for i in range(len(path)):
        away_x, away_y = x - position[i, 0], y - position[i, 1]
        ahead = math.cos(heading[i]) * away_x + math.sin(heading[i]) * away_y
        speed = math.hypot(velocity[i, 0], velocity[i, 1])
        near = math.hypot(away_x, away_y) < HORIZON_S * (speed + v) + NEAR_M
        found[i] = path[i] >= 0 and near and ahead > -0.5 * size[i, 0] - 3.0
    return found


@kernel
def meets_ego(
    velocity: Table, size: Table, path: Rows, path_s: Vector, meets: Table, heeds: Marks, s: float,
    length: float, v: float,
) -> NewFlags:  # fmt: skip
    """(N,) whose path heeds the ego (`heeds` (P,)) and meets the ego's where both can be within the horizon.

    meets (P, 4) m: where, as `Network.conflict` says; the ego, `length` m long, is at s m.
    """
    found = np.zeros(len(path), np.bool_)
    rear, front = s - 0.5 * length - SPARE_M, s + 0.5 * length + SPARE_M
    way = HORIZON_S * v if v >= LINGERS else 0.0
    for i in range(len(path)):
        if path[i] < 0 or not heeds[path[i]]:
            continue
        ours_in, ours_out, theirs_in, theirs_out = meets[path[i]]
        half = 0.5 * size[i, 0] + SPARE_M
        reach = path_s[i] + half + HORIZON_S * max(math.hypot(velocity[i, 0], velocity[i, 1]), CREEP)
        ours = ours_in < front + way and ours_out > rear
        found[i] = ours and theirs_in < reach and theirs_out > path_s[i] - half
    return found


@kernel
def mark_overlaps(
    hits: NewFlags, own: NewTable, length: float, width: float, other: NewTable, its_length: float,
    its_width: float,
) -> int:  # fmt: skip
    """Set hits (INSTANTS,) where two rectangles overlap that drive along tracks (INSTANTS, 3); half sizes, m.

    Answers 0.
    """
    reach = length + width + its_length + its_width
    for t in range(INSTANTS):
        r = complex(other[t, 0] - own[t, 0], other[t, 1] - own[t, 1])
        if hits[t] or abs(r.real) > reach or abs(r.imag) > reach:
            continue
        facing, its_facing = cmath.exp(1j * own[t, 2]), cmath.exp(1j * other[t, 2])
        hits[t] = separation(r, facing, its_facing, length, width, its_length, its_width) <= 0.0
    return 0


@kernel
def braking(hits: NewFlags, speed: float, passed: bool, most: float) -> float:
    """m/s2, how hard somebody brakes at `speed` m/s that overlaps at `hits` (INSTANTS,).

    0 for not going faster, negative for nothing at all. `passed`: it stands while the ego passes it.
    """
    first, always = 0, hits[0]
    for t in range(INSTANTS - 1, 0, -1):
        always = always and hits[t]
        if hits[t]:
            first = t
    # An overlap that is there already cannot be braked away, and the SV may be driving out of it.
    if first == 0 or (hits[0] and not always and not passed):
        return -1.0
    free = max(speed * (STEP_S * (first - 1)) - 0.3, 0.05)
    need = speed**2 / (2.0 * free)
    if need > BRAKE_FROM or first <= 2:
        return min(need, most)
    return 0.0 if speed > CREEP else -1.0


@kernel
def in_junction(size: Table, path: Rows, path_s: Vector, stop_s: Vector, exit_s: Vector) -> NewFlags:
    """(N,) who is on a path and in the junction, from stop_s to exit_s (P,) m."""
    found = np.zeros(len(path), np.bool_)
    for i in range(len(path)):
        half, row = 0.5 * size[i, 0], path[i]
        found[i] = row >= 0 and path_s[i] + half > stop_s[row] and path_s[i] - half < exit_s[row]
    return found


@kernel
def mark_others(
    hits: NewFlags, own: NewTable, length: float, width: float, i: int, speed: Vector, inside: NewFlags,
    position: Table, heading: Vector, velocity: Table, size: Table, path: Rows, path_s: Vector,
    poses: Table, stations: int, origin: Rows,
) -> int:  # fmt: skip
    """Set hits (INSTANTS,) where an SV i on its track `own` overlaps an obstacle, or, if it creeps in the
    junction, what faster ones from other arms will sweep over. Answers 0.
    """
    for j in range(len(path)):
        half = 0.5 * size[j, 0], 0.5 * size[j, 1]
        away = math.hypot(position[i, 0] - position[j, 0], position[i, 1] - position[j, 1])
        if path[j] < 0:
            if away < HORIZON_S * (speed[i] + speed[j]) + NEAR_M + size[j, 0]:
                there = straight_on(
                    position[j, 0], position[j, 1], heading[j], velocity[j, 0], velocity[j, 1]
                )
                mark_overlaps(hits, own, length, width, there, half[0], half[1])
            continue
        passes = inside[i] and inside[j] and speed[i] <= CREEPS < speed[j]
        if not passes or origin[path[i]] == origin[path[j]]:
            continue
        x, y = position[j, 0], position[j, 1]
        swept = along_path(poses, stations, path[j], path_s[j], x, y, SWEPT_M)
        for k in range(INSTANTS):
            there = straight_on(swept[k, 0], swept[k, 1], swept[k, 2], 0.0, 0.0)
            mark_overlaps(hits, own, length, width, there, half[0], half[1])
    return 0


@kernel
def yielding(
    position: Table, heading: Vector, velocity: Table, size: Table, path: Rows, path_s: Vector,
    poses: Table, stations: int, stop_s: Vector, exit_s: Vector, origin: Rows,
    heeding: NewFlags, ego: NewTable, length: float, width: float, moves: bool, most: float,
) -> tuple[NewRows, NewVector]:  # fmt: skip
    """(m,) rows of the SVs that must brake or go no faster, and how hard (m,) m/s2.

    Who looks out for the ego (`heeding` (N,)), where that will be (INSTANTS, 3), its length and width, m, and
    whether it `moves`.
    """
    n, count, obstacles = len(path), 0, False
    rows, needs, speed = np.empty(n, np.int64), np.empty(n), np.empty(n)
    inside = in_junction(size, path, path_s, stop_s, exit_s)
    for i in range(n):
        speed[i] = math.hypot(velocity[i, 0], velocity[i, 1])
        obstacles = obstacles or path[i] < 0
    for i in range(n):
        if path[i] < 0 or not (heeding[i] or obstacles or (inside[i] and speed[i] <= CREEPS)):
            continue
        hits, sets_off = np.zeros(INSTANTS, np.bool_), max(speed[i], CREEP)
        half = 0.5 * (size[i, 0] + GROW_LENGTH), 0.5 * (size[i, 1] + GROW_WIDTH)
        x, y = position[i, 0], position[i, 1]
        own = along_path(poses, stations, path[i], path_s[i], x, y, sets_off * STEP_S)
        if heeding[i]:
            mark_overlaps(hits, own, half[0], half[1], ego, 0.5 * length, 0.5 * width)
        passed = hits[0] and moves and speed[i] < STANDING
        mark_others(
            hits, own, half[0], half[1], i, speed, inside,
            position, heading, velocity, size, path, path_s, poses, stations, origin,
        )  # fmt: skip
        need = braking(hits, sets_off, passed, most)
        if need >= 0.0:
            rows[count], needs[count] = i, need
            count += 1
    return rows[:count].copy(), needs[:count].copy()
