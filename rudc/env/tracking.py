"""Following a reference path: steering by feed-forward and feedback, and the speed that its bends allow.

Steering. With e the offset to the path's left and theta the angle from the path to the direction of travel
(psi + slip), motion along the path at curvature c is, to first order and for any speed,
    de/ds = theta,    dtheta/ds = c - c_path
so that
    c = c_path - 2 theta / L - e / L^2
brings the vehicle back, critically damped, within a few times L. The plant of rudc/world/ego.py drives at
curvature c if
    slip = asin(l_r c),    delta = atan(wheelbase / l_r * tan(slip)).
Where c_path changes within a few metres, as where the ego pulls out, the slip changes with it, and theta is
off by as much. With L = 2 l_r this is undone at once, since the commanded slip is then about l_r c_path -
theta; so L is 2 l_r at low speed. At higher speeds it is what the ego drives in RETURN_S s, or longer where
the road grips less, and at most RETURN_M m.
Decisions last 0.1 s, so c_path is read where the vehicle will be half a decision later.

Speed. v(s)^2 <= LATERAL / |c_path(s)| everywhere, and braking at COMFORT is enough to keep to it:
    v(s)^2 <= v(s + ds)^2 + 2 COMFORT ds.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from rudc.arrays import Array
from rudc.env.remembered import Remembered
from rudc.env.tracking_kernels import deviation, front_wheels, way_back
from rudc.network.paths import SPACING
from rudc.network.route import ReferencePath
from rudc.vehicle import EgoVehicle
from rudc.world.scene import Scene

LATERAL = 3.0
"""m/s2, lateral acceleration accepted in bends"""
COMFORT = 2.0
"""m/s2, planned deceleration"""
RETURN_M = 6.0
"""m, the longest L above; with actuators that respond 0.4 s late, 4 m makes a vehicle at 8.5 m/s oscillate,
and 6 m does not
"""
RETURN_S, ASIDE_M = 0.75, 3.4
"""s, m: L = v max(RETURN_S, sqrt(ASIDE_M / a)), where a is full braking: then an offset of ASIDE_M, a lane's
width, asks for no more than the grip
"""
CALM_S = 1.5
"""s, RETURN_S for drivers by rules: longer, so that a car that responds late swings less. From 4 m/s on L is
RETURN_M; with RETURN_S, from 8 m/s on
"""
WEAKEST = 0.01
"""m/s2, full braking counts as this if it is less"""
PREVIEW_S = 0.05
"""s, half a decision"""
RESPONSE_S = 0.4
"""s, time in which a difference in speed is made up"""
LAGGING = 1.5
"""with brakes that lag by T, a difference that is made up within this many T is made up without overshooting
much: the damping is 0.5 sqrt(LAGGING)"""
PLANNED = 5.0 / 6.0
"""largest share of full braking that a plan may use"""

_bends: Remembered[ReferencePath, Array] = Remembered()


def steering(scene: Scene, return_s: float = RETURN_S) -> float:
    """rad, front-wheel angle that follows `scene.route.path`; `return_s`: RETURN_S or CALM_S."""
    ego, path, body = scene.ego, scene.route.path, scene.vehicle
    return front_wheels(
        path.poses, path.curvature, scene.ego_s, scene.ego_offset, ego.psi, ego.v, PREVIEW_S,
        *way_back_of(body, return_s), body.wheelbase, body.cg_to_rear, body.delta_max,
    )  # fmt: skip


def way_back_of(body: EgoVehicle, return_s: float = RETURN_S) -> tuple[float, float]:
    """s and m: L is as far as the ego drives in the first, 2 l_r at least, and at most the second."""
    return max(return_s, math.sqrt(ASIDE_M / max(-body.a_min, WEAKEST))), RETURN_M


def slowing(scene: Scene, room: float, speed: float, deceleration: float) -> float:
    """m/s2, acceleration to command so that the ego slows down to `speed` m/s within `room` m, braking at
    `deceleration` m/s2.

    The ego follows the speed sqrt(speed^2 + 2 deceleration (room - R v)) with a delay of R, the
    `response`. So the deceleration is constant, and at the end of the room the ego is not faster than
    `speed`. With a long delay that brakes too gently where the room is too short for it: there the ego brakes
    as hard as what the lag leaves of the room asks for.
    """
    v, within = scene.ego.v, response(scene)
    wanted = math.sqrt(speed**2 + 2 * deceleration * max(room - within * v, 0.0))
    a = (wanted - v) / within
    if within > RESPONSE_S and v > speed:
        needed = (v**2 - speed**2) / (2 * max(room - scene.lag_s * v, 0.01))
        a = min(a, -needed) if needed > deceleration else a
    return max(a, scene.vehicle.a_min)


def response(scene: Scene) -> float:
    """s, RESPONSE_S; where the brakes lag by more, LAGGING times their lag."""
    return max(RESPONSE_S, LAGGING * scene.lag_s)


def slowing_for_limits(scene: Scene, share: float, deceleration: float) -> float:
    """m/s2, acceleration to command so that the ego meets each speed limit that begins ahead on its path with
    `share` times it at most, braking at `deceleration` m/s2; inf if none begins there.
    """
    ahead = [(begin - scene.ego_s, limit) for begin, limit in scene.route.limits if begin > scene.ego_s]
    return min((slowing(scene, room, share * limit, deceleration) for room, limit in ahead), default=math.inf)


def stopping(scene: Scene, deceleration: float) -> float:
    """m that the ego needs to stop, braking at `deceleration` m/s2 as `slowing` has it."""
    return response(scene) * scene.ego.v + scene.ego.v**2 / (2.0 * deceleration)


def planned(scene: Scene, deceleration: float) -> float:
    """m/s2, `deceleration` or, where the road gives too little for it, PLANNED times full braking."""
    return min(deceleration, PLANNED * -scene.vehicle.a_min)


def hardest(scene: Scene, deceleration: float) -> float:
    """m/s2, `deceleration` or, where the road gives less, full braking."""
    return min(deceleration, -scene.vehicle.a_min)


def at_most(u: Array, acceleration: float) -> Array:
    """(2,) the command u (2,), m/s2 and rad, with an acceleration of at most `acceleration` m/s2."""
    return u if u[0] <= acceleration else np.array([acceleration, u[1]])


def close_to_path(scene: Scene, within: float) -> Scene:
    """The scene with an ego that gets no farther than `within` m from the path if it follows it by
    `steering`.

    It is the scene itself if its ego does so. Otherwise the ego's offset and its angle to the path are scaled
    down by one factor.

    If there is no delay, e(s) = (e + b s) exp(-s / L) with b = theta + e / L, which is largest at
    s = L - e / b.
    """
    path, offset = scene.route.path, scene.ego_offset
    _, slip, astray = deviation(
        path.poses, path.curvature, scene.ego_s, scene.ego.psi, scene.ego.v, PREVIEW_S,
        scene.vehicle.cg_to_rear,
    )  # fmt: skip
    back = way_back(scene.ego.v, *way_back_of(scene.vehicle), scene.vehicle.cg_to_rear)
    farthest, b = abs(offset), astray + offset / back
    if b != 0.0 and (there := 1.0 - offset / (b * back)) > 0.0:
        farthest = max(farthest, abs(b) * back * math.exp(-there))
    if farthest <= within:
        return scene
    share = within / farthest
    offset, (x, y, heading) = share * offset, map(float, path.pose(scene.ego_s))
    x, y = x - offset * math.sin(heading), y + offset * math.cos(heading)
    ego = replace(scene.ego, x=x, y=y, psi=heading + share * astray - slip)
    return replace(scene, ego=ego, ego_offset=offset)


def speeds_in_bends(path: ReferencePath) -> Array:
    """(M,) m/s, highest speed at each station of a path from which all bends ahead can be taken. It is
    computed once for each path.
    """
    return _bends.get(path, lambda: _speeds_in_bends(path))


def speeds_on_road(scene: Scene) -> Array:
    """(M,) m/s, `speeds_in_bends` of the ego's path; less where the road gives too little grip for them."""
    profile, lateral = speeds_in_bends(scene.route.path), planned(scene, LATERAL)
    if lateral == LATERAL or scene.vehicle.a_min == scene.network.vehicle.a_min:
        return profile
    return profile * math.sqrt(lateral / LATERAL)


def _speeds_in_bends(path: ReferencePath) -> Array:
    squared = (LATERAL / np.maximum(np.abs(path.curvature), 1e-4)).tolist()
    for i in range(len(squared) - 2, -1, -1):
        squared[i] = min(squared[i], squared[i + 1] + 2 * COMFORT * SPACING)
    return np.sqrt(squared)


def speed_allowed(scene: Scene, profile: Array, cruise: float) -> float:
    """m/s, `cruise` or, if less, what `profile` (`speeds_in_bends` of the ego's path) allows here."""
    index = min(max(int(scene.ego_s / SPACING), 0), len(profile) - 1)
    return min(cruise, float(profile[index]))


def acceleration_towards(speed: float, scene: Scene, most: float) -> float:
    """m/s2, acceleration that brings the ego to `speed` m/s: at most `most`, at least full braking."""
    return min(max((speed - scene.ego.v) / RESPONSE_S, scene.vehicle.a_min), most)
