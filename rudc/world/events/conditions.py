"""Whether an event's trigger holds: one function for each condition, named as in `rudc.scenario.triggers`."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from rudc.arrays import Array
from rudc.geometry import rectangle_gaps
from rudc.scenario.dotted import Path
from rudc.scenario.events import EVENT_KINDS
from rudc.scenario.triggers import awaited
from rudc.world.events.selection import pick
from rudc.world.scene import Scene

if TYPE_CHECKING:
    from rudc.network.network import Network, Route
    from rudc.scenario.triggers import Conditions, Somewhere, Trigger
    from rudc.world.events.stage import WorldStage

BESIDE_M = 10.0
"""m beside the ego's path, up to which the path leads past a place: as far as its road is wide"""


def holds(trigger: Trigger, scene: Scene, stage: WorldStage) -> bool:
    """Whether all conditions of a trigger hold in this scene, and one of its groups, if it has any."""

    def together(group: Conditions) -> bool:
        named = group.conditions.items()
        return all(_CONDITIONS[name](condition, scene, stage, trigger) for name, condition in named)

    return together(trigger) and (trigger.any is None or any(map(together, trigger.any)))


def each_holds(trigger: Trigger, scene: Scene, stage: WorldStage) -> dict[Path, bool]:
    """Where each condition of a trigger stands in `when` -> whether it holds in this scene, by itself. The
    episode's numbers by chance stay as they are.
    """
    drawn = stage.rng.bit_generator.state
    found = {
        (*place, name): _CONDITIONS[name](condition, scene, stage, trigger)
        for place, group in trigger.groups.items()
        for name, condition in group.conditions.items()
    }
    stage.rng.bit_generator.state = drawn
    return found


def _simulation_time(condition: Any, scene: Scene, stage: WorldStage, trigger: Trigger) -> bool:
    return condition.holds(scene.time_s)


def _traveled_distance(condition: Any, scene: Scene, stage: WorldStage, trigger: Trigger) -> bool:
    return condition.holds(scene.ego_s - stage.start_s)


def _speed(condition: Any, scene: Scene, stage: WorldStage, trigger: Trigger) -> bool:
    if condition.vehicle is None:
        return condition.holds(scene.ego.v)
    return any(condition.holds(float(v)) for v in scene.speed[_whom(condition, scene, stage, trigger)])


def _stand_still(condition: Any, scene: Scene, stage: WorldStage, trigger: Trigger) -> bool:
    return condition.holds(scene.waited_s)


def _ego_distance_to_junction(condition: Any, scene: Scene, stage: WorldStage, trigger: Trigger) -> bool:
    return condition.holds(scene.route.stop_line_s - scene.ego_s - 0.5 * scene.vehicle.length)


def _ego_distance_to_place(condition: Any, scene: Scene, stage: WorldStage, trigger: Trigger) -> bool:
    way = way_to(condition, scene.network, scene.route, float)
    return way is not None and condition.holds(way - scene.front_s)


def _reach_position(condition: Any, scene: Scene, stage: WorldStage, trigger: Trigger) -> bool:
    x, y = _where(condition, scene.network, scene.route, float)
    if condition.vehicle is None:
        return math.hypot(scene.ego.x - x, scene.ego.y - y) < float(condition.tolerance)
    away = scene.position[_whom(condition, scene, stage, trigger)] - (x, y)
    return bool((np.hypot(away[:, 0], away[:, 1]) < float(condition.tolerance)).any())


def _event_state(condition: Any, scene: Scene, stage: WorldStage, trigger: Trigger) -> bool:
    since_s = stage.reached.get((int(float(condition.event)), condition.state), math.inf)
    return condition.holds(stage.time_s - since_s)


def _relative_distance(condition: Any, scene: Scene, stage: WorldStage, trigger: Trigger) -> bool:
    rows = _whom(condition, scene, stage, trigger)
    away = np.hypot(*(scene.position[rows] - (scene.ego.x, scene.ego.y)).T)
    if condition.event is not None and len(away):
        return condition.holds(float(away.min()))
    return any(condition.holds(float(distance)) for distance in away)


def _time_headway(condition: Any, scene: Scene, stage: WorldStage, trigger: Trigger) -> bool:
    gaps = _gaps(scene, _whom(condition, scene, stage, trigger))
    return any(condition.holds(float(gap) / max(scene.ego.v, 1e-6)) for gap in gaps)


def _time_to_collision(condition: Any, scene: Scene, stage: WorldStage, trigger: Trigger) -> bool:
    """Uses the gap divided by the speed at which the centres approach; False if they do not approach."""
    rows = _whom(condition, scene, stage, trigger)
    ego = scene.ego
    course = ego.psi + ego.slip
    away = scene.position[rows] - (ego.x, ego.y)
    relative = scene.velocity[rows] - (ego.v * math.cos(course), ego.v * math.sin(course))
    closing = -np.einsum("ij,ij->i", away, relative) / np.maximum(np.hypot(away[:, 0], away[:, 1]), 1e-6)
    gaps = _gaps(scene, rows)
    return any(
        condition.holds(float(gap / speed)) for gap, speed in zip(gaps, closing, strict=True) if speed > 0
    )


def way_to(place: Somewhere, network: Network, route: Route, drawn: Callable[[Any], float]) -> float | None:
    """m along a route's path to a place; None where the place is more than BESIDE_M beside the path. `drawn`
    turns the numbers of the place, which may be distributions, into floats.
    """
    s, beside = route.path.project(*_where(place, network, route, drawn))
    return s if abs(beside) <= BESIDE_M else None


def _where(
    place: Somewhere, network: Network, route: Route, drawn: Callable[[Any], float]
) -> tuple[float, float]:
    """x, y (m) of a place."""
    if place.lane is not None:
        x, y, _ = network.place_on_lane(place.lane, drawn(place.at), route=route)
    else:
        x, y = network.center + [drawn(value) for value in place.position or ()]
    return float(x), float(y)


def _whom(condition: Any, scene: Scene, stage: WorldStage, trigger: Trigger) -> list[int]:
    """Rows of the SVs, or of an event's things, that a condition is about."""
    if getattr(condition, "event", None) is not None:
        number = int(float(condition.event))
        held, called = stage.held_by(number), {f"{kind}{number}" for kind in EVENT_KINDS}
        return [i for i, name in enumerate(scene.ids) if name in held or name.partition(":")[0] in called]
    if condition.vehicle != "same":
        return pick(scene, condition.vehicle, stage.rng)
    return [scene.ids.index(name) for name in stage.held_by(awaited(trigger)) if name in scene.ids]


def _gaps(scene: Scene, rows: list[int]) -> Array:
    ego, body = scene.ego, scene.vehicle
    return rectangle_gaps(
        ego.x,
        ego.y,
        ego.psi,
        body.length,
        body.width,
        scene.position[rows],
        scene.heading[rows],
        scene.size[rows],
    )


_CONDITIONS: dict[str, Callable[[Any, Scene, WorldStage, Trigger], bool]] = {
    "simulation_time": _simulation_time,
    "traveled_distance": _traveled_distance,
    "speed": _speed,
    "stand_still": _stand_still,
    "ego_distance_to_junction": _ego_distance_to_junction,
    "ego_distance_to_place": _ego_distance_to_place,
    "reach_position": _reach_position,
    "relative_distance": _relative_distance,
    "time_headway": _time_headway,
    "time_to_collision": _time_to_collision,
    "event_state": _event_state,
}
