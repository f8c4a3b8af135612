"""What the agent observes: the paper's observation, and the same with predicted conflicts added.

Paper, Sec. "Observation and Action Spaces": S = [S_EV, S_SV, S_wp, S_task]. Kind `paper` is exactly that:

    ego        (10,)    validity (1), x, y, v_x, v_y, phi, omega, d_veh, d_road, d_des
    others     (12, 6)  validity, dx, dy, dv_x, dv_y, dphi of the 12 nearest, nearest first, zeros for none
    waypoints  (10, 2)  dx, dy of the reference path's points 3, 6, ... 30 m ahead of the ego
    task       (3,)     one-hot: left, straight, right

105 numbers. Kind `conflict` appends `conflict` (41,), see rudc/env/conflict.py: 146 numbers.

Frames: x, y and phi of the ego are in the frame of its arm, which has its origin at the junction's centre and
is turned so that the ego comes from the south heading north. dx, dy, dv_x, dv_y and the waypoints are in the
ego's body frame (x ahead, y to the left), and so is its own velocity v_x, v_y; dv is the difference of the
velocities over ground. Distances are those of rudc/env/distances.py.

Scales: each number is divided by the unit below and cut to [-3, 3]:

    positions, d_des   50 m         headings    pi rad
    velocities         10 m/s       yaw rate    1 rad/s
    d_veh              20 m         d_road      5 m          waypoints   30 m

Headings jump by 2 pi where few vehicles head: the ego's is in (-0.5, 1.5] pi (it never heads back to where it
came from, and after a left turn its heading is pi), the others' in (-0.75, 1.25] pi (oncoming traffic has
pi).
"""

from __future__ import annotations

import math
from functools import cache
from typing import Literal, get_args

import numpy as np
from gymnasium import spaces

from rudc.arrays import Array, Floats
from rudc.env.conflict import FEATURES as CONFLICT_FEATURES
from rudc.env.conflict import conflict_features
from rudc.env.distances import Distances, measure
from rudc.env.kernels import Ten, observed
from rudc.env.remembered import Remembered
from rudc.errors import InputError
from rudc.hints import there_are
from rudc.network.network import ReferencePath
from rudc.network.paths import SPACING as STATION
from rudc.world.scene import Scene

ObservationKind = Literal["paper", "conflict"]

OTHERS = 12
"""N_SV, surrounding vehicles observed"""
WAYPOINTS = 10
"""N_wp, reference points observed"""
TASKS = 3
"""left, straight, right"""
SPACING = 3.0
"""m between two reference points"""
LIMIT = 3.0
"""largest magnitude of an observed number"""

POSITION, VELOCITY, YAW_RATE, TO_VEHICLE, TO_ROAD, TO_WAYPOINT = 50.0, 10.0, 1.0, 20.0, 5.0, 30.0
"""m, m/s, rad/s, m, m, m: the units in which numbers are observed"""

EGO_CUT, OTHERS_CUT = 1.5, 1.25
"""pi rad, where headings of the ego and of the others jump by 2 pi"""

PARTS: dict[str, tuple[int, ...]] = {
    "ego": (10,),
    "others": (OTHERS, 6),
    "waypoints": (WAYPOINTS, 2),
    "task": (TASKS,),
    "conflict": (len(CONFLICT_FEATURES),),
}
"""shape of each part, in the order of the flat observation"""

_STRIDE = round(SPACING / STATION)
_SPAN = WAYPOINTS * _STRIDE + 1

_NO_CONFLICT: Array = np.zeros(0)
_lines: Remembered[ReferencePath, Array] = Remembered()


def parts(kind: ObservationKind) -> tuple[str, ...]:
    """Names of the parts of a kind of observation, in order. Raises InputError for an unknown kind."""
    if kind not in get_args(ObservationKind):
        raise InputError(f"there is no observation {kind!r}{there_are(kind, get_args(ObservationKind))}")
    return tuple(PARTS) if kind == "conflict" else tuple(name for name in PARTS if name != "conflict")


@cache
def observation_size(kind: ObservationKind) -> int:
    """How many numbers an observation has."""
    return sum(math.prod(PARTS[name]) for name in parts(kind))


def observation_space(kind: ObservationKind, as_dict: bool = False) -> spaces.Box | spaces.Dict:
    """Gymnasium space of the flat observation or, with `as_dict`, of the Dict of its parts."""
    if not as_dict:
        return spaces.Box(-LIMIT, LIMIT, (observation_size(kind),), np.float32)
    return spaces.Dict({name: spaces.Box(-LIMIT, LIMIT, PARTS[name], np.float32) for name in parts(kind)})


def observe_flat(scene: Scene, kind: ObservationKind, distances: Distances | None = None) -> Floats:
    """(size,) the observation as one new float32 array, part after part. `distances`: those of this scene, if
    they are known already.
    """
    path, ego = scene.route.path, scene.ego
    course, line = ego.psi + ego.slip, _lines.get(path, lambda: _prolonged(path))
    return observed(
        _ego(scene, distances or measure(scene)),
        ego.x, ego.y, ego.psi, ego.v * math.cos(course), ego.v * math.sin(course),
        OTHERS, scene.position, scene.heading, scene.velocity, 1.0 / POSITION, 1.0 / VELOCITY, OTHERS_CUT,
        line, min(max(scene.ego_s / STATION, 0.0), len(line) - _SPAN - 1.0), _STRIDE, WAYPOINTS,
        1.0 / TO_WAYPOINT, scene.route.task, TASKS,
        conflict_features(scene) if kind == "conflict" else _NO_CONFLICT, LIMIT,
    )  # fmt: skip


def unflatten(flat: Floats, kind: ObservationKind) -> dict[str, Floats]:
    """The parts of a flat observation, as views of it."""
    result, start = {}, 0
    for name in parts(kind):
        end = start + math.prod(PARTS[name])
        result[name] = flat[start:end].reshape(PARTS[name])
        start = end
    return result


def _ego(scene: Scene, distances: Distances) -> Ten:
    ego, centre = scene.ego, scene.network.center
    turn = scene.route.canonical_angle
    cos, sin = math.cos(turn), math.sin(turn)
    heading = (ego.psi - turn) / math.pi
    east, north = ego.x - float(centre[0]), ego.y - float(centre[1])
    return (
        1.0,
        (cos * east + sin * north) / POSITION,
        (cos * north - sin * east) / POSITION,
        ego.v * math.cos(ego.slip) / VELOCITY,
        ego.v * math.sin(ego.slip) / VELOCITY,
        heading - 2.0 * math.ceil(0.5 * (heading - EGO_CUT)),
        ego.yaw_rate / YAW_RATE,
        distances.vehicle_m / TO_VEHICLE,
        distances.road_m / TO_ROAD,
        distances.destination_m / POSITION,
    )


def _prolonged(path: ReferencePath) -> Array:
    """(M, 2) m, the path's points every 0.5 m, continued straight on as far as a waypoint can lie."""
    x, y, _ = path.pose(STATION * np.arange(len(path.s) + 2 * _SPAN, dtype=np.float64))
    return np.stack([x, y], axis=1)
