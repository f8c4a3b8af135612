"""A predictive yielding layer: surrounding vehicles (SVs) look 2 s ahead for what SUMO does not see.

Paper, Sec. "Simulation Environment": each SV predicts heading and position for the next 2 s and yields to
potential collisions according to road priority. Among SVs, SUMO's right of way already does this, so the
layer looks only at pairs of an SV and

    an obstacle (accident, pedestrian, wrong-way driver): the SV always yields to it;
    the ego where it stands in the SV's way now, whoever has priority;
    the ego's predicted path, if the SV has the lower priority, or if the ego has left its lane or heading, or
        if it is committed: its front is past the point where it could still wait;
    an ego that comes towards the SV in the SV's own lane, since it goes round something: the SV stops FACED_M
        before it, so that the ego can return to its lane;
    an SV from another arm that drives through the junction, if the first SV creeps inside it: SUMO lets
        vehicles wait in places that others, above all long ones, sweep over.

An ego that waits where it should (before its stop line, or at its waiting point inside the junction) is in
nobody's way, unless it stands beside its path there. SVs behind it before the stop line or beyond the
junction are left to SUMO, unless its front reaches out of its lane: SUMO takes a vehicle to be on the
lane of its front bumper alone. Inside the junction they are not left to SUMO either, since there SUMO does
not see the rear of a vehicle that drives another way.

SVs are predicted along their own lanes at constant speed, the ego along its reference path, or as far beside
it as it is (straight ahead when it is off this path), each in steps of 0.25 s. The SVs' rectangles are
slightly enlarged. An SV that must yield needs the deceleration b = v^2 / (2 d), where d is the way that it
can go before the first overlap. It brakes with b once b exceeds BRAKE_FROM, or half of what a slippery road
lets it brake, or the overlap is at most 0.5 s away. Until then it goes no faster, if it drives faster than
CREEP, or, on a slippery road, could not stop after picking up speed until the next pass. It is released as
soon as no overlap is predicted. One that creeps or stands is also predicted as if it drove on with PICKS_UP:
where that meets an ego that drives past, it goes no faster.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Collection
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from rudc.arrays import Array, Complex, Flags
from rudc.network.line_kernels import along_line
from rudc.network.paths import SPACING
from rudc.world.scene import Scene
from rudc.world.yielding_kernels import (
    INSTANTS,
    LAYER_S,
    LINGERS,
    STEP_S,
    near_ego,
    straight_on,
    yielding,
)

BRAKE_MOST = 9.0
"""m/s2, on a dry road"""
PAST_M = 3.0
"""m beyond the junction from which on the ego's rear counts as that of any other vehicle in its lane, unless
its front is beside its path"""
BESIDE_M = 0.3, 1.0
"""m beside its path, less than which the front never counts as out of its lane, and more than which it always
does"""

LAYER_MOVING_S = 0.2
"""s, LAYER_S while pedestrians or wrong-way drivers move about"""
TIGHT_M = 0.5
"""m between the ego and the body nearest to it, below which SVs look ahead at every decision: within LAYER_S,
one that sets off beside the ego would drive into an ego that stops again
"""

TIMES: Array = STEP_S * np.arange(INSTANTS, dtype=np.float64)
"""(INSTANTS,) s, the instants that are predicted"""

_COS_OFF = math.cos(math.pi / 6)
_COS_BEHIND = math.cos(math.pi / 4)


class Yielding(NamedTuple):
    """What m of the scene's SVs must do."""

    rows: list[int]
    """(m,) rows of the scene"""
    deceleration: list[float]
    """(m,) m/s2; 0 for those that must not go faster"""
    for_ego: list[int]
    """rows of those who would have to for the ego alone"""


def next_look(gap: float, moving: bool, decision_s: float) -> int:
    """Decisions of `decision_s` s until SVs look ahead again. `gap`: m from the ego to the nearest body;
    `moving`: whether pedestrians or wrong-way drivers move about.
    """
    if gap < TIGHT_M:
        return 1
    return max(1, round((LAYER_MOVING_S if moving else LAYER_S) / decision_s))


def must_yield(
    scene: Scene,
    *,
    ego_present: bool = True,
    brake_most: float = BRAKE_MOST,
    heedless: Collection[str] = (),
) -> Yielding:
    """Which SVs must brake or must not go faster, and how hard they brake, at most brake_most m/s2.

    `ego_present`: False while the ego is not on the road; SVs then do not yield to it. `heedless`: names of
    those who yield to obstacles only, and to an ego that they drive behind.
    """
    ego, body, paths, stray = scene.ego, scene.vehicle, scene.network.paths, off_path(scene)
    heeding = _heeding(scene, stray) if ego_present else None
    if heeding is None:
        heeding = np.zeros(scene.count, dtype=np.bool_)
    obstacles_only = np.zeros(scene.count, dtype=np.bool_)
    for i, name in enumerate(scene.ids if heedless else ()):
        obstacles_only[i] = name in heedless and not (ego_present and _drives_behind(scene, i))
    heeding &= ~obstacles_only
    rows, deceleration, for_ego = yielding(
        scene.position, scene.heading, scene.velocity, scene.size, scene.path, scene.path_s,
        paths.poses, paths.stations, paths.origin, scene.inside,
        heeding, obstacles_only, *_predicted(scene, stray), body.length, body.width, ego.v >= LINGERS,
        stray and ego_present, brake_most,
    )  # fmt: skip
    return Yielding(rows.tolist(), deceleration.tolist(), rows[for_ego].tolist())


def ego_must_yield(scene: Scene, path: int, path_s: float) -> float:
    """m/s2, how hard a SUMO-driven ego on row `path` at path_s m must brake for obstacles, as an SV would; 0
    if it need not."""
    obstacles = (scene.path < 0).nonzero()[0]
    ego, body = scene.ego, scene.vehicle
    course = np.array([math.cos(ego.psi), math.sin(ego.psi)])
    alone = replace(
        scene,
        ids=("", *(scene.ids[i] for i in obstacles)),
        position=np.vstack([(ego.x, ego.y), scene.position[obstacles]]),
        heading=np.append(ego.psi, scene.heading[obstacles]),
        velocity=np.vstack([ego.v * course, scene.velocity[obstacles]]),
        size=np.vstack([(body.length, body.width), scene.size[obstacles]]),
        path=np.append(path, scene.path[obstacles]),
        path_s=np.append(path_s, scene.path_s[obstacles]),
    )
    return sum(must_yield(alone, ego_present=False).deceleration)


def _drives_behind(scene: Scene, row: int) -> bool:
    """Whether the SV of a row has the ego ahead of it and heads as the ego does, within 45 degrees."""
    ego, heading = scene.ego, float(scene.heading[row])
    dx, dy = (ego.x, ego.y) - scene.position[row]
    ahead = dx * math.cos(heading) + dy * math.sin(heading)
    return bool(ahead > 0.0 and math.cos(heading - ego.psi) > _COS_BEHIND)


def _heeding(scene: Scene, stray: bool) -> Flags | None:
    """(N,) whether each is an SV that has the ego ahead and near and must yield to it; None if none must."""
    ego, half, route, paths = scene.ego, 0.5 * scene.vehicle.length, scene.route, scene.network.paths
    heeds = np.ones(paths.count, dtype=np.bool_)
    if not stray:
        front, stands, beside = scene.front_s, ego.v < LINGERS, _front_offset(scene) > _room_beside(scene)
        if scene.ego_s - half > route.exit_s + PAST_M and not beside:
            return None
        if front <= route.waiting_s + 1.0:  # it waits: only SVs that it blocks or that owe it the way heed it
            behind = paths.origin == paths.origin[route.row]
            owe = paths.yields[:, route.row] & ~scene.network.yields_on_entering(route.row)
            heeds = ~behind if stands else owe
            if front > route.stop_line_s or beside:
                heeds = heeds | behind
            if not heeds.any():
                return None
    return near_ego(
        scene.position, scene.heading, scene.velocity, scene.size, scene.path, heeds, ego.x, ego.y, ego.v
    )


def _predicted(scene: Scene, stray: bool) -> tuple[Complex, Complex]:
    """Place (INSTANTS,) m and direction (INSTANTS,) of the ego at each instant, as complex numbers: it
    stands, or follows its path, or goes straight on. Beside its path it stays as far beside it.
    """
    ego = scene.ego
    if ego.v >= LINGERS and not stray:
        line, beside = scene.route.path.poses, scene.ego_offset
        offset = 1j * beside if abs(beside) > BESIDE_M[0] else 0j
        return along_line(line, len(line), 0, scene.ego_s, offset, 1 + 0j, ego.v * TIMES)
    course, v = ego.psi + ego.slip, ego.v if ego.v >= LINGERS else 0.0
    return straight_on(ego.x, ego.y, ego.psi, cmath.rect(v, course))


def off_path(scene: Scene) -> bool:
    """Whether the ego is more than 1 m or 30 degrees off its reference path, so that its route says little
    about its future."""
    return abs(scene.ego_offset) > 1.0 or math.cos(_turned(scene)) < _COS_OFF


def _front_offset(scene: Scene) -> float:
    """m, distance of the middle of the ego's front bumper from the line of its path's direction."""
    return abs(scene.ego_offset + 0.5 * scene.vehicle.length * math.sin(_turned(scene)))


def _room_beside(scene: Scene) -> float:
    """m that the ego's front may be beside its path before it reaches out of its lane: that before its stop
    line, or that by which it leaves."""
    network, row, (least, most) = scene.network, scene.route.row, BESIDE_M
    before = scene.front_s <= scene.route.stop_line_s
    lane = network.inbound_lane(row) if before else network.outbound_lane(row)
    return min(max(0.5 * (lane.width - scene.vehicle.width), least), most)


def _turned(scene: Scene) -> float:
    """rad, angle from the path at the ego to the ego's heading, not brought into one turn."""
    heading = scene.route.path.heading
    return scene.ego.psi - heading.item(min(max(int(scene.ego_s / SPACING), 0), len(heading) - 1))
