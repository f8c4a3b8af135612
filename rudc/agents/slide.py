"""A way to stay on the road for a car that is too fast for the grip that it has found.

Where grip fails before or in a bend, steering and braking share what is left of it: following the line with
both leads off the road though the junction is wide. So what following comes to is looked at ahead, with the
car as known. If it ends beside the road or on the wrong side, other manoeuvres are tried, judged with less
grip and nearer to the road's edge, so that following has the benefit of the doubt:

    swerve    straight on with all grip for the brakes, for one of FIRST_S s; then back onto the line, with
              one of SHARES of the grip for the brakes until the ego is slow enough for a tight bend
    turn      where it is that slow: on slowly, the wheels straight or turned all the way to one side, for
              one of FIRST_S s; then back onto the line
    stop      on an arc, with one of LATERALS of the grip for steering and the rest for the brakes

The one that gets back onto the line soonest is taken, hitting nobody and staying on the road; else the one
that ends nearest to the line; if everything fails, the line is followed, or, slow, the ego stops. That is
decided anew at each decision until the ego is back on its line. An ego that stands where no way leads back
stays there, and looks again each AGAIN_S s.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from rudc.arrays import Array, Complex
from rudc.env.tracking import RESPONSE_S, steering
from rudc.geometry import separation
from rudc.network.paths import SPACING
from rudc.safety.prediction import those_ahead
from rudc.vehicle import Actuation
from rudc.world.borders import OFF_ROAD_M, Borders
from rudc.world.ego import GRAVITY, EgoPlant, widest_steering
from rudc.world.scene import EgoState, Scene

STEP_S, HORIZON_S = 0.2, 8.0
"""s, s"""
FIRST_S = 0.0, 0.4, 0.8, 1.2, 1.6, 2.0, 2.6
"""s"""
AGAIN_S = 1.0
"""s"""
SHARES = 0.6, 0.0
"""of grip"""
LATERALS = 0.0, 0.3, -0.3, 0.6, -0.6, 0.9, -0.9
"""of grip, positive to the left"""
USED = 0.95
"""share of the grip that a manoeuvre counts on"""
SLOW_BEND, SLOW, SLOW_A = 0.25, 2.0, 1.0
"""1/m, bend that the ego is slow enough for at the end of braking; m/s, slow in any case; m/s2, with which it
comes to be so fast"""
BACK_M, BACK_RAD = 0.5, 0.2
"""m and rad from the line, within which the ego is back on it"""
EDGE = 0.15
"""m, by which a corner may stick out over the road's edge: half of what counts as leaving it"""
NEAR, APART = 50.0, 0.2
"""m within which others are looked at; m kept from them"""


_Command = Callable[[float, EgoState, float, float], tuple[float, float]]
"""time (s), state, s and offset (m) on the line -> m/s2, rad"""


class _Way(NamedTuple):
    """What becomes of a manoeuvre."""

    first: tuple[float, float]
    """m/s2, rad: its first command"""
    fails: bool
    """whether it leaves the road or hits somebody"""
    back: bool
    """whether it ends on the line"""
    rank: float
    """s until then, or else m from the line at its end"""


class Slide:
    """Of one episode."""

    def __init__(self) -> None:
        self._under_way, self._again_s = False, -math.inf

    def hold(self, scene: Scene, u: Array, grip: float, lag_s: float, profile: Array) -> Array:
        """(2,) the command, m/s2 and rad, or that of a manoeuvre that keeps the ego on the road.

        `grip` (m/s2) and `lag_s` are what is known of road and car, `profile` (M,) m/s the speeds from which
        the bends of the ego's path can be taken with that grip.
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
            return u
        best = _Ways(scene, USED * grip, *known, others=_others(scene)).best()
        if best is None:
            return u if scene.ego.v > SLOW else np.array([scene.vehicle.a_min, u[1]])
        if scene.ego.v == 0.0 and not best.back:
            self._again_s = scene.time_s + AGAIN_S
        a, delta = best.first
        return np.array([min(float(u[0]), a), delta])


class _Ways:
    """Manoeuvres from one scene, looked at ahead."""

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
        """`others`: as of `_others`, None if they do not count; `edge`: as EDGE."""
        self._scene, self._grip, self._profile = scene, grip, profile
        self._others, self._step_s, self._edge = others, step_s, edge
        self._actuation = Actuation(lag_s=lag_s, friction=grip / GRAVITY)
        self._slow = max(math.sqrt(grip / SLOW_BEND), SLOW)

    def best(self) -> _Way | None:
        """The one to take, if there is one that does not fail."""
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
        """Straight on for so long, or, slow, with the wheels to one side (1 left, -1 right); then onto the
        line with that share of the grip for the brakes.
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
        """On an arc with that share of the grip for steering."""
        grip, body = self._grip, self._scene.vehicle

        def command(t: float, ego: EgoState, s: float, offset: float) -> tuple[float, float]:
            wide = widest_steering(body, max(ego.v, SLOW), grip * abs(lateral))
            return body.a_min, math.copysign(min(wide, body.delta_max), lateral)

        return self._look(command)

    def _look(self, command: _Command) -> _Way:
        """What becomes of the ego under these commands."""
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
    """Whether an ego is on its line, and slow enough for what comes."""
    path = scene.route.path
    astray = math.remainder(ego.psi + ego.slip - path.heading_at(s), 2 * math.pi)
    station = min(max(int(s / SPACING), 0), len(profile) - 1)
    return abs(offset) < BACK_M and abs(astray) < BACK_RAD and ego.v <= profile[station]


def _others(scene: Scene) -> tuple[Complex, Complex, Array]:
    """(n, T) m, (n, T) and (n, 2) m: places, directions and half sizes of those near, at their speeds."""
    who = np.flatnonzero(np.hypot(*(scene.position - scene.ego_position).T) < NEAR)
    times = STEP_S * np.arange(1, round(HORIZON_S / STEP_S) + 1)
    speed = np.hypot(scene.velocity[who, 0], scene.velocity[who, 1])
    place, facing = those_ahead(scene, who, speed[:, None] * times)
    return place, facing, 0.5 * scene.size[who]
