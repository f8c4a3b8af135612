"""41 features that predict conflicts between the ego and the others over the next 5 s (ours).

Ego. It follows its reference path, once with each acceleration a in {2.5, 1, 0, -1.5, -4} m/s2; its speed
stays between 0 and the limit, or what the vehicle can do if that is less (or its present speed, if that is
higher).

Others. They follow their own paths, under two hypotheses each:
    free     IDM on a free road, v' = a (1 - (v / v0)^4): it drives on, whoever has priority
    braking  it keeps its present deceleration until it stands (constant speed if it has none)
In units v0 and v0 / a, the free road has one solution for all, u' = 1 - u^4 and y' = u, tabulated once:
    s(t) = v0^2 / a (y(tau + a t / v0) - y(tau)),     u(tau) = v / v0.
Cars have their centre on their path; vehicles longer than 6 m have both ends on it, as SUMO moves them.
Whoever has no path (obstacles, pedestrians, wrong-way drivers) goes straight ahead, braking as it does now.

Those that cannot matter are left out: on paths that come nowhere within 2.2 m of the ego's, past the place
where they do, or behind the ego on its path (it is their task to keep their distance).

The features, most of them within [-1, 1]:
    gap_H_A         least gap between the rectangles over 5 s / 10 m, for each hypothesis H and acceleration A
    time_H_A        first time of a gap below 0.3 m / 5 s (1: none)
    occupied_K      whether anyone is on the ego's conflict zone in the K-th half second, by hypothesis free
    first_free, first_occupied      start of the first half second that is free, or occupied / 5 s (1: none)
    leader_gap      gap to whoever is ahead on the path / 50 m (1: nobody within 50 m)
    leader_speed    its speed along the path less the ego's / 10 m/s
    leader_idm      the ego's acceleration by IDM behind it / 6 m/s2
    to_stop_line, to_waiting_point  way of the front bumper to them / 50 m
    to_zone_end     way of the ego's tail to the end of the conflict zone / 50 m
    waited          time for which the ego has been standing / 10 s
    priority        1 if the ego's arm has priority, else 0
    elapsed         share of the time limit that has passed
"""

from __future__ import annotations

import math

import numpy as np

from rudc.arrays import Array
from rudc.env import kernels
from rudc.env.remembered import Remembered
from rudc.env.route_tables import RouteTables
from rudc.network.paths import SPACING
from rudc.world.scene import Scene

ACCELERATIONS = (2.5, 1.0, 0.0, -1.5, -4.0)
"""m/s2, accelerations with which the ego is predicted"""
HYPOTHESES = ("free", "braking")
STEP, HORIZON = 0.25, 5.0
"""s, s: step and length of the prediction"""
BINS = 10
"""number of half seconds in it"""
TOUCH = 0.3
"""m, gap below which there is a conflict"""
IDM_ACCEL, IDM_DECEL, IDM_HEADWAY, IDM_GAP = 2.0, 3.0, 1.2, 2.0
"""m/s2, m/s2, s, m: IDM's parameters, assumed of everybody"""
REACH = 50.0
"""m ahead within which a leader is looked for, and unit of distances along the path"""

FEATURES: tuple[str, ...] = (
    *(f"{what}_{h}_{a:g}" for what in ("gap", "time") for h in HYPOTHESES for a in ACCELERATIONS),
    *(f"occupied_{k}" for k in range(BINS)),
    *("first_free", "first_occupied"),
    *("leader_gap", "leader_speed", "leader_idm"),
    *("to_stop_line", "to_waiting_point", "to_zone_end"),
    *("waited", "priority", "elapsed"),
)
"""names of the features, in order"""

_TIMES: Array = np.linspace(STEP, HORIZON, round(HORIZON / STEP))
_ACCELERATIONS: Array = np.array(ACCELERATIONS)

_tables: Remembered[object, RouteTables] = Remembered(32)
"""tables of the last 32 routes, which are those of two networks: at 2 MB a route, a worker that sees many
networks must not keep all"""


def conflict_features(scene: Scene) -> Array:
    """(41,) the features of a scene, in the order of `FEATURES`."""
    result = np.ones(len(FEATURES))
    if scene.count:
        gap, speed = _meetings(scene, result)
    else:
        result[20:31] = 0.0
        gap, speed = math.inf, 0.0
    result[32:35] = _leader_features(scene, gap, speed)
    result[35:41] = _progress_features(scene)
    return result


def _meetings(scene: Scene, result: Array) -> tuple[float, float]:
    """Write gaps, times and occupancy into `result`. Returns gap (m, bumper to bumper along the path) and
    speed (m/s along it) of whoever is ahead; (inf, 0) for nobody.

    Whoever overlaps the band of road that the ego will drive over is ahead, in whatever direction it heads.
    """
    route, body, v = scene.route, scene.vehicle, scene.ego.v
    tables, line = _tables.get(route, lambda: RouteTables(scene.network, route)), route.path
    others = scene.position, scene.heading, scene.velocity, scene.acceleration, scene.size, scene.path
    which, s, codes, rear, speed = kernels.foreseen(
        tables.lines(scene.path), tables.per_row, SPACING, line.xy, line.heading, tables.rows,
        *others, scene.path_s, scene.ego_s, body.length, body.width,
        IDM_ACCEL, _U_MOST, _TAU, _U, _Y, _TIMES,
    )  # fmt: skip
    result[0:32] = kernels.meetings(
        *tables.find(body, codes), SPACING, s, which, tables.rows,
        scene.ego_s, v, max(min(route.speed_limit, body.v_max), v), _ACCELERATIONS, _TIMES, TOUCH, BINS,
        line.xy, line.heading, body.length, body.width, *others,
    )  # fmt: skip
    gap = rear - scene.ego_s - 0.5 * body.length
    return (math.inf, 0.0) if gap > REACH else (max(gap, 0.0), speed)


def _free_road() -> tuple[Array, Array, Array]:
    """tau, u(tau), y(tau) of u' = 1 - u^4, y' = u from rest, by fourth-order Runge-Kutta steps of 0.01.

    They end at tau = 20, which 5 s cannot reach from `_U_MOST` at any speed limit above 0.6 m/s.
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


def _leader_features(scene: Scene, gap: float, speed: float) -> tuple[float, float, float]:
    limit = min(scene.route.limit_at(scene.ego_s), scene.vehicle.v_max)
    v, v0 = scene.ego.v, max(limit, 1.0)
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
    """m/s2, IDM's acceleration at v m/s, desired speed v0 m/s, `gap` m behind a leader, to which the distance
    falls at `closing` m/s.
    """
    wanted = IDM_GAP + max(v * IDM_HEADWAY + v * closing / (2 * math.sqrt(IDM_ACCEL * IDM_DECEL)), 0.0)
    return IDM_ACCEL * (1.0 - (v / v0) ** 4 - (wanted / max(gap, 0.1)) ** 2)


_TAU, _U, _Y = _free_road()
_U_MOST = 0.9999
"""ratio of speed to v0 that counts as having reached v0, since u = 1 has no tau"""
