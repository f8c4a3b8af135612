"""Manoeuvres that keep a car on the road which is too fast for the grip that it has found.

Where grip fails before a bend or in it, steering and braking share the little that there is. Following the
line with both then leads off the road, although the junction has room beside the line. So it is predicted
where following leads, with the car as it is known. If the ego would leave the road or enter the wrong side,
other manoeuvres are tried. They are judged more strictly, with less grip and less room at the road's edge, so
that following is preferred in doubt. An ego that follows from BACK_M or more off the line accelerates no
more, and brakes no less, than was predicted:

    swerve    straight on with all grip for the brakes, for one of FIRST_S s; then back onto the line, with
              one of SHARES of the grip for the brakes until the ego is slow enough for a tight bend
    turn      if the ego is that slow already: on slowly, with the wheels straight or turned fully to one
              side, for one of FIRST_S s; then back onto the line
    stop      on an arc, with one of LATERALS of the grip for steering and the rest for the brakes

Of those that hit nobody and stay on the road, the one is taken that is back on the line first; if none gets
back, the one that ends nearest to the line. If all fail, a fast ego follows the line and a slow one
stops. All this is decided anew in each decision until the ego is back on its line. An ego that stands
where no manoeuvre leads back stays there and tries again every AGAIN_S s.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from rudc.arrays import Array, Complex
from rudc.env.tracking import RESPONSE_S, at_most, steering
from rudc.geometry import separation
from rudc.network.paths import SPACING
from rudc.safety.prediction import those_ahead
from rudc.vehicle import Actuation
from rudc.world.borders import OFF_ROAD_M, Borders
from rudc.world.ego import GRAVITY, EgoPlant, widest_steering
from rudc.world.scene import EgoState, Scene

STEP_S, HORIZON_S = 0.2, 8.0
"""s, s: step and length of the predictions"""
FIRST_S = 0.0, 0.4, 0.8, 1.2, 1.6, 2.0, 2.6
"""s, lengths of the first part of a manoeuvre"""
AGAIN_S = 1.0
"""s, time after which an ego that stands tries again"""
SHARES = 0.6, 0.0
"""shares of the grip for the brakes"""
LATERALS = 0.0, 0.3, -0.3, 0.6, -0.6, 0.9, -0.9
"""shares of the grip for steering, positive to the left"""
USED = 0.95
"""share of the known grip with which manoeuvres are predicted"""
SLOW_BEND, SLOW, SLOW_A = 0.25, 2.0, 1.0
"""1/m: an ego is slow if grip is enough for a bend of this curvature; m/s: it is slow in any case; m/s2:
largest acceleration of an ego that is slower than that"""
BACK_M, BACK_RAD = 0.5, 0.2
"""m and rad: nearer to the line than this, in offset and direction, the ego is back on it"""
EDGE = 0.15
"""m, by which a corner may stick out over the road's edge in a manoeuvre: half of what counts as off the
road"""
NEAR, NEAR_S, APART = 50.0, 5.0, 0.2
"""m, s: others count within the first, or as far as they come in the second if that is more; m, gap that is
kept from them"""


_Command = Callable[[float, EgoState, float, float], tuple[float, float]]
"""time (s), state, s and offset (m) on the line -> m/s2, rad"""


class _Way(NamedTuple):
    """The predicted result of a manoeuvre."""

    first: tuple[float, float]
    """m/s2, rad: its first command"""
    fails: bool
    """whether it leaves the road or hits somebody"""
    back: bool
    """whether it ends on the line"""
    rank: float
    """s until it is back on the line; if it is not, m from the line at its end"""


class Slide:
    """Decides on manoeuvres in one episode."""

    def __init__(self) -> None:
        self._under_way, self._again_s = False, -math.inf

    def hold(self, scene: Scene, u: Array, grip: float, lag_s: float, profile: Array) -> Array:
        """(2,) m/s2 and rad, the command `u` (2,), or that of a manoeuvre that keeps the ego on the road.

        `grip`: m/s2, the known grip of the road; `lag_s`: s, the known lag of the car; `profile`: (M,) m/s,
        speed at each station of the ego's path from which all its bends ahead can be taken with that grip.
        """
        station = min(max(int(scene.ego_s / SPACING), 0), len(profile) - 1)
        if not self._under_way and scene.ego.v <= profile[station]:
            return u
        self._under_way = not _is_back(scene, scene.ego, scene.ego_s, scene.ego_offset, profile)
        if not self._under_way:
            return u
        if scene.ego.v == 0.0 and scene.time_s < self._again_s:
            return np.array([scene.vehicle.a_min, u[1]])
        known = lag_s, profile
        follow = _Ways(scene, grip, *known, step_s=0.5 * STEP_S, edge=OFF_ROAD_M).swerve(0.0, SHARES[0])
        if not follow.fails:
            return u if abs(scene.ego_offset) < BACK_M else at_most(u, follow.first[0])
        best = _Ways(scene, USED * grip, *known, others=_others(scene)).best()
        if best is None:
            return u if scene.ego.v > SLOW else np.array([scene.vehicle.a_min, u[1]])
        if scene.ego.v == 0.0 and not best.back:
            self._again_s = scene.time_s + AGAIN_S
        a, delta = best.first
        return np.array([min(float(u[0]), a), delta])


class _Ways:
    """Predicts the manoeuvres that can begin in one scene."""

    def __init__(
        self,
        scene: Scene,
        grip: float,
        lag_s: float,
        profile: Array,
        *,
        others: tuple[Complex, Complex, Array] | None = None,
        step_s: float = STEP_S,
        edge: float = EDGE,
    ) -> None:
        """`others`: as `_others` returns them, None if they do not count; `edge`: m, as EDGE."""
        self._scene, self._grip, self._profile = scene, grip, profile
        self._others, self._step_s, self._edge = others, step_s, edge
        self._actuation = Actuation(lag_s=lag_s, friction=grip / GRAVITY)
        self._slow = max(math.sqrt(grip / SLOW_BEND), SLOW)

    def best(self) -> _Way | None:
        """The manoeuvre to take; None if all fail."""
        if self._scene.ego.v > self._slow:
            ways = [self.swerve(t, share) for t in FIRST_S for share in SHARES]
        else:
            ways = [self.swerve(t, 0.0, side) for t in FIRST_S for side in (0.0, 1.0, -1.0)]
        kept = [way for way in ways if way.back and not way.fails]
        if not kept:
            ways += [self.stop(share) for share in LATERALS]
            kept = [way for way in ways if not way.fails]
        return min(kept, key=lambda way: way.rank, default=None)

    def swerve(self, first_s: float, share: float, side: float = 0.0) -> _Way:
        """For `first_s` s straight on with full braking, or, if slow, on with the wheels to one `side` (1
        left, -1 right, 0 straight); then back onto the line with that `share` of the grip for the brakes.
        """
        scene, grip, body = self._scene, self._grip, self._scene.vehicle

        def command(t: float, ego: EgoState, s: float, offset: float) -> tuple[float, float]:
            fast = ego.v > self._slow
            braking = (1.0 if t < first_s else share) if fast else 0.0
            wide = widest_steering(body, ego.v, grip * math.sqrt(1.0 - braking**2))
            if t < first_s:
                delta = side * body.delta_max
            else:
                delta = steering(replace(scene, ego=ego, ego_s=s, ego_offset=offset))
            a = -braking * grip if fast else min((self._slow - ego.v) / RESPONSE_S, SLOW_A)
            return a, min(max(delta, -wide), wide)

        return self._look(command)

    def stop(self, lateral: float) -> _Way:
        """A stop on an arc with the share `lateral` of the grip for steering, positive to the left."""
        grip, body = self._grip, self._scene.vehicle

        def command(t: float, ego: EgoState, s: float, offset: float) -> tuple[float, float]:
            wide = widest_steering(body, max(ego.v, SLOW), grip * abs(lateral))
            return body.a_min, math.copysign(min(wide, body.delta_max), lateral)

        return self._look(command)

    def _look(self, command: _Command) -> _Way:
        """The predicted result of these commands."""
        scene = self._scene
        plant = EgoPlant(scene.vehicle)
        plant.resume(scene.ego, self._actuation)
        borders = Borders(scene.network.surface, scene.vehicle, scene.may_cross_centre, self._edge)
        if any(borders.left(scene.ego)):
            borders = Borders(scene.network.surface, scene.vehicle, scene.may_cross_centre)
        s, offset, first, states = scene.ego_s, scene.ego_offset, None, list[EgoState]()
        back, end, fails = False, HORIZON_S, False
        for k in range(round(HORIZON_S / self._step_s)):
            a, delta = command(k * self._step_s, plant.state, s, offset)
            first = first or (a, delta)
            ego = plant.step(a, delta, self._step_s)
            states.append(ego)
            if any(borders.left(ego)):
                fails = True
                break
            s, offset = scene.route.path.project(ego.x, ego.y, s)
            if _is_back(scene, ego, s, offset, self._profile):
                back, end = True, k * self._step_s
                break
            if ego.v == 0.0:
                break
        assert first is not None
        return _Way(first, fails or self._hits(states), back, end if back else abs(offset))

    def _hits(self, states: list[EgoState]) -> bool:
        """Whether an ego in these states comes too close to somebody."""
        if self._others is None or not len(self._others[0]):
            return False
        place, facing, half = self._others
        here = np.array([complex(ego.x, ego.y) for ego in states])
        ahead = np.exp(1j * np.array([ego.psi for ego in states]))
        body = self._scene.vehicle
        size = 0.5 * np.array([body.length, body.width])
        n = len(states)
        gap = separation(place[:, :n] - here, ahead[None], facing[:, :n], size, half[:, None])
        return bool((gap < APART).any())


def _is_back(scene: Scene, ego: EgoState, s: float, offset: float, profile: Array) -> bool:
    """Whether an ego is on its line, and slow enough for the bends ahead."""
    path = scene.route.path
    astray = math.remainder(ego.psi + ego.slip - path.heading_at(s), 2 * math.pi)
    station = min(max(int(s / SPACING), 0), len(profile) - 1)
    return abs(offset) < BACK_M and abs(astray) < BACK_RAD and ego.v <= profile[station]


def _others(scene: Scene) -> tuple[Complex, Complex, Array]:
    """(n, T) m, (n, T) and (n, 2) m: predicted positions and directions, at their present speeds, and half
    sizes, of the others that are near (NEAR, NEAR_S).
    """
    speed = scene.speed
    away = np.hypot(*(scene.position - scene.ego_position).T)
    who = np.flatnonzero(away < np.maximum(NEAR, NEAR_S * speed))
    times = STEP_S * np.arange(1, round(HORIZON_S / STEP_S) + 1)
    place, facing = those_ahead(scene, who, speed[who, None] * times)
    return place, facing, 0.5 * scene.size[who]
