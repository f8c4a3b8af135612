"""Makes sure that the vehicles which a scenario's events select are on the road when the ego starts.

An event acts on the leader, or on an oncoming vehicle, for example, when its trigger holds. Nothing is added
if the traffic already has such a vehicle:

    leader, follower     the next vehicle in the ego's lane, at most a few seconds away. A leader is given the
                         ego's route, so that it leads all the way; both keep their lane. One that is added
                         is as far away as the ego's safe start asks (spawn.py).
    oncoming, crossing   a vehicle that reaches its stop line at about the same time as the ego, and crosses
                         the ego's path. One that is added comes some seconds later where others are in the
                         way.
    by a named arm       the same, though its path need not cross the ego's; nobody is added on the ego's own
                         arm. If its turn is named, too, it takes no other where its way is blocked
                         (detours.py).

Otherwise one vehicle is added, on top of those that the density asks for, where it can stop before what
stands on its lane. Where the network has no place for it (a T-junction without an opposite arm), none is
added and the event never begins; where only the road has none, it waits until traffic brings one.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from rudc.arrays import Flags
from rudc.geometry import rectangle_gaps
from rudc.scenario.selectors import ByArm
from rudc.world.events.selection import comes_from, pick, towards_junction
from rudc.world.scene import Scene
from rudc.world.spawn import ROUNDED_M, Entry, braking_of, entry, safe_gap
from rudc.world.vehicle_types import VEHICLE_TYPES

if TYPE_CHECKING:
    from rudc.network.network import Movement, Route
    from rudc.scenario.events import Event
    from rudc.world.events.stage import WorldStage

HEADWAY_S = (0.8, 1.6)
"""s, least and greatest headway, in addition to `APART_M`, at which a leader or follower is added"""
APART_M = 2.0
"""m, the part of the gap to a leader or follower that does not depend on speed"""
NEAR_S = 3.0
"""s of headway, in addition to `APART_M`, up to which a vehicle of the traffic serves as leader or follower,
at the ego's pace (`_pace`)"""
EARLY_S, LATE_S = 1.0, 5.0
"""s by which a vehicle on another arm may reach its stop line before and after the ego does"""
CLEAR_M = 7.0
"""m, least gap between a vehicle that is added on another arm and any other"""
LOOK_M = 0.5
"""m between the places on a lane at which it is tested whether something stands there"""
TRIES = 20
"""how many places are tried for a vehicle on another arm, as many farther away if all are taken, and how many
kinds for a leader or follower"""


class _Placed(NamedTuple):
    """A vehicle that was added on another arm than the ego's."""

    name: str
    movement: Movement
    type: str
    """car, truck, ..."""
    body: tuple[float, ...]
    """x, y (m), heading (rad), length and width (m)"""


def selected(events: Iterable[Event]) -> list[str | ByArm]:
    """The selectors that are named by events and by the conditions of their triggers, each once."""
    asked: list[Any] = [*events]
    for group in (group for event in events if event.when for group in event.when.groups.values()):
        asked += group.conditions.values()
    named = (getattr(part, "vehicle", None) for part in asked)
    return [*dict.fromkeys(who for who in named if isinstance(who, str | ByArm))]


def cast(events: Iterable[Event], scene: Scene, stage: WorldStage, rng: np.random.Generator) -> list[str]:
    """Add the vehicles that the events select and the traffic lacks. Returns their names; they enter the road
    together with the ego.
    """
    wanted, added = selected(events), []
    for selector in ("leader", "follower"):
        if selector in wanted:
            added += _in_line(scene, stage, rng, ahead=selector == "leader")
    by_arm = sorted(
        (who for who in wanted if isinstance(who, ByArm)),
        key=lambda who: (who.turn is None) + (who.type is None),  # who is most particular comes first
    )
    placed: list[_Placed] = []
    for selector in (*by_arm, *(who for who in ("oncoming", "crossing") if who in wanted)):
        there, type_ = comes_from(scene, selector), _type(selector)
        serves = there if isinstance(selector, ByArm) else there & _crosses(scene)
        fit = [one for one in placed if serves[_row(scene, one.movement)] and type_ in (None, one.type)]
        if not fit and not _due(scene, stage, selector):
            placed += _towards_junction(scene, stage, rng, selector, placed)
        if isinstance(selector, ByArm) and selector.turn:
            names = [scene.ids[i] for i in np.flatnonzero(scene.path >= 0) if there[scene.path[i]]]
            for name in (*names, *(one.name for one in placed if there[_row(scene, one.movement)])):
                stage.traffic.drivers[name].keeps_turn = True
    return [*added, *(one.name for one in placed)]


def _in_line(scene: Scene, stage: WorldStage, rng: np.random.Generator, ahead: bool) -> list[str]:
    route, v = scene.route, scene.ego.v
    least = APART_M + HEADWAY_S[0] * v
    half = 0.5 * scene.vehicle.length
    if ahead:
        stop = safe_gap(v, 0.0, braking_of(scene, ego=True))
        room = _room_ahead(scene)
        room = min(room, _free_way(stage, route, scene.ego_s + half, room + stop) - stop)
    else:
        room = scene.ego_s - half
        room = min(room, _free_way(stage, route, scene.ego_s - half, -room))
    found = pick(scene, "leader" if ahead else "follower", rng)
    for row in found:
        reach = abs(route.path.project(*scene.position[row].tolist())[0] - scene.ego_s)
        gap = reach - 0.5 * (scene.vehicle.length + float(scene.size[row, 0]))
        room = min(room, gap)
        if gap < APART_M + NEAR_S * _pace(scene) and _can_take_part(scene, stage, row, ahead=ahead):
            if ahead:
                stage.traffic.redirect(scene.ids[row], route.origin, route.destination)
            _keep_lane(stage, scene.ids[row])
            return []
    movement = stage.network.movement(route.origin, route.destination)
    for _ in range(TRIES):
        kind = stage.traffic.draw_type()
        widest = room - VEHICLE_TYPES[kind].length - APART_M
        most = min(APART_M + HEADWAY_S[1] * v, widest)
        if most < least:
            return []
        gap = float(rng.uniform(least, most))
        place = _place_in_line(scene, gap, VEHICLE_TYPES[kind].length, ahead)
        if stage.traffic.may_drive(kind, movement, place.lane):
            break
    else:
        return []
    driver = stage.traffic.draw_driver(movement, kind)
    speed = stage.traffic.entry_speed(driver, place.lane, v)
    behind, front = (v, speed) if ahead else (speed, v)
    needed = safe_gap(behind, front, braking_of(scene, ego=ahead))
    if needed > widest:
        return []
    if needed > gap:
        place = _place_in_line(scene, needed + ROUNDED_M, driver.type.length, ahead)
        slower = stage.traffic.entry_speed(driver, place.lane, v) < speed
        if slower or not stage.traffic.may_drive(kind, movement, place.lane):
            return []
    name = stage.traffic.add(driver, place, v)
    _keep_lane(stage, name)
    return [name]


def _place_in_line(scene: Scene, gap: float, length: float, ahead: bool) -> Entry:
    """Where a vehicle of a length (m) enters `gap` m before or behind the ego."""
    way = 0.5 * scene.vehicle.length + gap + (length if ahead else 0.0)
    return entry(scene.network, scene.route, scene.ego_s + way if ahead else scene.ego_s - way)


def _keep_lane(stage: WorldStage, name: str) -> None:
    stage.sumo.hold_lane(name)
    stage.traffic.drivers[name].keeps_lane = True


def _can_take_part(scene: Scene, stage: WorldStage, row: int, ahead: bool) -> bool:
    """Whether a neighbour in the ego's lane can be its leader or follower: its centre must be before its stop
    line. A leader with another route must take the ego's: its front must be before the stop line, too, and
    the ego's route must be open to its kind of vehicle.
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
    """s until the ego reaches its stop line at its pace."""
    return _room_ahead(scene) / _pace(scene)


def _pace(scene: Scene) -> float:
    """m/s, the ego's present speed, taken as at least half the limit: a slower one speeds up."""
    return max(scene.ego.v, 0.5 * scene.route.speed_limit)


def _due(scene: Scene, stage: WorldStage, selector: str | ByArm) -> bool:
    """Whether a vehicle that the selector can name reaches its stop line at about the ego's time. If one that
    is added would cross the ego's path, only those count that do.
    """
    due = towards_junction(scene, selector) - _arrival_s(scene)
    soon, crosses = (due > -EARLY_S) & (due < LATE_S), _crosses(scene)
    added = _crossing(scene, stage, selector)  # all of them cross the ego's path, or none
    if added and crosses[_row(scene, added[0])]:
        soon &= crosses[scene.path]
    return bool(soon.any())


def _towards_junction(
    scene: Scene, stage: WorldStage, rng: np.random.Generator, selector: str | ByArm, placed: list[_Placed]
) -> list[_Placed]:
    """Add one vehicle that comes as the selector says, if there is a place for it."""
    network, movements = stage.network, _crossing(scene, stage, selector)
    bodies = [one.body for one in placed]
    others = np.column_stack([scene.position, scene.heading, scene.size])
    others = np.concatenate([others, np.array(bodies).reshape(-1, 5)])
    for k in range(2 * TRIES if movements else 0):
        late = (0.0, 0.5 * LATE_S) if k < TRIES else (0.5 * LATE_S, 2.0 * LATE_S)
        movement = movements[rng.integers(len(movements))]
        kind = _type(selector) or stage.traffic.draw_type()
        route = network.route(movement.origin, movement.destination)
        speed = min(stage.traffic.draw_speed(), VEHICLE_TYPES[kind].max_speed)
        to_stop = max(speed * (_arrival_s(scene) + float(rng.uniform(*late))), 10.0)
        front = min(route.stop_line_s, max(route.stop_line_s - to_stop, VEHICLE_TYPES[kind].length + 1.0))
        length, width = VEHICLE_TYPES[kind].length, VEHICLE_TYPES[kind].width
        x, y, psi = (float(value) for value in route.path.pose(front - 0.5 * length))
        gaps = rectangle_gaps(x, y, psi, length, width, others[:, :2], others[:, 2], others[:, 3:])
        clear = (gaps > CLEAR_M).all()
        clear = (
            clear
            and _free_way(stage, route, front, safe_gap(speed, 0.0, braking_of(scene, ego=False))) == np.inf
        )
        place = entry(network, route, front)
        if clear and stage.traffic.may_drive(kind, movement, place.lane):
            name = stage.traffic.add(stage.traffic.draw_driver(movement, kind), place, speed)
            return [_Placed(name, movement, kind, (x, y, psi, length, width))]
    return []


def _free_way(stage: WorldStage, route: Route, s: float, way: float) -> float:
    """m from s m of a route's path on, at most `way` m (back if negative), to what stands there and leaves a
    vehicle too little room; inf if nothing does.
    """
    away = np.arange(0.0, abs(way), LOOK_M)
    x, y, psi = route.path.pose(s + np.copysign(away, way))
    places, slices = np.column_stack([x, y]), np.tile((LOOK_M, 2.0 * stage.traffic.needs_m), (len(away), 1))
    free = np.inf
    for prop in stage.props:
        if not prop.moves:
            gaps = rectangle_gaps(*prop.pose(), prop.length, prop.width, places, psi, slices)
            free = min(free, away[gaps <= 0.0].min(initial=np.inf))
    return float(free)


def _crossing(scene: Scene, stage: WorldStage, selector: str | ByArm) -> list[Movement]:
    """Movements of those that come as the selector says (`comes_from`), on other arms than the ego's: those
    with a turn that the traffic takes, if there are any; of these those that cross the ego's path, or all of
    them if none does.
    """
    there, crosses = comes_from(scene, selector), _crosses(scene)
    found = [
        movement for movement in scene.network.onward
        if there[movement.rows[0]] and movement.origin != scene.route.origin
    ]  # fmt: skip
    found = [movement for movement in found if stage.traffic.takes(movement)] or found
    return [movement for movement in found if crosses[_row(scene, movement)]] or found


def _type(selector: str | ByArm) -> str | None:
    """What a vehicle must be for a selector, if it says so: car, truck, ..."""
    return selector.type if isinstance(selector, ByArm) else None


def _crosses(scene: Scene) -> Flags:
    """(P,) which paths cross the ego's."""
    return ~np.isnan(scene.network.conflict(scene.route)[:, 0])


def _row(scene: Scene, movement: Movement) -> int:
    """Which path a vehicle that is added for a movement takes."""
    return scene.network.route(movement.origin, movement.destination).row
