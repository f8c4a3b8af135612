"""Whether an event leaves the ego no chance: it must meet what is put or sent, whatever it does."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from rudc.arrays import Array
from rudc.geometry import gaps_between, rectangle_gaps

if TYPE_CHECKING:
    from rudc.scenario.events.stage import Size, XYHeading
    from rudc.vehicle import Actuation
    from rudc.world.props import Prop
    from rudc.world.scene import Scene

LOOK_M = 0.5
"""m between the places ahead at which it is tested whether the ego would touch a thing"""
AHEAD_S, EVERY_S = 4.0, 0.1
"""s that are looked ahead where somebody comes, and s between the instants"""


def way_to_stop(v: float, braking: float, actuation: Actuation) -> float:
    """m that an ego needs to stop from v m/s by braking at `braking` m/s2, with the car's delay and lag."""
    lag = actuation.lag_s
    late = max(v * lag - 0.5 * braking * lag**2, 0.0)  # exact unless it stops within the lag
    return v * actuation.delay_s + late + v * v / (2.0 * braking)


def would_touch(scene: Scene, way: float, place: XYHeading, size: Size) -> bool:
    """Whether the ego, straight on or on its path, would touch what stands at `place` on its next `way` m."""
    ego, car = scene.ego, scene.vehicle
    at = np.array([place[:2]]), np.array([place[2]]), np.array([size])
    for ahead in np.append(np.arange(0.0, way, LOOK_M), way).tolist():
        straight = ego.x + ahead * math.cos(ego.psi), ego.y + ahead * math.sin(ego.psi), ego.psi
        on_path = scene.route.path.pose(scene.ego_s + ahead)
        for x, y, psi in (straight, on_path):
            if rectangle_gaps(float(x), float(y), float(psi), car.length, car.width, *at)[0] <= 0.0:
                return True
    return False


def would_meet(scene: Scene, braking: float, actuation: Actuation, prop: Prop) -> bool:
    """Whether the ego on its path would meet somebody who goes on as he does, both by braking at `braking`
    m/s2, with the car's delay and lag, and by driving on as fast as now."""
    t = np.arange(0.0, AHEAD_S, EVERY_S)
    v, braked_s = scene.ego.v, np.maximum(t - actuation.delay_s - actuation.lag_s, 0.0)
    brakes = v * t - 0.5 * braking * braked_s**2
    x, y, psi = np.array([prop.pose(_gone(prop, s)) for s in t.tolist()]).T
    place, size = np.stack([x, y], axis=1), np.array([prop.length, prop.width])
    moves = max(int((braked_s * braking < v).sum()), 1)  # who comes up to an ego that stands, may stop
    first = _meets(scene, brakes[:moves], place[:moves], psi[:moves], size)
    return first and _meets(scene, v * t, place, psi, size)


def _gone(prop: Prop, s: float) -> float:
    """m that a prop goes in s seconds, if it goes on as it does, with the halt on its way."""
    way, halt = prop.wanted * s, prop.halt
    if halt is None:
        return way
    room = max(halt.after_m - (prop.travelled - prop.appeared_m), 0.0)
    return way if way < room else max(room, way - prop.wanted * halt.duration_s)


def _meets(scene: Scene, way: Array, place: Array, psi: Array, size: Array) -> bool:
    """Whether an ego that is `way` (n,) m ahead on its path touches a body at `place` (n, 2) m, `psi` (n,)
    rad at any instant."""
    car, path = scene.vehicle, scene.route.path
    x, y, heading = path.pose(scene.ego_s + way)
    x, y = x - scene.ego_offset * np.sin(heading), y + scene.ego_offset * np.cos(heading)
    own = np.array([car.length, car.width])
    return bool((gaps_between(np.stack([x, y], axis=1), heading, own, place, psi, size) <= 0.0).any())
