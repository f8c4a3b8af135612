"""The last resort: an action is only taken if the ego can still stop, or go on, without hitting anybody.

Barrier rows look one step ahead, at ellipses that leave the corners of the bodies out, and a positive slack
delta lets h rest at -delta / lambda for good. Therefore, whatever the rows have made of it, an action u is
judged by two manoeuvres that begin with it (commit or stop):

    stop   u for one step, then full braking with the steering held, and standing there; where somebody
           stands, also the same with steering along the route, for who passes close by in a bend
    go     u for one step, then on along the route at GO_ACCELERATION up to GO_SPEED, on a poor road no
           faster than its bends allow

A manoeuvre's room is the least that it leaves at any of the instants within the horizon towards anybody of

    separation - min(margin, separation now)

with last_resort_margin, towards who stands at most STILL_MARGIN

separation being the largest along the four side directions of the ego's rectangle and the other's, which
their distance is not below. Others are predicted along their paths (see `prediction`), at their present speed
and, where that changes, also braking on as they do, or speeding up for another SPEEDS_UP_S; who leads the ego
on its path also braking with HARDEST. So a manoeuvre whose room is not negative comes neither closer than the
margin to anybody nor, where it is that close already, any closer.

    u is taken         if a manoeuvre's room is not negative (towards who stands still, that of stopping)
    going on           if both are negative, somebody would hit the ego even if it braked fully (room below
                       -margin by every prediction of that one), and accelerating fully along the route leaves
                       room towards everybody
    full braking       if both are negative, and stopping at once leaves more, or at least more towards
                       those who stand still, whatever comes from elsewhere; steering as in the stop that
                       leaves more
    u is taken         otherwise

What stands still is therefore never hit, as long as it was seen in time and the vehicle does as the model:
where u was taken since it could be followed by a stop, stopping is free in the next step again. Who drives
behind the ego on its path is not looked at.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from rudc.arrays import Array, Complex, Flags, Index
from rudc.env.tracking import PREVIEW_S, RETURN_M, steering
from rudc.network.paths import SPACING
from rudc.safety.config import FilterConfig
from rudc.safety.last_resort_kernels import (
    in_reach,
    on_arc,
    room_left,
    room_to_stop,
    step_onwards,
    stop_along,
    way_of_stopping,
)
from rudc.safety.prediction import ALONG, GO_ACCELERATION, GO_SPEED, LANE, bodies, ego_ahead, following, lines
from rudc.vehicle import EgoVehicle
from rudc.world.kernels import slip_of
from rudc.world.scene import STILL, Scene

HORIZON = 2.5
"""s, how far manoeuvres are looked at, at every step: at 15 m/s full braking takes as long; on a poor road,
where it takes longer, until the ego stands"""
CREEPING = 1e-3
"""m, by which two may come closer without it counting"""
STILL_MARGIN = 0.15
"""m, margin at most towards who stands still: nobody can pass in 0.3 m less than there is"""
AS_GOOD = 0.01
"""m/s2, from full braking, which is as good"""
BENDS = 0.8
"""share of what brakes may use that bends may where the road is poor (rudc/agents/adaptation.py)"""
HARDEST = -9.0
"""m/s2, with which who leads the ego may brake: what a good car can on a dry road"""
SPEEDS_UP_S = 2.0
"""s; who sets off may speed up for that long yet"""
CHANGING = 0.5
"""m/s2, who brakes or speeds up by more is taken to go on doing so, too"""


class _Others(NamedTuple):
    """Those whom a manoeuvre might hit, m of them: some twice, for two predictions."""

    who: Index
    """(m,) indices of the scene's others"""
    place: Complex
    """(m, T) m"""
    facing: Complex
    """(m, T)"""
    half: Array
    """(m, 2) m, half lengths and half widths"""
    still: Flags
    """(m,) whether they stand still"""


class Instead(NamedTuple):
    """What is done instead of an action."""

    u: Array
    """(2,) m/s2 and rad"""
    onwards: bool
    """whether it goes on; else it is full braking"""
    hit: Index
    """indices of the scene's others for whose sake"""


class LastResort:
    """Judges actions."""

    def __init__(self, config: FilterConfig) -> None:
        self._dt, self._margin = config.dt, config.last_resort_margin
        self._usual = self._times = self._until(HORIZON)
        """(T,) s, the instants of a dry road, and of the scene at hand"""

    def instead_of(self, scene: Scene, u: Array) -> Instead | None:
        """What to do instead of `u` (2,), m/s2 and rad, where `u` would end in hitting somebody and that is
        better. None if `u` may be taken.
        """
        stopping = self._dt - (scene.ego.v + scene.vehicle.a_max * self._dt) / scene.vehicle.a_min
        self._times = self._usual if stopping <= HORIZON else self._until(stopping)
        first, v = self._first(scene.ego.v, float(u[0]))
        if self._room_to_stop(scene, first, v, u) >= -CREEPING:
            return None
        way = self._go(scene, first, v)
        others = self._others(scene, float(way[-1]))
        stops = self._stops(scene, others, u)
        going = self._room(scene, others, *ego_ahead(scene, way))
        room = np.concatenate([stops, np.where(others.still, stops, going)])
        kept = ~np.isin(others.who, self._behind(scene, others.who[(room < -CREEPING).any(axis=0)]))
        best = room[:, kept].min(axis=1, initial=np.inf).max()
        if best >= -CREEPING:
            return None
        braking, at_once = self._brake(scene, others, kept, float(u[1]))
        struck = self._struck(others, kept, at_once)
        onwards = np.array([scene.vehicle.a_max, steering(scene)])
        if len(struck) and self._may_take(scene, onwards):
            return Instead(onwards, True, struck)
        if u[0] < scene.vehicle.a_min + AS_GOOD:
            return None
        still = others.still & kept
        unmoved = stops[:, still].min(axis=1, initial=np.inf).max()
        if at_once[kept].min() <= best and (unmoved >= -CREEPING or at_once[still].min() <= unmoved):
            return None
        hit = np.unique(others.who[kept & (np.minimum(stops.max(axis=0), going) < -CREEPING)])
        return Instead(braking, False, hit)

    def _until(self, end_s: float) -> Array:
        """(T,) s, the instants up to `end_s` at least."""
        steps = max(math.ceil(end_s / self._dt - 1e-9), 1)
        return np.linspace(0.0, steps * self._dt, steps + 1)

    def _struck(self, others: _Others, kept: Flags, room: Array) -> Index:
        """Who moves and hits an ego that brakes with such a room (m,) m, whatever is predicted of it."""
        hits = kept & ~others.still & (room < -self._margin)
        return np.setdiff1d(others.who[hits], others.who[~hits])

    def _may_take(self, scene: Scene, onwards: Array) -> bool:
        """Whether going on at once like that (2,), m/s2 and rad, leaves room towards everybody but who drives
        behind, and the ego can still stop before those who stand still.
        """
        first, v = self._first(scene.ego.v, float(onwards[0]))
        way = self._go(scene, first, v, float(onwards[0]))
        others = self._others(scene, float(way[-1]))
        room = self._room(scene, others, *ego_ahead(scene, way))
        if others.still.any():
            stops = self._stops(scene, others, onwards).max(axis=0)
            room = np.where(others.still, np.minimum(room, stops), room)
        near = others.who[room < -CREEPING]
        return bool(np.isin(near, self._behind(scene, near)).all())

    def _stops(self, scene: Scene, others: _Others, u: Array) -> Array:
        """(1 or 2, m) m, room of stopping after `u` with the steering held, and, where somebody stands, of
        stopping along the route.
        """
        held = self._stop(scene, u)
        rooms = [self._room(scene, others, *held)]
        if others.still.any():
            _, v = self._first(scene.ego.v, float(u[0]))
            rooms.append(self._room(scene, others, *self._stop_along(scene, held, v)))
        return np.stack(rooms)

    def _brake(self, scene: Scene, others: _Others, kept: Flags, delta: float) -> tuple[Array, Array]:
        """(2,) full braking, and (m,) m its room: steering at `delta` rad or, where somebody stands and that
        leaves more, along the route.
        """
        ways = [delta, steering(scene)] if others.still.any() else [delta]
        actions = [np.array([scene.vehicle.a_min, way]) for way in ways]
        rooms = [self._stops(scene, others, u)[k] for k, u in enumerate(actions)]
        k = int(np.argmax([room[kept].min() for room in rooms]))
        return actions[k], rooms[k]

    def _behind(self, scene: Scene, who: Index) -> Index:
        """Those of `who` that drive behind the ego."""
        return who[following(scene, who)]

    def _others(self, scene: Scene, way: float) -> _Others:
        """Those whom the ego might meet on a way of so many m."""
        return _Others(*in_reach(*self._around(scene, way)))

    def _around(self, scene: Scene, way: float) -> tuple[Any, ...]:
        """What `in_reach` takes, for a way of so many m."""
        body, ego = scene.vehicle, scene.ego
        reach = way + 0.5 * (body.length + body.width) + self._margin
        return (
            *bodies(scene), scene.acceleration, *lines(scene),
            complex(ego.x, ego.y), reach, self._times, CHANGING, SPEEDS_UP_S,
            scene.route.path.poses, scene.ego_s, LANE, ALONG, HARDEST, STILL,
        )  # fmt: skip

    def _room_to_stop(self, scene: Scene, first: float, v: float, u: Array) -> float:
        """m, least room of `_stop`, `first` m in a step, to v m/s; inf if plenty."""
        body = scene.vehicle
        return room_to_stop(
            *self._around(scene, first + v * v / (-2.0 * body.a_min)),
            scene.ego.psi, self._dt, first, v, -body.a_min, _slip(body, float(u[1])), body.cg_to_rear,
            0.5 * body.length, 0.5 * body.width, self._margin, STILL_MARGIN,
        )  # fmt: skip

    def _room(self, scene: Scene, others: _Others, place: Complex, facing: Complex) -> Array:
        """(m,) m, room towards each of an ego at `place` (T,) m facing `facing` (T,); inf if plenty."""
        body = scene.vehicle
        return room_left(
            others.place, others.facing, others.half, others.still, place, facing,
            0.5 * body.length, 0.5 * body.width, self._margin, STILL_MARGIN,
        )  # fmt: skip

    def _stop(self, scene: Scene, u: Array) -> tuple[Complex, Complex]:
        """(T,) m and (T,): the ego on an arc, under `u` for a step and then braking."""
        ego, body = scene.ego, scene.vehicle
        first, v = self._first(ego.v, float(u[0]))
        way = way_of_stopping(self._times, self._dt, first, v, -body.a_min)
        return on_arc(complex(ego.x, ego.y), ego.psi, way, _slip(body, float(u[1])), body.cg_to_rear)

    def _stop_along(self, scene: Scene, stop: tuple[Complex, Complex], v: float) -> tuple[Complex, Complex]:
        """(T,) m and (T,): the first step of `stop`, to v m/s, and then braking while steering along the
        route.
        """
        body, path = scene.vehicle, scene.route.path
        return stop_along(
            path.poses, path.curvature, scene.ego_s, *stop, v, -body.a_min, self._dt, PREVIEW_S, RETURN_M,
            body.wheelbase, body.cg_to_rear, body.delta_max,
        )  # fmt: skip

    def _go(self, scene: Scene, first: float, v: float, a: float = GO_ACCELERATION) -> Array:
        """(T,) m along the route: `first` m in a step, then from `v` m/s on at `a` m/s2, on a poor road no
        faster than its bends allow.
        """
        if scene.vehicle.a_min > scene.network.vehicle.a_min:
            return self._go_slowly(scene, first, v, a)
        rest = np.maximum(self._times - self._dt, 0.0)
        rising = np.minimum(rest, max(GO_SPEED - v, 0.0) / a)
        way = first + v * rest + a * rising * (rest - 0.5 * rising)
        return np.where(self._times > 0.0, way, 0.0)

    def _go_slowly(self, scene: Scene, first: float, v: float, a: float) -> Array:
        """The same where the road gives less than the brakes could use."""
        path, a_min, a = scene.route.path, scene.vehicle.a_min, min(a, scene.vehicle.a_max)
        bends, way = np.abs(path.curvature), [0.0, first]
        for _ in self._times[2:]:
            station = min(int((scene.ego_s + way[-1]) / SPACING), len(bends) - 1)
            most = min(max(GO_SPEED, v), math.sqrt(BENDS * -a_min / max(float(bends[station]), 1e-4)))
            after = max(min(v + a * self._dt, most), v + a_min * self._dt, 0.0)
            way.append(way[-1] + 0.5 * (v + after) * self._dt)
            v = after
        return np.array(way)

    def _first(self, v: float, a: float) -> tuple[float, float]:
        """m travelled in the first step, and m/s after it."""
        return step_onwards(v, a, self._dt)


def _slip(body: EgoVehicle, delta: float) -> float:
    """rad, slip with the front wheels at `delta` rad."""
    return slip_of(delta, body.wheelbase, body.cg_to_rear)
