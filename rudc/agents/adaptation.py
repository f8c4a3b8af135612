"""Adapts a driver to the car and road that it has: which scene it is shown, and how fast it may go. The plant
(dead time, lag and friction) is estimated (rudc/safety/plant.py) or known (`Scene.actuation`, for ablations).

    look ahead   A command given now acts after the dead time d. So the driver is shown the scene d later: the
                 ego as the commands that are on their way move it, the others along their paths (a Smith
                 predictor)
    brakes       The scene also says with which lag the brakes act (`Scene.lag_s`): the last resort's stops
                 begin with the present acceleration, and reckon with that lag
    haste        Wheels with a lag T are commanded beyond the wanted angle delta, so that they reach it within
                 one decision of t s: delta_0 + (delta - delta_0) / (1 - exp(-t / T))
    limits       Braking and accelerating are limited to USABLE mu g, for filter, last resort and driver alike
    govern       Bends are taken at the speed at which they need USABLE mu g, reached by braking at BRAKING mu
                 g, or at that share of full braking if that is less. Where the road has shown less grip than
                 a dry one, bends may need LATERAL mu g only. Where grip is poor, the speed on straights is at
                 most the larger of CAREFUL and the speed that this braking stops within STOPPING m, and the
                 ego can stop for anybody who may come from where it does not see (hidden.py).
                 A road that grips well may become poor within a bend. So the ego also drives only so fast
                 that it would come at most WIDE m off its line on the next LOST_M m if the grip fell to
                 POOREST or, where this road has shown less than that, to AGAIN of the least: where there was
                 foam or oil once, there may be more.
                 Steering is limited to what braking, of up to BRAKING mu g, leaves of mu g, or of FIRM mu g
                 where the road has shown less grip than a dry one: wheels that ask for more do not turn the
                 car any further, and take all grip from the brakes
                 A car that is late (LATE_S) notices late that a bend asks for too much, and one that was late
                 for LATE_FOR_S may become late again, even once it is prompt (PROMPT_S): for both, bends
                 may need WARY mu g only.
                 Wheels with a lag T follow a path of curvature k, at v m/s, only if they are commanded to
                 give the curvature k + T v dk/ds: bends are taken so slowly that grip and wheels can give it
    probe        Short full brakings show how well the road grips (probe.py)
    slide        Where the road has shown less grip than a dry one and the ego is too fast for its bend,
                 manoeuvres keep it on the road (slide.py)
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Literal

import numpy as np

from rudc.agents.hidden import speed_by_sight
from rudc.agents.poor_roads import BRAKING, POOR, careful
from rudc.agents.probe import FALLEN, LONGEST_S, Probe
from rudc.agents.slide import Slide
from rudc.arrays import Array
from rudc.env.remembered import Remembered
from rudc.network.paths import SPACING
from rudc.network.route import ReferencePath
from rudc.safety.plant import DECISION_S, ORDINARY, PlantEstimate, PlantMonitor
from rudc.safety.prediction import others_later
from rudc.safety.tyres import USABLE
from rudc.vehicle import Actuation, EgoVehicle
from rudc.world.ego import DRY, GRAVITY, EgoPlant, widest_steering
from rudc.world.scene import STANDING, Scene

Knowledge = Literal["off", "estimated", "known"]

LATERAL = 0.75
"""share of mu g that bends may ask for where it is less than on a dry road"""
LATE_S, PROMPT_S, LATE_FOR_S, WARY = 0.25, 0.1, 0.5, 0.5
"""s, dead time and lag together from which on a car is late; s, below which it is no longer; s, for how long
it must have been late to be driven warily for good; share of mu g that bends may ask for while it is late,
and for good after that"""
POOREST, WIDE, LOST_M = 0.45 * GRAVITY, 1.0, 12.0
"""m/s2, m, m: a wet, dirty road's grip; how far off its line an ego may come on it, and within which way"""
AGAIN, GRADE = 0.6, 0.25
"""share of the least grip that a road has shown, to which it may fall again; m/s2, steps in which that is
kept"""
FIRM = 0.95
"""share of a limited mu g that steering may ask for: all of it would leave nothing for the brakes if the road
gave a little less than is known
"""
FULL = 0.98
"""share of the possible braking from which on full braking is commanded: asking for more than the road gives
brakes no less, and shows at once if the road gives more than was thought"""
GOVERNED_S = 0.2
"""s, or a decision if that is longer: time in which an ego that is too fast for its bends is slowed down"""
SLOWEST, FASTEST, HALVINGS = 1.0, 50.0, 14
"""m/s, never slower than this because of late wheels or of what a road may become; m/s, faster than anybody
drives; steps in which a speed is found"""

_falling: Remembered[ReferencePath, Array] = Remembered()
"""`_if_grip_falls` of each path, to POOREST"""


class Adaptation:
    """Adapts one agent to its car and road, decision by decision; call `reset` at the start of each
    episode.
    """

    def __init__(self, knowledge: Knowledge, *, probe: bool) -> None:
        self._known, self._probes = knowledge == "known", probe and knowledge == "estimated"
        self.estimate = ORDINARY
        """what is known of the car at present"""
        self.asks = False
        """whether the last command brakes in order to learn how well the road grips"""

    def reset(self, scene: Scene) -> None:
        """Begin a new episode with an ordinary car."""
        self._monitor = PlantMonitor(scene.vehicle)
        self._seen: float | None = None
        self._decision_s = DECISION_S
        """s between the last two decisions"""
        self._late_since: float | None = None
        """s, since when the car has been late; None while it is not"""
        self._wary = False
        """whether it was late for LATE_FOR_S and became prompt again"""
        self._probe = Probe() if self._probes else None
        self._slide = Slide()
        self._poorest = POOREST
        """m/s2, to which the grip may fall"""
        self._profiles: dict[tuple[float, float, float, float], Array] = {}
        """m/s2 of grip, share of it that bends may ask for, s of lag, m/s2 to which grip may fall -> m/s at
        each station of `_path`"""
        self._path: ReferencePath | None = None

    def see(self, scene: Scene) -> Scene:
        """The scene in which a command given now will act, with the vehicle's limits as the road allows and
        the lag of its brakes.
        """
        if self._seen != scene.time_s:
            if self._seen is not None:
                self._decision_s = round(scene.time_s - self._seen, 6)
            self._seen = scene.time_s
            self.estimate = self._monitor.update(scene.ego, scene.last_u, self._decision_s)
            if self._known and scene.actuation is not None:
                self.estimate = PlantEstimate(scene.actuation, unusual=scene.actuation != Actuation())
            self._expect_again(self.estimate.grip)
            self._notice_late(scene.time_s)
            if self._probe is not None:
                self._probe.look(scene, self.estimate.grip)
        if not self.estimate.unusual:
            return scene
        grip, body = USABLE * self.estimate.grip, scene.vehicle
        limited = replace(body, a_min=max(body.a_min, -grip), a_max=min(body.a_max, grip))
        known = {"lag_s": self.estimate.actuation.lag_s, "grip": self.estimate.grip}
        return replace(self._ahead(scene), vehicle=limited, **known)

    def govern(self, scene: Scene, u: Array, *, onwards: bool = False) -> Array:
        """(2,) m/s2 and rad, the command `u` (2,) within its bounds; `scene` as `see` showed it.
        `onwards`: the speed is bounded in bends only, by the grip that is known, and no probe is made.
        """
        a, delta, grip = float(u[0]), float(u[1]), min(self.estimate.grip, DRY * GRAVITY)
        allowed = self._allowed(scene, grip, feared=not onwards)
        if grip < POOR and not onwards:
            braking = _braking(scene, grip)
            allowed = min(allowed, careful(braking), speed_by_sight(scene, braking))
        a = min(a, (allowed - scene.ego.v) / max(GOVERNED_S, self._decision_s))
        self.asks = not onwards and self._asks(scene, grip)
        if self.asks or a <= FULL * max(scene.vehicle.a_min, -USABLE * grip):
            a = scene.network.vehicle.a_min
        firm = FIRM * grip if self._limited else grip
        left = math.sqrt(firm**2 - min(max(-a, 0.0), BRAKING * firm) ** 2)
        widest = widest_steering(scene.vehicle, scene.ego.v, left)
        delta = min(max(self._hastened(scene.ego.steering, delta), -widest), widest)
        u = u if (a, delta) == (u[0], u[1]) else np.array([a, delta])
        if self._limited:
            profile = self._speeds(scene, grip, 0.0, feared=False)
            u = self._slide.hold(scene, u, grip, self.estimate.actuation.lag_s, profile)
        return u

    @property
    def _limited(self) -> bool:
        """Whether the road has shown less grip than a dry one."""
        return self.estimate.grip < DRY * GRAVITY

    def _expect_again(self, grip: float) -> None:
        """Where the road has shown less than POOREST, expect AGAIN of the least of it."""
        if grip < POOREST:
            self._poorest = min(self._poorest, max(GRADE * round(AGAIN * grip / GRADE), GRADE))

    def _notice_late(self, time_s: float) -> None:
        """Find out whether the car is late, and whether it was for long and is no longer."""
        since, late_s = self._late_since, self.estimate.actuation.delay_s + self.estimate.actuation.lag_s
        if late_s >= LATE_S:
            self._late_since = time_s if since is None else since
        elif since is not None and late_s < PROMPT_S:
            self._wary |= time_s - since >= LATE_FOR_S
            self._late_since = None

    def _hastened(self, now: float, wanted: float) -> float:
        """rad, the command that takes lagging wheels from `now` to `wanted` within a decision."""
        lag = self.estimate.actuation.lag_s
        return now + (wanted - now) / (1.0 - math.exp(-self._decision_s / lag)) if lag > 0.0 else wanted

    def _ahead(self, scene: Scene) -> Scene:
        """The scene after the dead time, if there is one."""
        actuation = self.estimate.actuation
        pending = self._monitor.pending(actuation.delay_s)
        if not pending:
            return scene
        plant = EgoPlant(scene.vehicle)
        plant.resume(scene.ego, replace(actuation, delay_s=0.0))
        for a, delta in pending:
            plant.step(a, delta, self._monitor.substep_s)
        later, ego = len(pending) * self._monitor.substep_s, plant.state
        s, offset = scene.route.path.project(ego.x, ego.y, scene.ego_s + 0.5 * later * (scene.ego.v + ego.v))
        waited = 0.0 if ego.v >= STANDING else scene.waited_s
        return replace(others_later(scene, later), ego=ego, ego_s=s, ego_offset=offset, waited_s=waited)

    def _allowed(self, scene: Scene, grip: float, reaction_s: float = 0.0, *, feared: bool = True) -> float:
        """m/s, speed from which all bends ahead can be taken with that `grip` (m/s2) or, if it is `feared`,
        with what it may fall to: the least of `_speeds` from here to where the ego will be once its speed has
        followed the command."""
        profile = self._speeds(scene, grip, self.estimate.actuation.lag_s, feared=feared)
        within_s = max(GOVERNED_S, self._decision_s)
        way = scene.ego.v * (within_s + self.estimate.actuation.lag_s + reaction_s)
        first = min(max(int(scene.ego_s / SPACING), 0), len(profile) - 1)
        return min(profile[first : first + int(way / SPACING) + 1].tolist())

    def _speeds(self, scene: Scene, grip: float, lag_s: float, *, feared: bool = True) -> Array:
        """(M,) m/s, `_profile` of the ego's path; kept for the next call."""
        path = scene.route.path
        if self._path is not path:
            self._path = path
            self._profiles.clear()
        wary = self._wary or self._late_since is not None
        share = WARY if wary else LATERAL if self._limited else USABLE
        car = grip, share, lag_s
        poorest = self._poorest if feared else math.inf
        profile = self._profiles.get((*car, poorest))
        if profile is None:
            most = np.full(len(path.curvature), FASTEST)
            if poorest == POOREST:
                most = _falling.get(path, lambda: _if_grip_falls(path, POOREST))
            elif feared:
                most = _if_grip_falls(path, poorest)
            profile = _profile(path, scene.vehicle, *car, _braking(scene, grip), most)
            self._profiles[*car, poorest] = profile
        return profile

    def _asks(self, scene: Scene, grip: float) -> bool:
        """Whether to brake now in order to learn how well the road grips."""
        if self._probe is None:
            return False
        allowed = self._allowed(scene, FALLEN * grip, LONGEST_S)
        room = scene.route.stop_line_s - scene.ego_s - 0.5 * scene.vehicle.length
        if grip < POOR and room > 0.0:
            room = max(room - LONGEST_S * scene.ego.v, 0.0)
            allowed = min(allowed, math.sqrt(2 * USABLE * FALLEN * grip * room))
        return self._probe.asks(scene, grip, limited=self._limited, allowed=allowed)


def _braking(scene: Scene, grip: float) -> float:
    """m/s2, planned braking with that `grip` (m/s2). More grip than full braking asks for does not count,
    since no braking shows that it is there.
    """
    return BRAKING * min(grip, -scene.network.vehicle.a_min)


def _profile(
    path: ReferencePath,
    body: EgoVehicle,
    grip: float,
    share: float,
    lag_s: float,
    braking: float,
    most: Array,
) -> Array:
    """(M,) m/s, highest speed at each station of the path from which all bends ahead can be taken with that
    `share` of the `grip` (m/s2) and wheels that lag by `lag_s`, and at no more than `most` (M,) m/s, braking
    at `braking` m/s2.
    """
    squared = np.minimum(share * grip / np.maximum(np.abs(path.curvature), 1e-4), most**2)
    if lag_s > 0.0:
        squared = np.minimum(squared, _followed(path, body, share * grip, lag_s) ** 2)
    best = squared.tolist()
    for i in range(len(best) - 2, -1, -1):
        best[i] = min(best[i], best[i + 1] + 2 * braking * SPACING)
    return np.sqrt(best)


def _if_grip_falls(path: ReferencePath, poorest: float) -> Array:
    """(M,) m/s, FASTEST or less: the highest speed at each station with which an ego that can turn with
    `poorest` m/s2 only, and keeps its speed, comes at most WIDE m off its line in the next LOST_M m.
    """
    ahead = np.pad(path.curvature, (0, round(LOST_M / SPACING)), mode="edge")
    bend = np.lib.stride_tricks.sliding_window_view(ahead, round(LOST_M / SPACING))[: len(path.curvature)]
    low, high = np.full(len(bend), SLOWEST), np.full(len(bend), FASTEST)
    for _ in range(HALVINGS):
        v = 0.5 * (low + high)
        can = (poorest / v**2)[:, None]
        turned = np.cumsum(bend - np.clip(bend, -can, can), axis=1) * SPACING
        fits = (np.abs(np.cumsum(turned, axis=1)) * SPACING).max(axis=1) <= WIDE
        low, high = np.where(fits, v, low), np.where(fits, high, v)
    return low


def _followed(path: ReferencePath, body: EgoVehicle, lateral: float, lag_s: float) -> Array:
    """(M,) m/s, SLOWEST or more: the highest speed at each station at which wheels that lag by `lag_s` can be
    commanded to follow the path, if a command may ask for `lateral` m/s2 and the wheels' largest angle.
    """
    bend, change = path.curvature, np.gradient(path.curvature, SPACING)
    slip = math.atan(body.cg_to_rear / body.wheelbase * math.tan(body.delta_max))
    tightest = math.sin(slip) / body.cg_to_rear
    low, high = np.full(len(bend), SLOWEST), np.full(len(bend), body.v_max)
    for _ in range(HALVINGS):
        v = 0.5 * (low + high)
        asked = np.abs(bend + lag_s * v * change)
        fits = (asked <= tightest) & (v**2 * np.maximum(asked, np.abs(bend)) <= lateral)
        low, high = np.where(fits, v, low), np.where(fits, high, v)
    return low
