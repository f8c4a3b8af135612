"""Sees to it that the vehicles which a scenario's events select are there when the ego starts.

An event acts on the leader, or an oncoming vehicle, when its trigger says so. Where traffic has one, nothing
is added:

    leader, follower     the next in the ego's lane, at most a few seconds away. A leader takes the ego's
                         route, so that it leads all the way; both keep their lane.
    oncoming, crossing   one that reaches its stop line about when the ego does, and crosses the ego's path.

Else one more vehicle is put on the road, besides those that the density asks for. Where the network has no
place for it (a T-junction without an opposite arm) the event waits in vain.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numpy as np

from rudc.world.events.selection import comes_from, pick, towards_junction
from rudc.world.scene import Scene
from rudc.world.spawn import entry
from rudc.world.traffic import VEHICLE_TYPES

if TYPE_CHECKING:
    from rudc.network.network import Movement
    from rudc.scenario.events import Event
    from rudc.world.events.stage import WorldStage

HEADWAY_S = (0.8, 1.6)
"""s of headway, beyond `APART_M`, at which a leader or follower is put on the road"""
APART_M = 2.0
"""m"""
NEAR_S = 3.0
"""s of headway up to which one that is there will do"""
EARLY_S, LATE_S = 1.0, 5.0
"""s before and after the ego at which an oncoming or crossing vehicle may reach its stop line"""
CLEAR_M = 12.0
"""m between the centre of a vehicle that is added and any other's"""
TRIES = 20
"""places tried for an oncoming or crossing vehicle"""


def selected(events: Iterable[Event]) -> set[str]:
    """The selectors that events and the conditions of their triggers name."""
    asked: list[Any] = [*events]
    asked += [condition for event in events if event.when for condition in event.when.conditions.values()]
    return {str(part.vehicle) for part in asked if getattr(part, "vehicle", None)}


def cast(events: Iterable[Event], scene: Scene, stage: WorldStage, rng: np.random.Generator) -> list[str]:
    """Put on the road whom the events select and traffic lacks; names of those who enter with the ego."""
    wanted, added = selected(events), []
    for selector in ("leader", "follower"):
        if selector in wanted:
            added += _in_line(scene, stage, rng, ahead=selector == "leader")
    for selector in ("oncoming", "crossing"):
        if selector in wanted and not _due(scene, selector):
            added += _towards_junction(scene, stage, rng, oncoming=selector == "oncoming")
    return added


def _in_line(scene: Scene, stage: WorldStage, rng: np.random.Generator, ahead: bool) -> list[str]:
    route, v = scene.route, scene.ego.v
    least = APART_M + HEADWAY_S[0] * v
    room = _room_ahead(scene) if ahead else scene.ego_s - 0.5 * scene.vehicle.length
    found = pick(scene, "leader" if ahead else "follower", rng)
    for row in found:
        reach = abs(route.path.project(*scene.position[row].tolist())[0] - scene.ego_s)
        gap = reach - 0.5 * (scene.vehicle.length + float(scene.size[row, 0]))
        room = min(room, gap)
        if gap < APART_M + NEAR_S * v and _can_take_part(scene, stage, row, ahead=ahead):
            if ahead:
                stage.traffic.redirect(scene.ids[row], route.origin, route.destination)
            _keep_lane(stage, scene.ids[row])
            return []
    kind = stage.traffic.draw_type()
    movement = stage.network.movement(route.origin, route.destination)
    length = VEHICLE_TYPES[kind].length
    most = min(APART_M + HEADWAY_S[1] * v, room - length - APART_M)
    if most < least:
        return []
    gap = float(rng.uniform(least, most))
    way = 0.5 * scene.vehicle.length + gap + (length if ahead else 0.0)
    place = entry(scene.network, route, scene.ego_s + way if ahead else scene.ego_s - way)
    if not stage.traffic.may_drive(kind, movement, place.lane):
        return []
    name = stage.traffic.add(movement, place, kind, v)
    _keep_lane(stage, name)
    return [name]


def _keep_lane(stage: WorldStage, name: str) -> None:
    stage.sumo.keep_lane(name)
    stage.traffic.drivers[name].keeps_lane = True


def _can_take_part(scene: Scene, stage: WorldStage, row: int, ahead: bool) -> bool:
    """Whether a neighbour is before its stop line; a leader that reaches beyond cannot change its route, nor
    can one that may not drive where the ego does.
    """
    to_stop = float(scene.network.paths.stop_s[scene.path[row]] - scene.path_s[row])
    driver, route = stage.traffic.drivers[scene.ids[row]], scene.route
    same = (driver.origin, driver.destination) == (route.origin, route.destination)
    if same or not ahead:
        return to_stop > 0.0
    may_go = stage.traffic.may_go(scene.ids[row], route.origin, route.destination)
    return may_go and to_stop > 0.5 * float(scene.size[row, 0])


def _room_ahead(scene: Scene) -> float:
    """m from the ego's front bumper to its stop line."""
    return scene.route.stop_line_s - scene.ego_s - 0.5 * scene.vehicle.length


def _arrival_s(scene: Scene) -> float:
    """s until the ego reaches its stop line at its present speed."""
    return _room_ahead(scene) / max(scene.ego.v, 1.0)


def _due(scene: Scene, selector: str) -> bool:
    """Whether one that the selector may name reaches its stop line about when the ego does."""
    due = towards_junction(scene, oncoming=selector == "oncoming") - _arrival_s(scene)
    return bool(np.any((due > -EARLY_S) & (due < LATE_S)))


def _towards_junction(scene: Scene, stage: WorldStage, rng: np.random.Generator, oncoming: bool) -> list[str]:
    network, movements = stage.network, _crossing(scene, oncoming)
    for _ in range(TRIES if movements else 0):
        movement, kind = movements[rng.integers(len(movements))], stage.traffic.draw_type()
        route = network.route(movement.origin, movement.destination)
        speed = min(stage.traffic.draw_speed(), VEHICLE_TYPES[kind].max_speed)
        to_stop = max(speed * (_arrival_s(scene) + float(rng.uniform(0.0, 0.5 * LATE_S))), 10.0)
        front = min(route.stop_line_s, max(route.stop_line_s - to_stop, VEHICLE_TYPES[kind].length + 1.0))
        x, y, _ = (float(value) for value in route.path.pose(front - 0.5 * VEHICLE_TYPES[kind].length))
        away = np.hypot(*(scene.position - (x, y)).T)
        place = entry(network, route, front)
        if away.min(initial=np.inf) > CLEAR_M and stage.traffic.may_drive(kind, movement, place.lane):
            return [stage.traffic.add(movement, place, kind, speed)]
    return []


def _crossing(scene: Scene, oncoming: bool) -> list[Movement]:
    """Movements from the opposite arm, or from those to the sides, that cross the ego's path if any do."""
    network, there = scene.network, comes_from(scene, oncoming)
    crosses = ~np.isnan(network.conflict(scene.route)[:, 0])
    found, crossing = [], []
    for movement in network.movements:
        if movement.turn != "u_turn" and there[movement.rows[0]]:
            found.append(movement)
            crossing += [movement] * bool(crosses[network.route(movement.origin, movement.destination).row])
    return crossing or found
