"""`WorldStage`: carries out what events do, on SUMO's traffic, the ego's plant and the ego's sensors."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from rudc.arrays import Array
from rudc.errors import SimulationError
from rudc.geometry import rectangle_corners, rectangle_gaps
from rudc.network.polyline import arc_length
from rudc.scenario.events.stage import Body, Halt, Size, XYHeading
from rudc.world.ego import DRY, GRAVITY, grip_of
from rudc.world.events.patches import Patches
from rudc.world.events.places import (
    ON_THE_ROAD,
    NetworkStage,
    Standing,
    overlapped,
    patch_along_lane,
    reaches_onto_road,
    said,
    size_of,
)
from rudc.world.events.selection import pick
from rudc.world.events.sudden import AHEAD_S, LOOK_M, way_to_stop, would_meet, would_touch
from rudc.world.passing import Obstructed
from rudc.world.props import BRAKING, LATE_S, Prop, gaps_to_ways, standing, stopping_way
from rudc.world.scene import Kind, Scene

if TYPE_CHECKING:
    from rudc.network.network import Network, Route
    from rudc.network.road import Lane
    from rudc.scenario.selectors import Selector
    from rudc.world.brakes import Brakes
    from rudc.world.ego import EgoPlant
    from rudc.world.perception import Sensors
    from rudc.world.sumo import Sumo
    from rudc.world.traffic import Traffic

BLOCK = "block"
"""beginning of the names of stand-ins: vehicles that SUMO has in place of things that block a lane"""
JOINED_M = 0.5
"""m, largest gap between pieces of one event that close a lane together"""
OUTLINE_M = 0.05
"""m within its outline, from which on an opaque thing hides what is behind: its own corners stay in sight"""


@dataclass(slots=True)
class WorldStage(NetworkStage):
    """The parts of one episode's world that events act on."""

    sumo: Sumo
    network: Network
    traffic: Traffic
    brakes: Brakes
    plant: EgoPlant
    route: Route
    rng: np.random.Generator
    sensors: Sensors
    decision_s: float
    start_s: float
    """m, arc length on its path at which the ego starts"""
    scene: Scene | None = None
    """the scene as it really is; None before there is traffic"""
    props: list[Prop] = field(default_factory=list)
    unlawful: set[str] = field(default_factory=set)
    sudden: dict[str, float] = field(default_factory=dict)
    """name of what was put or sent so near before the ego that the ego could only meet it -> s up to which
    this counts; empty again once the ego has stood
    """
    no_room: bool = False
    """whether an event has found no room on the road since this was last set to False"""
    reached: dict[tuple[int, str], float] = field(default_factory=dict)
    """number of an event in keys, and `begun` or `over` -> s, when it was so first"""
    patches: Patches = field(default_factory=Patches)
    road_friction: float | None = None
    """coefficient of friction of the road beside the patches; None if it is dry"""
    taken: dict[int, frozenset[str]] = field(default_factory=dict)
    """number of an event in keys -> names of the vehicles of which it has taken hold"""
    obstructed: Obstructed = field(init=False)
    """the lanes that things obstruct"""
    for_now: dict[str, float] = field(default_factory=dict)
    """name of a thing that stands on the road and will be taken away -> s, how long it stands"""
    _asked: dict[tuple[str, str], dict[str, float]] = field(default_factory=dict)
    """(`speed`, `factor` or `density`; name of the vehicle) -> the value that each event asks for which is
    not over, by the event's name; the latest is the last
    """
    _slowed: dict[str, tuple[float, float]] = field(default_factory=dict)
    """name of a vehicle -> when events last slowed it down (s), and to what speed (m/s)"""
    _stand_ins: dict[str, list[str]] = field(default_factory=dict)
    """names of each event's stand-ins in SUMO"""
    _boxes: dict[str, list[tuple[float, ...]]] = field(default_factory=dict)
    """each event's opaque boxes: centre x, y (m), heading (rad), length, width (m)"""
    _blocks: int = 0
    _closed: dict[tuple[str, str], tuple[str, float, float]] = field(default_factory=dict)
    """(event, lane) -> the stand-in put there last, and from where to where (m) it closes the lane"""

    def __post_init__(self) -> None:
        self.obstructed = Obstructed(self.network, self.traffic)

    # ---- time and vehicles

    @property
    def time_s(self) -> float:
        return self.scene.time_s if self.scene else 0.0

    @property
    def present(self) -> tuple[str, ...]:
        return self.scene.ids if self.scene else ()

    def choose(self, selector: Selector) -> list[str]:
        scene = self.scene
        return [] if scene is None else [scene.ids[i] for i in pick(scene, selector, self.rng)]

    def held_by(self, number: int | None) -> list[str]:
        taken = self.taken.get(number, frozenset()) if number is not None else frozenset()
        return [name for name in self.present if name in taken]

    def speed(self, name: str) -> float:
        assert self.scene is not None, "nothing is present before there is traffic"
        return math.hypot(*self.scene.velocity[self.scene.ids.index(name)])

    def is_inside(self, name: str) -> bool:
        scene = self.scene
        return scene is not None and name in scene.ids and bool(scene.inside[scene.ids.index(name)])

    def seize(self, name: str, *, heedless: bool = False) -> None:
        driver = self.traffic.drivers[name]
        if heedless:
            driver.heedless += 1
            self.unlawful.add(name)
        else:
            driver.overridden += 1
        self.brakes.set_mode(name)

    def release(self, name: str, *, heedless: bool = False) -> None:
        driver = self.traffic.drivers[name]
        if heedless:
            driver.heedless -= 1
            if not driver.heedless:
                self.unlawful.discard(name)
        else:
            driver.overridden -= 1
        self.brakes.set_mode(name)

    def slow_down(self, name: str, deceleration: float, least: float = 0.0) -> None:
        slower = max(self.speed(name) - min(deceleration, self.traffic.grip) * self.decision_s, least)
        when, slowest = self._slowed.get(name, (-math.inf, math.inf))
        if slower == least > 0.0:  # it has no farther to go
            deceleration = (self.speed(name) - least) / self.decision_s
        may = self.brakes.leave_to_event(name, deceleration)
        if not may or (when == self.time_s and slowest <= slower):
            return
        self._slowed[name] = self.time_s, slower
        self.sumo.slow_down(name, slower, self.decision_s)

    def set_speed_factor(self, name: str, factor: float | None, event: str = "") -> None:
        own = self.traffic.drivers[name].speed_factor
        asked = self._ask("factor", name, event, factor)
        self.sumo.personality(name, speed_factor=[own, *asked][-1])

    def set_top_speed(self, name: str, speed: float | None, event: str = "") -> None:
        own = self.traffic.drivers[name].type.max_speed
        self.sumo.personality(name, max_speed=min([own, *self._ask("speed", name, event, speed)]))

    def _ask(self, what: str, name: str, event: str, value: float | None) -> list[float]:
        """Note the value that an event asks for, None once it is over. Returns what all ask for, the latest
        last.
        """
        asked = self._asked.setdefault((what, name), {})
        asked.pop(event, None)
        if value is not None:
            asked[event] = value
        return [*asked.values()]

    @property
    def density(self) -> float:
        return self.traffic.density

    def set_density(self, density: float | None, event: str = "") -> None:
        self.traffic.density = [self.traffic.usual_density, *self._ask("density", "", event, density)][-1]

    # ---- things

    def stand(
        self, name: str, body: Body, place: XYHeading, size: Size | None = None, *, for_s: float = math.inf
    ) -> None:
        """As `Stage.stand`. Raises SimulationError if something already stands in that place.

        On a lane of an arm or of a roundabout's ring, a stand-in makes SVs queue behind it or change lanes.
        Inside a node only the yielding layer makes SVs see it.
        """
        x, y, heading = place
        length, width = size or size_of(body)
        new = Standing(name, body, place, (length, width))
        for other in overlapped(new, [_as_standing(prop) for prop in self.props if not prop.moves]):
            raise SimulationError(
                f"{other.name} and {name} (kind, number in `events`, and the thing's, all from 0) would "
                f"overlap or touch, {said(self.network, place)}; move one of them"
            )
        self.props.append(standing(name, Kind[body.upper()], x, y, heading, length, width))
        if for_s < math.inf:
            self.for_now[name] = for_s
        if self.scene is not None and self._too_near(place, (length, width)):
            self.sudden[name] = math.inf
        corners = rectangle_corners(np.array([x, y]), np.array(heading), np.array([length, width]))
        for lane, start, end in self.obstructed.add(name, corners):
            self.traffic.reserve(lane.id, start, end)
            if name not in self.obstructed.passable:
                self._block(name, lane, start, end)

    def is_free(
        self, body: Body, place: XYHeading, size: Size | None = None, *, for_ego: bool = False
    ) -> bool:
        if self.scene is None:
            return True
        stand = {prop.name for prop in self.props if not prop.moves}
        rows = np.array([i for i, name in enumerate(self.scene.ids) if name not in stand], dtype=int)
        length, width = size or size_of(body)
        way = stopping_way(self.scene, LATE_S, min(BRAKING, self.traffic.grip))[rows]
        free = bool((gaps_to_ways(self.scene, rows, way, (*place, length, width)) > 0.0).all())
        free = free and self._clear_of_new(place, (length, width), only_moving=True)
        free = free and not (for_ego and self._too_near(place, (length, width)))
        self.no_room |= not free
        return free

    def is_taken_for_now(self, body: Body, place: XYHeading, size: Size | None = None) -> bool:
        leave = [_as_standing(prop) for prop in self.props if prop.name in self.for_now]
        taken = bool(overlapped(Standing("", body, place, size or size_of(body)), leave))
        self.no_room |= taken
        return taken

    def _clear_of_new(self, place: XYHeading, size: Sequence[float], *, only_moving: bool) -> bool:
        """Whether a rectangle touches nothing that has appeared since the scene. `only_moving`: things that
        stand do not count.
        """
        known = set(self.scene.ids) if self.scene is not None else set[str]()
        new = [prop for prop in self.props if prop.name not in known and (prop.moves or not only_moving)]
        if not new:
            return True
        x, y, heading = np.array([prop.pose() for prop in new]).T
        sizes = np.array([(prop.length, prop.width) for prop in new])
        return bool(
            (rectangle_gaps(*place, size[0], size[1], np.column_stack([x, y]), heading, sizes) > 0.0).all()
        )

    def _block(self, name: str, lane: Lane, start: float, end: float) -> None:
        """Close a lane from start to end m for SUMO's traffic.

        A piece just before another of the same event makes that one's stand-in longer, since SUMO would let
        no vehicle enter so near to it."""
        key = name.partition(":")[0], lane.id
        before, first, last = self._closed.get(key, ("", math.inf, math.inf))
        if start < first <= end + JOINED_M:
            self.sumo.lengthen(before, last - start)
            self._closed[key] = before, start, last
            return
        stand_in = f"{BLOCK}{self._blocks}:{name}"
        self._blocks += 1
        self.sumo.block(stand_in, lane.edge, lane.index, start, end)
        self._stand_ins.setdefault(name.partition(":")[0], []).append(stand_in)
        self._closed[key] = stand_in, start, end

    def is_sudden(self, name: str) -> bool:
        """Whether an event has put or sent that so near before the ego that the ego could only meet it."""
        return self.sudden.get(name, -math.inf) >= self.time_s

    def _too_near(self, place: XYHeading, size: Size) -> bool:
        """Whether the ego, straight on or on its path, would touch what is put there even with its hardest
        braking, as road and car are now."""
        assert self.scene is not None
        way = way_to_stop(self.scene.ego.v, self._braking(), self.plant.actuation)
        return would_touch(self.scene, way, place, size)

    def _braking(self) -> float:
        """m/s2, with which the ego can brake to a stop, with the least grip that it would have meanwhile."""
        assert self.scene is not None
        braking = min(-self.network.vehicle.a_min, grip_of(self.plant.actuation))
        if not self.patches:
            return braking
        way = way_to_stop(self.scene.ego.v, braking, self.plant.actuation)
        x, y, _ = self.scene.route.path.pose(self.scene.ego_s + np.arange(0.0, way + LOOK_M, LOOK_M))
        return min(braking, self.patches.least(np.column_stack([x, y])) * GRAVITY)

    def send(
        self, name: str, body: Body, way: Array, speed: float, late_m: float = 0.0, beyond_m: float = 0.0,
        behind: Array | None = None, halt: Halt | None = None, size: Size | None = None,
    ) -> None:  # fmt: skip
        if behind is not None:
            late_m -= float(arc_length(np.vstack([behind, way[:1]]))[-1])
            way = np.vstack([behind, way])
        prop = self._prop(name, body, way, speed, size, late_m)
        prop.beyond_m, prop.may_back_out, prop.halt = beyond_m, behind is not None, halt
        self.props.append(prop)
        if self.scene is not None and would_meet(self.scene, self._braking(), self.plant.actuation, prop):
            self.sudden[name] = self.time_s + AHEAD_S

    def has_room(
        self, body: Body, way: Array, speed: float, late_m: float = 0.0, size: Size | None = None
    ) -> bool:
        if self.scene is None:
            return True
        prop = self._prop("", body, way, speed, size, late_m)
        x, y, heading, *box = prop.room()
        room = prop.has_room(self.scene) and self._clear_of_new((x, y, heading), box, only_moving=False)
        self.no_room |= not room
        return room

    def _prop(self, name: str, body: Body, way: Array, speed: float, size: Size | None, late: float) -> Prop:
        prop = Prop(name, Kind[body.upper()], size or size_of(body), way, wanted=speed)
        prop.travelled = prop.appeared_m = -late
        prop.grip, prop.look_s = self.traffic.grip, self.decision_s
        return prop

    def things_of(self, event: str) -> frozenset[str]:
        return frozenset(prop.name for prop in self.props if prop.name.startswith(f"{event}:"))

    def remove_things(self, event: str) -> None:
        gone = self.things_of(event)
        self.props = [prop for prop in self.props if prop.name not in gone]
        self.for_now = {name: s for name, s in self.for_now.items() if name not in gone}
        self.obstructed.remove(gone)
        for stand_in in self._stand_ins.pop(event, []):
            self.sumo.remove(stand_in)  # on the road, or waiting for room there

    def hide_behind(self, event: str, place: XYHeading, size: Size) -> None:
        if reaches_onto_road(self.network, place, size):
            raise SimulationError(f"an occlusion box {said(self.network, place)}: {ON_THE_ROAD}")
        self._boxes.setdefault(event, []).append((*place, *size))
        self._show_boxes()

    def hide_behind_things(self, event: str) -> None:
        names = self.things_of(event)
        for thing in (_as_standing(prop) for prop in self.props if prop.name in names):
            inner = [max(side - 2.0 * OUTLINE_M, 0.0) for side in thing.size]
            self._boxes.setdefault(event, []).append((*thing.place, *inner))
        self._show_boxes()

    def reveal(self, event: str) -> None:
        self._boxes.pop(event, None)
        self._show_boxes()

    def _show_boxes(self) -> None:
        boxes = [box for several in self._boxes.values() for box in several]
        self.sensors.occluders = np.array(boxes).reshape(-1, 5)

    # ---- the ego

    def set_noise(self, position: float, speed: float, heading: float) -> None:
        self.sensors.position_std, self.sensors.speed_std = position, speed
        self.sensors.heading_std = heading

    def set_own_noise(self, acceleration: float) -> None:
        self.sensors.own_acceleration_std = acceleration

    def set_dropout(self, probability: float, range_m: float) -> None:
        self.sensors.miss, self.sensors.range_m = probability, range_m

    def set_friction(self, friction: float | None) -> None:
        self.road_friction = friction
        self._grip()
        self.traffic.lose_grip(math.inf if friction is None else friction * GRAVITY)
        for prop in self.props:
            prop.grip = self.traffic.grip

    def lay_patch(self, event: str, lane: str, at: float, length: float, friction: float) -> None:
        self.patches.lay(event, patch_along_lane(self.network, self.route, lane, at, length), friction)
        self._grip()

    def remove_patch(self, event: str) -> None:
        self.patches.remove(event)
        self._grip()

    def feel_patches(self) -> None:
        """Give the ego's tyres the grip of the place to which it has come."""
        if self.patches:
            self._grip()

    def _grip(self) -> None:
        there, friction = self.patches.tread(self.plant.state.x, self.plant.state.y), self.road_friction
        if there < math.inf:
            friction = min(there, DRY if friction is None else friction)
        self.plant.actuation = replace(self.plant.actuation, friction=friction)

    def set_actuators(self, delay_s: float, lag_s: float) -> None:
        self.plant.actuation = replace(self.plant.actuation, delay_s=delay_s, lag_s=lag_s)


def _as_standing(prop: Prop) -> Standing:
    return Standing(prop.name, prop.kind.name.lower(), prop.pose(), (prop.length, prop.width))
