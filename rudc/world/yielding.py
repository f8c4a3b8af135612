"""A predictive yielding layer: surrounding vehicles (SVs) look 2 s ahead for what SUMO does not see.

Paper, Sec. "Simulation Environment": each SV predicts heading and position for the next 2 s and yields to
potential collisions according to road priority. Among SVs, SUMO's right of way already does this, so the
layer looks only at pairs of an SV and

    an obstacle (accident, pedestrian, wrong-way driver): always yielded to;
    the ego where it stands in the SV's way now, whoever has priority;
    the ego's predicted path, if the SV has the lower priority, or if the ego has left its lane or heading, or
        if it is committed: its front is past the point where it could still wait;
    an SV that drives through the junction, by one from another arm that creeps in it: SUMO lets vehicles
        wait in places that others, long ones above all, sweep over.

An ego that waits where it should (before its stop line, or at its waiting point inside the junction) is in
nobody's way, unless it stands beside its path there; who queues behind it is SUMO's business.

SVs are predicted along their own lanes at constant speed, the ego along its reference path (straight ahead
when off it), each at 0.25 s steps, as slightly enlarged rectangles. An SV that must yield brakes with b = v^2
/ (2 d), d the way it can go before the first overlap, once b exceeds a threshold, and goes no faster until
then; it is released as soon as no overlap is predicted.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from rudc.arrays import Array
from rudc.geometry import separation
from rudc.network.paths import SPACING
from rudc.world.scene import STANDING, Scene

HORIZON_S = 0.25 * np.arange(9.0)
"""(9,) s, the instants looked at; the first is now"""
GROW = np.array([1.0, 0.4])
"""(2,) m, added to an SV's length and width"""
BRAKE_FROM = 1.5
"""m/s2, needed deceleration at which an SV begins to brake"""
BRAKE_MOST = 9.0
"""m/s2, on a dry road"""
CREEP = 1.0
"""m/s, speed at which a standing SV is taken to set off"""
LINGERS = 1.0
"""m/s, below which the ego is taken to stay where it is: twice STANDING, since one that creeps is in the way
for the next 2 s all the same"""
CREEPS = 3.0
"""m/s, up to which an SV in the junction looks out for faster ones"""
SWEPT_M = 2.5 * np.arange(9.0)
"""(9,) m ahead of those, places that they will sweep over"""
PAST_M = 3.0
"""m of the ego's rear beyond the junction, from where it is one vehicle in a lane like any other"""
SLACK_M = 2.0
"""m along either path beyond bumpers within which paths are taken to meet; covers wide vehicles"""
NEAR_M = 10.0
"""m between centres beyond what both cover in the horizon, within which bodies may come to overlap"""


_COS_OFF = math.cos(math.pi / 6)


class Yielding(NamedTuple):
    """What m of the scene's vehicles must do."""

    rows: list[int]
    """(m,) rows of the scene"""
    deceleration: list[float]
    """(m,) m/s2; 0 for those that must not go faster"""


NOBODY = Yielding([], [])


class _Threats(NamedTuple):
    """What SVs look out for: t things, each over the horizon, and which of all N heeds which."""

    x: Array
    """(t, 9) m"""
    y: Array
    """(t, 9) m"""
    psi: Array
    """(t, 9) rad"""
    half: Array
    """(t, 2) m, half sizes"""
    heeded: np.ndarray
    """(N, t)"""


def must_yield(scene: Scene, *, ego_present: bool = True, brake_most: float = BRAKE_MOST) -> Yielding:
    """Which SVs must brake or hold back, and how hard, at most brake_most m/s2. Without the ego on the road,
    it does not count."""
    speed = np.hypot(scene.velocity[:, 0], scene.velocity[:, 1])
    driven = scene.path >= 0
    found = [
        _ego(scene, speed, driven) if ego_present else None,
        None if driven.all() else _obstacles(scene, speed, driven),
        _passing(scene, speed, driven),
    ]
    threats = _joined([kind for kind in found if kind is not None])
    if threats is None:
        return NOBODY
    rows = np.flatnonzero(threats.heeded.any(axis=1))
    passed = (speed[rows] < STANDING) & (found[0] is not None and scene.ego.v >= LINGERS)
    speed = np.maximum(speed[rows], CREEP)
    x, y, psi = _ahead(scene, rows, speed[:, None] * HORIZON_S)
    apart = separation(
        (threats.x + 1j * threats.y) - (x + 1j * y)[:, None],
        np.exp(1j * psi)[:, None],
        np.exp(1j * threats.psi),
        0.5 * (scene.size[rows] + GROW)[:, None, None],
        threats.half[:, None],
    )
    overlaps = (apart <= 0.0) & threats.heeded[rows, :, None]
    hit = np.any(overlaps, axis=1)
    if not hit.any():
        return NOBODY
    return _braking(rows, speed, hit, passed & overlaps[:, 0, 0], brake_most)


def ego_must_yield(scene: Scene, path: int, path_s: float) -> float:
    """How hard, in m/s2, a SUMO-driven ego on row `path` at path_s m must brake for obstacles, as an SV
    would; 0 for not."""
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


def _ahead(scene: Scene, rows: np.ndarray, way: Array) -> tuple[Array, Array, Array]:
    """Poses (k, n) of SVs `way` (k, n) or (n,) m on: along their paths, as far beside them as they are now
    (`safety.prediction` says why it has one of its own).

    A vehicle that passes an obstacle on a lane without a way to its destination is such a one.
    """
    s = scene.path_s[rows, None] + way
    x, y, psi = scene.network.paths.pose(scene.path[rows, None], s)
    sin, cos = np.sin(psi), np.cos(psi)
    away_x, away_y = scene.position[rows, 0] - x[:, 0], scene.position[rows, 1] - y[:, 0]
    beside = (away_y * cos[:, 0] - away_x * sin[:, 0])[:, None]
    return x - beside * sin, y + beside * cos, psi


def _braking(
    rows: np.ndarray, speed: Array, hit: np.ndarray, passed: np.ndarray, brake_most: float
) -> Yielding:
    """From who overlaps what when, hit (k, 9), to who brakes how hard; passed (k,): who stands while the ego
    passes it."""
    later = hit[:, 1:]
    first = np.argmax(later, axis=1) + 1
    # An overlap that is there already cannot be braked away, and the SV may be driving out of it.
    yields = later.any(axis=1) & ~(hit[:, 0] & ~hit.all(axis=1) & ~passed)
    free = np.maximum(speed * HORIZON_S[first - 1] - 0.3, 0.05)
    need = speed**2 / (2 * free)
    brakes = yields & ((need > BRAKE_FROM) | (first <= 2))
    chosen = brakes | (yields & (speed > CREEP))
    return Yielding(rows[chosen].tolist(), np.minimum(need * brakes, brake_most)[chosen].tolist())


def _joined(kinds: list[_Threats]) -> _Threats | None:
    if len(kinds) < 2:
        return kinds[0] if kinds else None
    x, y, psi, half = (np.vstack([kind[field] for kind in kinds]) for field in range(4))
    return _Threats(x, y, psi, half, np.hstack([kind.heeded for kind in kinds]))


def _ego(scene: Scene, speed: Array, driven: np.ndarray) -> _Threats | None:
    """The ego, for SVs that have it ahead, within reach, and to yield to; None when there are none."""
    ego, body, route = scene.ego, scene.vehicle, scene.route
    stray, half = off_path(scene), 0.5 * body.length
    waits, past = scene.ego_s + half <= route.waiting_s + 1.0, scene.ego_s - half > route.exit_s + PAST_M
    owe = scene.network.paths.yields[:, route.row]
    stands = waits and ego.v < LINGERS
    if not stray and (past or (waits and not stands and not owe.any())):
        return None
    concerned = driven & (_near_ego(scene, speed) if stray else _meets_ego(scene, speed))
    if stands and not stray:
        concerned &= scene.network.paths.origin[scene.path] != scene.network.paths.origin[route.row]
    elif waits and not stray:
        concerned &= owe[scene.path]
    if not concerned.any():
        return None
    track, sides = _predicted(scene, stray), np.array([[half, 0.5 * body.width]])
    return _Threats(track[:1], track[1:2], track[2:], sides, concerned[:, None])


def _near_ego(scene: Scene, speed: Array) -> np.ndarray:
    """(N,) whose way over the horizon may meet the ego, wherever that goes."""
    ego = scene.ego
    away_x, away_y = ego.x - scene.position[:, 0], ego.y - scene.position[:, 1]
    ahead = np.cos(scene.heading) * away_x + np.sin(scene.heading) * away_y
    near = np.hypot(away_x, away_y) < HORIZON_S[-1] * (speed + ego.v) + NEAR_M
    return near & (ahead > -0.5 * scene.size[:, 0] - 3.0)


def _meets_ego(scene: Scene, speed: Array) -> np.ndarray:
    """(N,) whose path meets the ego's where both can be within the horizon; the ego is on its path."""
    ego, body = scene.ego, scene.vehicle
    meets = scene.network.conflict(scene.route)[scene.path]
    half = 0.5 * scene.size[:, 0] + SLACK_M
    rear, front = scene.ego_s - 0.5 * body.length - SLACK_M, scene.ego_s + 0.5 * body.length + SLACK_M
    way = HORIZON_S[-1] * ego.v if ego.v >= LINGERS else 0.0
    ours = (meets[:, 0] < front + way) & (meets[:, 1] > rear)
    reach = scene.path_s + half + HORIZON_S[-1] * np.maximum(speed, CREEP)
    return ours & (meets[:, 2] < reach) & (meets[:, 3] > scene.path_s - half)


def _obstacles(scene: Scene, speed: Array, driven: np.ndarray) -> _Threats:
    """The m obstacles, for SVs within reach."""
    rows = (~driven).nonzero()[0]
    gap = scene.position[:, None] - scene.position[rows]
    reach = HORIZON_S[-1] * (speed[:, None] + speed[rows]) + NEAR_M + scene.size[rows, 0]
    position, velocity = scene.position[rows], scene.velocity[rows]
    return _Threats(
        position[:, :1] + velocity[:, :1] * HORIZON_S,
        position[:, 1:] + velocity[:, 1:] * HORIZON_S,
        np.repeat(scene.heading[rows, None], len(HORIZON_S), axis=1),
        0.5 * scene.size[rows],
        driven[:, None] & (np.hypot(gap[..., 0], gap[..., 1]) < reach),
    )


def _passing(scene: Scene, speed: Array, driven: np.ndarray) -> _Threats | None:
    """What SVs driving through the junction will sweep over, for those from other arms that creep in it."""
    paths, path, half = scene.network.paths, scene.path, 0.5 * scene.size[:, 0]
    past, before = scene.path_s + half > paths.stop_s[path], scene.path_s - half < paths.exit_s[path]
    inside = np.logical_and.reduce([driven, past, before])
    rows = (inside & (speed > CREEPS)).nonzero()[0]
    creeping = inside & (speed <= CREEPS)
    if not len(rows) or not creeping.any():
        return None
    # Stations on their ways, each a thing that is there over the whole horizon.
    x, y, psi = (at.ravel() for at in _ahead(scene, rows, SWEPT_M))
    count = len(SWEPT_M)
    other_arm = paths.origin[path][:, None] != np.repeat(paths.origin[path[rows]], count)
    still = np.ones((1, len(HORIZON_S)))
    return _Threats(
        x[:, None] * still,
        y[:, None] * still,
        psi[:, None] * still,
        0.5 * np.repeat(scene.size[rows], count, axis=0),
        creeping[:, None] & other_arm,
    )


def _predicted(scene: Scene, stray: bool) -> Array:
    """(3, 9) x m, y m, heading rad of the ego over the horizon: standing, along its path, or straight on."""
    ego = scene.ego
    if ego.v >= LINGERS and not stray:
        return np.array(scene.route.path.pose(scene.ego_s + ego.v * HORIZON_S))
    course = ego.psi + ego.slip
    way = HORIZON_S * (ego.v if ego.v >= LINGERS else 0.0)
    return np.array(
        [ego.x + way * math.cos(course), ego.y + way * math.sin(course), np.full(len(way), ego.psi)]
    )


def off_path(scene: Scene) -> bool:
    """Whether the ego is more than 1 m or 30 degrees off its reference path, so that its route says little of
    its future."""
    heading = scene.route.path.heading
    along = heading.item(min(max(int(scene.ego_s / SPACING), 0), len(heading) - 1))
    return abs(scene.ego_offset) > 1.0 or math.cos(scene.ego.psi - along) < _COS_OFF
