"""The last resort: an action is only taken if the ego can still stop, or go on, without hitting anybody.

Barrier rows look one step ahead only, at ellipses that leave out the corners of the bodies, and with a
positive slack delta h can stay at -delta / lambda. Therefore the action u that the rows give is judged by
manoeuvres that begin with it:

    stop   u for one step, then full braking until the ego stands: with the steering held, and along the
           route, as hard as the tyres steer and brake at once (tyres.py)
    go     u for one step, then along the route at GO_ACCELERATION up to GO_SPEED, as far as the vehicle can,
           no faster than its bends allow

Where the brakes are known to lag (`Scene.lag_s`), the first step and all stops begin with the acceleration
that the ego has now, and follow the commands with that lag; going on does so in its first step only.

The room of a manoeuvre is the least value, over all instants within the horizon (and between them: somebody
who crosses fast would pass unseen from one to the next) and all others, of

    separation - min(margin, separation now)

margin is last_resort_margin. Towards those who stand still it is STILL_MARGIN at most, and an ego that is
nearer may come a little nearer still (`creeping_past` in kernels.py). The separation of two
rectangles (rudc/geometry.py) is at most their gap. Others are predicted along their paths (see prediction.py)
at their present speed. Those whose speed changes are also predicted a second time: braking on as they do, or
speeding up for another SPEEDS_UP_S. Whoever leads the ego on its path is also predicted braking with HARDEST.
So, if the room of a manoeuvre is not negative, the ego comes no closer to anybody than the margin or, where
it is closer already, than it is now.

    u is taken         if the room of a manoeuvre is not negative; towards those who stand still, that of a
                       stop
    going on           else, if somebody would hit the ego even at full braking (the room of that is below
                       -margin by every prediction of that other), can no longer prevent it by braking
                       GENTLY, and accelerating fully along the route leaves room towards everybody
    full braking       else, if braking fully at once has more room than each of these manoeuvres, or if no
                       stop that begins with u has room towards those who stand still and braking at once has
                       more towards them, whatever else comes. It steers in whichever of these ways has most
                       room: as u does; as the wheels are now, as in the stop that the last action relied on;
                       or along the route. If all of these hit somebody, those that leave the road within
                       SOON_S come last. Where the manoeuvres hit somebody, ALIKE less room will do, too:
                       rectangles that overlap by more than their widths have the same separation, however
                       far they overlap
    u is taken         otherwise

Before that, the proposed action replaces one of the QP (filter.py) that would leave the ego in the way of
somebody who comes within COMING_S, if an ego that goes on is out of that way before: by every prediction of
that other, and SPARE_S before if it keeps its speed and could still stop gently for the ego. The ego may
stop again, behind its leader, after one of GOES_ON_S. A TIGHT margin is enough from those who would hit an
ego that stops, by some prediction of them.

So the ego never hits what stands still, provided that it was seen in time and that the vehicle moves as in
the model: if u was taken because a stop can follow it, a stop is possible again in the next step. Those who
drive behind the ego on its path are left out.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from rudc.arrays import Array, Complex, Flags, Index
from rudc.env.tracking import PREVIEW_S, steering, way_back_of
from rudc.network.paths import SPACING
from rudc.safety.config import FilterConfig
from rudc.safety.last_resort_kernels import (
    in_reach,
    lagging_step,
    on_arc,
    room_left,
    room_to_stop,
    steering_along,
    way_of_going,
    way_of_stopping,
)
from rudc.safety.others import Others
from rudc.safety.prediction import ALONG, GO_ACCELERATION, GO_SPEED, LANE, bodies, following, lines
from rudc.safety.tyres import STEERS, Tyres, tyres_of
from rudc.vehicle import EgoVehicle
from rudc.world.borders import leaves_road
from rudc.world.ego import DRY, GRAVITY
from rudc.world.kernels import slip_of
from rudc.world.scene import STILL, Scene

HORIZON = 2.5
"""s, how far ahead manoeuvres are predicted: as long as full braking from 15 m/s, or until the ego stands"""
CREEPING = 1e-3
"""m of negative room that are tolerated"""
STILL_MARGIN = 0.15
"""m, largest margin towards those who stand still: more would close gaps that are just wide enough"""
ALIKE = 0.1
"""m of room: of manoeuvres that hit somebody, those that differ by less count as equally bad"""
AS_GOOD = 0.01
"""m/s2, an acceleration closer than this to full braking counts as full braking"""
BENDS, DRY_BENDS = 0.8, 0.6 * DRY * GRAVITY
"""share of what brakes may use, that bends may use on a poor road; m/s2 that they may use on a dry one, about
what a driver lets them who expects it to become poor (rudc/agents/adaptation.py)"""
HARDEST = -9.0
"""m/s2, hardest braking that is assumed of whoever leads the ego: what a good car can on a dry road"""
GENTLY = 0.4
"""share of the ego's hardest braking: others are expected to brake as hard as this for an ego in their way"""
SPEEDS_UP_S = 2.0
"""s, for which somebody who speeds up now is predicted to go on doing so"""
SOON_S = 0.6
"""s, how far ahead a stop with the steering held is looked at for the road's edge"""
COMING_S = 6.0
"""s, how far ahead those are looked for who would come upon an ego that stops in their way"""
SPARE_S = 0.5
"""s, by which an ego that goes on before them must be out of their way, if they keep their speed"""
GOES_ON_S = 0.5, 1.0, 1.5, 2.0
"""s, for which an ego goes on before it stops, where it cannot go on for longer: behind its leader"""
TIGHT = 0.5
"""share of the margin that is enough where the ego would be hit if it stopped"""
CHANGING = 0.5
"""m/s2, whoever brakes or speeds up by more is also predicted to go on doing so"""

Poses = tuple[Complex, Complex]
"""(T,) m and (T,): positions and directions of the ego at the instants of the predictions"""


class Instead(NamedTuple):
    """What is done instead of an action."""

    u: Array
    """(2,) m/s2 and rad, the action"""
    onwards: bool
    """whether the ego goes on; else it brakes fully"""
    hit: Index
    """indices of the others that are the reason: they would be hit, or would hit the ego"""


class LastResort:
    """Judges actions, and replaces those that would end in hitting somebody."""

    def __init__(self, config: FilterConfig) -> None:
        self._dt, self._margin = config.dt, config.last_resort_margin
        self._tyres: Tyres
        self._usual = self._times = self._until(HORIZON)
        """(T,) s, instants of the predictions: on a dry road, and in the present scene"""

    def instead_of(self, scene: Scene, u: Array) -> Instead | None:
        """What to do instead of `u` (2,), m/s2 and rad, if `u` would end in hitting somebody and something
        else is better. None if `u` is taken.
        """
        body = scene.vehicle
        self._tyres = tyres_of(scene)
        late = scene.lag_s * (max(scene.ego.acceleration, body.a_max) - body.a_min)
        fastest = scene.ego.v + body.a_max * self._dt + late  # m/s, from which prompt brakes take as long
        stopping = self._dt + fastest / self._tyres.least
        self._times = self._usual if stopping <= HORIZON else self._until(stopping)
        made = self._tyres.made_of(u, scene.ego.v)
        first, v, a = self._first(scene, float(made[0]))
        if self._room_to_stop(scene, first, v, a, made) >= -CREEPING:
            return None
        way = self._go(scene, first, v)
        others = self._others(scene, float(way[-1]))
        stops = self._stops(scene, others, made)
        going = self._room(scene, others, *self._along(scene, made, way, self._tyres.grip))
        room = np.concatenate([stops, np.where(others.still, stops, going)])
        kept = ~np.isin(others.who, self._behind(scene, np.unique(others.who)))
        best = room[:, kept].min(axis=1, initial=np.inf).max()
        if best >= -CREEPING:
            return None
        braking, at_once, stop = self._brake(scene, others, kept, float(u[1]))
        struck = self._struck(scene, others, kept & (at_once < -self._margin), stop)
        onwards = np.array([scene.vehicle.a_max, steering(scene)])
        if len(struck) and self._may_take(scene, onwards):
            return Instead(onwards, True, struck)
        if u[0] < scene.vehicle.a_min + AS_GOOD and braking[1] == u[1]:
            return None
        still = others.still & kept
        unmoved = stops[:, still].min(axis=1, initial=np.inf).max()
        if not self._better(at_once[kept].min(), best) and (
            unmoved >= -CREEPING or not self._better(at_once[still].min(), unmoved)
        ):
            return None
        hit = np.unique(others.who[kept & (np.minimum(stops.max(axis=0), going) < -CREEPING)])
        return Instead(braking, False, hit)

    def would_block(self, scene: Scene, braking: Array, going: Array) -> Index:
        """Indices of those who move and within COMING_S would come upon an ego that stops after the action
        `braking` (2,), m/s2 and rad, but would not meet one that takes the action `going` (2,) and goes on,
        or goes on and then stops. Whoever could still stop gently for an ego that stops with the steering
        held must also miss one that goes on if it came SPARE_S earlier, at its present speed. Empty if one
        that goes on would meet any of them, or anybody else within HORIZON, or if `going` would not be taken.
        """
        self._times, self._tyres = self._until(COMING_S), tyres_of(scene)
        first, v, _ = self._first(scene, float(going[0]))
        way = self._go(scene, first, v)
        others = self._others(scene, float(way[-1]))
        stops = self._stops(scene, others, braking).max(axis=0)
        kept = ~np.isin(others.who, self._behind(scene, np.unique(others.who)))
        who = np.unique(others.who[kept & ~others.still & (stops < -CREEPING)])
        if not len(who):
            return who
        early = np.setdiff1d(who, self._late(scene, others, who, self._held(scene, braking)))
        hits = np.isin(others.who, others.who[~others.still & (stops < -self._margin)])
        spared = others.during(slice(round(SPARE_S / self._dt), None))
        avoided = (
            (others, np.isin(others.who, who)),
            (spared, np.isin(others.who, early) & others.steady),
            (others.during(slice(len(self._usual))), kept),
        )
        ways = way, *(self._ended(way, end_s) for end_s in reversed(GOES_ON_S))
        clear = any(
            self._is_clear(scene, avoided, hits, self._along(scene, going, w, self._tyres.grip)) for w in ways
        )
        return who if clear and self.instead_of(scene, going) is None else who[:0]

    def _is_clear(
        self, scene: Scene, avoided: tuple[tuple[Others, Flags], ...], tight: Flags, way: Poses
    ) -> bool:
        """Whether an ego on its `way` keeps clear of those that are flagged, for as long as they are
        predicted, with a TIGHT margin where `tight` (m,)."""
        place, facing = way
        for others, flags in avoided:
            end = others.place.shape[1]
            for share, rows in ((1.0, flags & ~tight), (TIGHT, flags & tight)):
                if rows.any():
                    room = self._room(scene, others, place[:end], facing[:end], share * self._margin)
                    if (room[rows] < -CREEPING).any():
                        return False
        return True

    def _ended(self, way: Array, end_s: float) -> Array:
        """(T,) m driven as `way` (T,) until `end_s`, and then braking fully."""
        k, brakes = max(round(end_s / self._dt), 1), self._tyres.least
        v = (way[k] - way[k - 1]) / self._dt
        since = np.clip(self._times - self._times[k], 0.0, v / brakes)
        return np.where(self._times <= self._times[k], way, way[k] + v * since - 0.5 * brakes * since**2)

    def _until(self, end_s: float) -> Array:
        """(T,) s, instants from 0 to `end_s` or the first one after it."""
        steps = max(math.ceil(end_s / self._dt - 1e-9), 1)
        return np.linspace(0.0, steps * self._dt, steps + 1)

    def _better(self, braking: float, room: float) -> bool:
        """Whether full braking, with room of `braking` m, is better than what has `room` m."""
        return braking > (room - ALIKE if room < -self._margin else room)

    def _struck(self, scene: Scene, others: Others, hit: Flags, stop: Poses) -> Index:
        """Indices of the others that move and, by every prediction of them, `hit` (m,) an ego on its way
        `stop` before they could stop gently.
        """
        hit = hit & ~others.still
        who = np.setdiff1d(others.who[hit], others.who[~hit])
        return self._late(scene, others, who, stop)

    def _late(self, scene: Scene, others: Others, who: Index, stop: Poses) -> Index:
        """Those of `who` that meet an ego on its way `stop` before they could stop gently."""
        late = [i for i in who.tolist() if self._is_late(scene, others, i, *stop)]
        return np.array(late, dtype=np.int64)

    def _is_late(self, scene: Scene, others: Others, i: int, place: Complex, facing: Complex) -> bool:
        """Whether i meets an ego at `place` (T,) m facing `facing` (T,) too soon to stop gently. At v m/s it
        has v t m until it meets the ego after t s, and stopping with a m/s2 takes v^2 / (2 a): t < v / (2 a).
        """
        speed = float(np.hypot(*scene.velocity[i]))
        soon = self._times <= speed / (2.0 * GENTLY * -scene.vehicle.a_min)
        its = others.who == i
        until = Others(
            others.who[its], others.place[its][:, soon], others.facing[its][:, soon],
            others.half[its], others.still[its],
        )  # fmt: skip
        return bool((self._room(scene, until, place[soon], facing[soon]) < -self._margin).any())

    def _may_take(self, scene: Scene, onwards: Array) -> bool:
        """Whether the action `onwards` (2,), m/s2 and rad, and going on like that leaves room towards
        everybody but those who drive behind, and the ego can still stop before those who stand still.
        """
        first, v, _ = self._first(scene, float(onwards[0]))
        way = self._go(scene, first, v, float(onwards[0]))
        others = self._others(scene, float(way[-1]))
        room = self._room(scene, others, *self._along(scene, onwards, way, self._tyres.grip))
        if others.still.any():
            stops = self._stops(scene, others, onwards).max(axis=0)
            room = np.where(others.still, np.minimum(room, stops), room)
        near = others.who[room < -CREEPING]
        return bool(np.isin(near, self._behind(scene, near)).all())

    def _stops(self, scene: Scene, others: Others, u: Array) -> Array:
        """(2, m) m, room of stopping after `u` with the steering held, and along the route."""
        stops = self._held(scene, u), self._stop_along(scene, u)
        return np.stack([self._room(scene, others, *stop) for stop in stops])

    def _brake(self, scene: Scene, others: Others, kept: Flags, delta: float) -> tuple[Array, Array, Poses]:
        """(2,) m/s2 and rad, full braking, (m,) m its room, and where the ego is then. It steers at `delta`
        rad, as the wheels are now or along the route: whichever has most room. If all hit somebody, one that
        stays on the road comes first.
        """
        angles = delta, scene.ego.steering, steering(scene)
        firm = [self._tyres.firm(angle, scene.ego.v) for angle in angles]
        actions = [np.array([scene.vehicle.a_min, angle]) for angle in firm]
        stops = [*(self._held(scene, u) for u in actions[:2]), self._stop_along(scene, actions[2])]
        rooms = [self._room(scene, others, *stop) for stop in stops]
        least = [float(room[kept].min()) for room in rooms]
        stays = [True] * len(stops)
        if max(least) < -CREEPING:
            soon = slice(int((self._times <= SOON_S).sum()))
            stays = [*(not leaves_road(scene, at[soon], facing[soon]) for at, facing in stops[:2]), True]
        k = max(range(len(stops)), key=lambda k: (stays[k], least[k]))
        return actions[k], rooms[k], stops[k]

    def _behind(self, scene: Scene, who: Index) -> Index:
        """Those of `who` that drive behind the ego."""
        return who[following(scene, who)]

    def _others(self, scene: Scene, way: float) -> Others:
        """Those whom the ego might meet on a way of `way` m."""
        return Others(*in_reach(*self._around(scene, way)))

    def _around(self, scene: Scene, way: float) -> tuple[Any, ...]:
        """The arguments of `in_reach` for a way of `way` m."""
        body, ego = scene.vehicle, scene.ego
        reach = way + 0.5 * (body.length + body.width) + self._margin
        return (
            *bodies(scene), scene.acceleration, *lines(scene),
            complex(ego.x, ego.y), reach, self._times, CHANGING, SPEEDS_UP_S,
            scene.route.path.poses, scene.ego_s, LANE, ALONG, HARDEST, STILL,
        )  # fmt: skip

    def _room_to_stop(self, scene: Scene, first: float, v: float, a: float, u: Array) -> float:
        """m, least room of `_stop` under `u`, which drives `first` m in the first step, and v m/s and an
        acceleration of a m/s2 after it; inf if nobody comes near.
        """
        body = scene.vehicle
        firm, brakes = self._tyres.stop(float(u[1]), v)
        fastest = v + scene.lag_s * max(a + brakes, 0.0)  # m/s, from which prompt brakes take as far
        return room_to_stop(
            *self._around(scene, first + fastest * fastest / (2.0 * brakes)),
            scene.ego.psi, self._dt, first, v, brakes, a, scene.lag_s, _slip(body, float(u[1])),
            _slip(body, firm), body.cg_to_rear, 0.5 * body.length, 0.5 * body.width,
            self._margin, STILL_MARGIN,
        )  # fmt: skip

    def _room(
        self, scene: Scene, others: Others, place: Complex, facing: Complex, margin: float | None = None
    ) -> Array:
        """(m,) m, room that an ego at `place` (T,) m facing `facing` (T,) has towards each; inf if it does
        not come near. `margin`: m, else last_resort_margin."""
        body, margin = scene.vehicle, self._margin if margin is None else margin
        return room_left(
            others.place, others.facing, others.half, others.still, place, facing,
            0.5 * body.length, 0.5 * body.width, margin, STILL_MARGIN,
        )  # fmt: skip

    def _held(self, scene: Scene, u: Array) -> Poses:
        """(T,) m and (T,): the ego's position and direction, under `u` for a step, then braking on an arc."""
        ego, body = scene.ego, scene.vehicle
        first, v, then = self._first(scene, float(u[0]))
        firm, brakes = self._tyres.stop(float(u[1]), v)
        way = way_of_stopping(self._times, self._dt, first, v, brakes, then, scene.lag_s)
        slips = _slip(body, float(u[1])), _slip(body, firm)
        return on_arc(complex(ego.x, ego.y), ego.psi, way, *slips, body.cg_to_rear)

    def _stop_along(self, scene: Scene, u: Array) -> Poses:
        """(T,) m and (T,): as `_held`, but braking along the route."""
        first, v, then = self._first(scene, float(u[0]))
        k = int(scene.ego_s / SPACING)
        stop = first + 0.5 * v * v / self._tyres.least
        ahead = scene.route.path.curvature[k : k + 2 + int(stop / SPACING)]
        brakes = self._tyres.beside(float(np.abs(ahead).max(initial=0.0)), v)
        way = way_of_stopping(self._times, self._dt, first, v, brakes, then, scene.lag_s)
        return self._along(scene, u, way, STEERS * self._tyres.grip)

    def _along(self, scene: Scene, u: Array, way: Array, lateral: float) -> Poses:
        """(T,) m and (T,): position and direction of the ego after `way` (T,) m, with the steering of `u` for
        a step and then steering along the route, at up to `lateral` m/s2.
        """
        ego, body, path = scene.ego, scene.vehicle, scene.route.path
        slip = _slip(body, float(u[1]))
        first = on_arc(complex(ego.x, ego.y), ego.psi, way, slip, slip, body.cg_to_rear)
        return steering_along(
            path.poses, path.curvature, scene.ego_s, *first, way, self._dt,
            PREVIEW_S, *way_back_of(body), body.wheelbase, body.cg_to_rear, body.delta_max, lateral,
        )  # fmt: skip

    def _go(self, scene: Scene, first: float, v: float, a: float = GO_ACCELERATION) -> Array:
        """(T,) m driven along the route: `first` m in the first step, then at `a` m/s2 from `v` m/s, no
        faster than its bends allow.
        """
        body, path = scene.vehicle, scene.route.path
        poor = body.a_min > scene.network.vehicle.a_min
        return way_of_going(
            self._times, self._dt, first, v, min(a, body.a_max), min(GO_SPEED, body.v_max), -body.a_min,
            path.curvature, scene.ego_s, BENDS * -body.a_min if poor else DRY_BENDS,
        )  # fmt: skip

    def _first(self, scene: Scene, a: float) -> tuple[float, float, float]:
        """m driven in the first step under the command `a` m/s2, and m/s and m/s2 after it."""
        return lagging_step(scene.ego.v, scene.ego.acceleration, a, scene.lag_s, self._dt)


def _slip(body: EgoVehicle, delta: float) -> float:
    """rad, slip angle of the centre of gravity with the front wheels at `delta` rad."""
    return slip_of(delta, body.wheelbase, body.cg_to_rear)
