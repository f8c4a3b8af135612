"""What is about to happen: 41 features that predict conflicts between the ego and the others over 5 s.

Ego. On its reference path, once for each acceleration a in {2.5, 1, 0, -1.5, -4} m/s2, its speed kept between
0 and the limit (or its present speed, if that is higher).

Others. Along their own paths, under two hypotheses each:
    free     IDM on a free road, v' = a (1 - (v / v0)^4): it drives on, whoever has priority
    braking  it keeps its present deceleration until it stands (constant speed if it has none)
In units v0 and v0 / a the free road has one solution for all, u' = 1 - u^4 and y' = u, tabulated once:
    s(t) = v0^2 / a (y(tau + a t / v0) - y(tau)),     u(tau) = v / v0.
Whoever has no path (obstacles, pedestrians, wrong-way drivers) goes straight ahead, braking as it does now.

Left out are those that cannot matter: on paths that come nowhere within 2.2 m of the ego's, past the place
where they do, or following the ego (keeping clear is theirs).

The features, each about within [-1, 1]:
    gap_H_A         least gap between the rectangles over 5 s / 10 m, for each hypothesis H and acceleration A
    time_H_A        first time of a gap below 0.3 m / 5 s (1: none)
    occupied_K      whether anyone is on the ego's conflict zone in the K-th half second, if free
    first_free, first_occupied      start of the first half second that is so / 5 s (1: none)
    leader_gap      gap to whoever is ahead on the path / 50 m (1: nobody within 50 m)
    leader_speed    its speed along the path less the ego's / 10 m/s
    leader_idm      the ego's acceleration by IDM behind it / 6 m/s2
    to_stop_line, to_waiting_point  way of the front bumper to them / 50 m
    to_zone_end     way of the ego's tail to the end of the conflict zone / 50 m
    waited          s standing / 10 s
    priority        whether the ego's arm has it
    elapsed         share of the time limit gone
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rudc.arrays import Array, Index
from rudc.env.remembered import Remembered
from rudc.env.route_tables import FARTHEST, UNIT, RouteTables
from rudc.geometry import gaps_between
from rudc.world.scene import Scene

ACCELERATIONS = (2.5, 1.0, 0.0, -1.5, -4.0)
"""m/s2, what the ego might do"""
HYPOTHESES = ("free", "braking")
STEP, HORIZON = 0.25, 5.0
"""s"""
BINS, BIN_STEPS = 10, 2
"""half seconds, and steps in each"""
TOUCH = 0.3
"""m, gap below which there is a conflict"""
IDM_ACCEL, IDM_DECEL, IDM_HEADWAY, IDM_GAP = 2.0, 3.0, 1.2, 2.0
"""m/s2, m/s2, s, m: the driver assumed of all"""
REACH = 50.0
"""m ahead in which a leader is looked for, and unit of distances along the path"""

FEATURES: tuple[str, ...] = (
    *(f"{what}_{h}_{a:g}" for what in ("gap", "time") for h in HYPOTHESES for a in ACCELERATIONS),
    *(f"occupied_{k}" for k in range(BINS)),
    *("first_free", "first_occupied"),
    *("leader_gap", "leader_speed", "leader_idm"),
    *("to_stop_line", "to_waiting_point", "to_zone_end"),
    *("waited", "priority", "elapsed"),
)
"""names of the features, in order"""

_TIMES = STEP * np.arange(1, round(HORIZON / STEP) + 1)
_HALF_A = 0.5 * np.array(ACCELERATIONS)[:, None]
_SPEEDS_UP = _HALF_A > 0
_NO_GAP = np.full((len(ACCELERATIONS), len(HYPOTHESES), len(_TIMES)), FARTHEST / UNIT)

_tables: Remembered[object, RouteTables] = Remembered(32)
"""2 MB a route; those of two networks, so that a worker that sees many does not grow beyond that"""


def conflict_features(scene: Scene) -> Array:
    """(41,) the features of a scene, in the order of `FEATURES`."""
    tables = _tables.get(scene.route, lambda: RouteTables(scene.network, scene.route))
    result = np.ones(len(FEATURES))
    if scene.count:
        view = _view(scene, tables)
        result[0:20] = _gap_features(scene, tables, view)
        result[20:32] = _occupancy_features(view)
        gap, speed = _leader(scene, view)
    else:
        result[20:31] = 0.0
        gap, speed = math.inf, 0.0
    result[32:35] = _leader_features(scene, gap, speed)
    result[35:41] = _progress_features(scene)
    return result


# ---- who matters, and where they will be


class _View(NamedTuple):
    """The N others seen from the ego's path, and where the K relevant ones that follow a path will be."""

    relative: Array
    """(N, 4) see `RouteTables.relative_to`"""
    half: Array
    """(N, 2) m, half sizes"""
    relevant: Index
    """(K,) which have a path and may come into conflict with the ego"""
    stray: Index
    """which have no path"""
    s: Array
    """(K, H, T) m, arc lengths on their paths at the steps to come, for each hypothesis"""
    zone: Array
    """(2, K) m, where each centre is when its front enters and its tail leaves the ego's conflict zone"""


def _view(scene: Scene, tables: RouteTables) -> _View:
    rows, s, half = scene.path, scene.path_s, 0.5 * scene.size
    relative = tables.relative(rows, s)
    stray = np.flatnonzero(rows < 0)
    if len(stray):
        relative[stray] = tables.relative_to(scene.position[stray], scene.heading[stray])
    ours_out, theirs_out, zone_in, zone_out, limit = tables.rows.take(rows, axis=0, mode="wrap").T
    along, across, cos, _ = relative.T
    touching = half[:, 0] + 0.5 * scene.vehicle.length
    meets = (s < theirs_out + touching) & (scene.ego_s < ours_out + touching) & (rows >= 0)
    follows = (along < scene.ego_s) & (np.abs(across) < 2.0) & (cos > 0.7)
    relevant = np.flatnonzero(meets & ~follows)
    ahead = _ahead(scene, relevant, limit[relevant])
    zone = np.array([zone_in - half[:, 0], zone_out + half[:, 0]])[:, relevant]
    return _View(relative, half, relevant, stray, s[relevant, None, None] + ahead, zone)


def _ahead(scene: Scene, which: Index, limit: Array) -> Array:
    """(K, H, T) m, ways that others `which` (K,) go; limit (K,) m/s on their paths."""
    velocity = scene.velocity[which]
    v = np.hypot(velocity[:, 0], velocity[:, 1])
    v0 = np.maximum(limit, v)
    rate = IDM_ACCEL / v0
    tau = np.interp(np.minimum(v / v0, _U_MOST), _U, _TAU)
    later = np.interp(tau[:, None] + rate[:, None] * _TIMES, _TAU, _Y)
    ahead = np.empty((len(v), len(HYPOTHESES), len(_TIMES)))
    ahead[:, 0] = (later - np.interp(tau, _TAU, _Y)[:, None]) * (v0 / rate)[:, None]
    ahead[:, 1] = _braking_way(v, scene.acceleration[which])
    return ahead


def _braking_way(v: Array, acceleration: Array) -> Array:
    """(K, T) m, ways of vehicles at speeds v (K,) m/s that keep their decelerations (never speeding up)."""
    braking = np.maximum(-acceleration, 1e-6)[:, None]
    t = np.minimum(_TIMES, v[:, None] / braking)
    return t * (v[:, None] - 0.5 * braking * t)


def _free_road() -> tuple[Array, Array, Array]:
    """tau, u(tau), y(tau) of u' = 1 - u^4, y' = u from rest, by fourth-order Runge-Kutta steps of 0.01.

    To tau = 20, beyond what 5 s can reach from `_U_MOST` at any limit above 0.6 m/s.
    """
    step, count = 0.01, 2000
    tau: Array = step * np.arange(count, dtype=np.float64)
    u, y = np.zeros(count), np.zeros(count)
    for k in range(count - 1):
        k1 = 1 - u[k] ** 4
        k2 = 1 - (u[k] + step / 2 * k1) ** 4
        k3 = 1 - (u[k] + step / 2 * k2) ** 4
        k4 = 1 - (u[k] + step * k3) ** 4
        u[k + 1] = u[k] + step / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    y[1:] = np.cumsum(0.5 * step * (u[1:] + u[:-1]))
    return tau, u, y


def _ego_s(scene: Scene) -> Array:
    """(A, T) m, arc lengths of the ego's centre on its path, for each acceleration."""
    v = scene.ego.v
    top = max(scene.route.speed_limit, v)
    until = np.array([(top - v) / a if a > 0 else -v / a if a < 0 else HORIZON for a in ACCELERATIONS])
    t = np.minimum(_TIMES, until[:, None])
    return scene.ego_s + t * (v + _HALF_A * t) + (top * _SPEEDS_UP) * (_TIMES - t)


# ---- features


def _gap_features(scene: Scene, tables: RouteTables, view: _View) -> Array:
    """(20,) least gaps and first times of conflict."""
    ego_s, which = _ego_s(scene), view.relevant
    gap: Array | NDArray[np.uint8] = _NO_GAP
    if len(which):
        gap = tables.gaps(scene.vehicle, ego_s, scene.path[which], view.s, scene.size[which])
    if len(view.stray):
        gap = np.minimum(gap, _gaps_to_stray(scene, ego_s, view.stray)[:, None] / UNIT)
    hit = gap < TOUCH / UNIT
    hit[..., -1] = True  # its time is the horizon, which also stands for none
    result = np.empty((2, len(HYPOTHESES), len(ACCELERATIONS)))
    result[0] = gap.min(axis=-1).T * (UNIT / FARTHEST)
    result[1] = hit.argmax(axis=-1).T
    result[1] = (result[1] + 1.0) * (STEP / HORIZON)
    return result.ravel()


def _gaps_to_stray(scene: Scene, ego_s: Array, which: Index) -> Array:
    """(A, T) m, least gap to any of those without a path, which (K,), at most `FARTHEST`."""
    position, velocity = scene.position[which], scene.velocity[which]
    speed = np.hypot(velocity[:, 0], velocity[:, 1])
    course = velocity / np.maximum(speed, 1e-6)[:, None]
    way = _braking_way(speed, scene.acceleration[which])
    theirs = position[:, None] + way[..., None] * course[:, None]
    x, y, psi = scene.route.path.pose(ego_s)
    shape = (len(which), *ego_s.shape)
    ours = np.broadcast_to(np.stack([x, y], axis=-1), (*shape, 2)).reshape(-1, 2)
    theirs = np.broadcast_to(theirs[:, None], (*shape, 2)).reshape(-1, 2)
    away = theirs - ours
    near = np.flatnonzero(np.einsum("ij,ij->i", away, away) < (FARTHEST + 12.0) ** 2)
    gaps = np.full(shape, FARTHEST)
    if len(near):
        other = which[near // ego_s.size]
        gaps.ravel()[near] = gaps_between(
            ours[near],
            psi.ravel()[near % ego_s.size],
            np.array([scene.vehicle.length, scene.vehicle.width]),
            theirs[near],
            scene.heading[other],
            scene.size[other],
        )
    return np.minimum(gaps.min(axis=0), FARTHEST)


def _occupancy_features(view: _View) -> list[float]:
    """(12,) occupancy of the ego's conflict zone."""
    s, (entry, leaving) = view.s[:, 0], view.zone[:, :, None]
    on = (s > entry) & (s < leaving)
    occupied: list[bool] = on.any(axis=0).reshape(BINS, BIN_STEPS).any(axis=1).tolist()  # type: ignore[assignment]
    first_free = occupied.index(False) if False in occupied else BINS
    first_occupied = occupied.index(True) if True in occupied else BINS
    return [*occupied, first_free / BINS, first_occupied / BINS]


def _leader(scene: Scene, view: _View) -> tuple[float, float]:
    """Gap (m, bumper to bumper along the path) and speed (m/s along it) of who is ahead; (inf, 0) for nobody.

    Whoever's rectangle lies across the band that the ego will sweep counts, wherever it is heading.
    """
    along, across, cos, sin = view.relative.T
    parallel, crosswise = np.abs(cos), np.abs(sin)
    length, width = view.half.T
    inside = np.abs(across) < 0.5 * scene.vehicle.width + length * crosswise + width * parallel
    gap = np.where(inside & (along > scene.ego_s), along - length * parallel - width * crosswise, math.inf)
    first = int(gap.argmin())
    free = float(gap[first]) - scene.ego_s - 0.5 * scene.vehicle.length
    if free > REACH:
        return math.inf, 0.0
    return max(free, 0.0), math.hypot(*scene.velocity[first]) * float(cos[first])


def _leader_features(scene: Scene, gap: float, speed: float) -> tuple[float, float, float]:
    v, v0 = scene.ego.v, max(scene.route.speed_limit, 1.0)
    acceleration = max(idm(v, v0, gap, v - speed), -6.0) / 6.0
    return (1.0, 0.0, acceleration) if math.isinf(gap) else (gap / REACH, (speed - v) / 10.0, acceleration)


def _progress_features(scene: Scene) -> tuple[float, ...]:
    route, half = scene.route, 0.5 * scene.vehicle.length
    return (
        (route.stop_line_s - scene.ego_s - half) / REACH,
        (route.waiting_s - scene.ego_s - half) / REACH,
        (route.zone_end_s - scene.ego_s + half) / REACH,
        scene.waited_s / 10.0,
        float(route.major),
        scene.time_s / scene.timeout_s,
    )


def idm(v: float, v0: float, gap: float = math.inf, closing: float = 0.0) -> float:
    """m/s2, IDM's acceleration at speed v towards v0 (m/s), `gap` m behind a leader, closing in at m/s."""
    wanted = IDM_GAP + max(v * IDM_HEADWAY + v * closing / (2 * math.sqrt(IDM_ACCEL * IDM_DECEL)), 0.0)
    return IDM_ACCEL * (1.0 - (v / v0) ** 4 - (wanted / max(gap, 0.1)) ** 2)


_TAU, _U, _Y = _free_road()
_U_MOST = 0.9999
"""speed over v0 that counts as having reached it, as u = 1 has no tau"""
