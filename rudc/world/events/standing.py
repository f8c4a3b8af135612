"""Events that put something on or beside the road: accident, stalled_vehicle, lane_closure, occlusion,
wrong_way, pedestrian_crossing."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from rudc.arrays import Array
from rudc.errors import SimulationError
from rudc.geometry import rectangle_corners
from rudc.scenario.events import (
    Accident,
    LaneClosure,
    Occlusion,
    PedestrianCrossing,
    StalledVehicle,
    WrongWay,
)
from rudc.scenario.poses import Pose
from rudc.world.events.effect import Effect, Held
from rudc.world.props import Prop, standing
from rudc.world.scene import Kind, Scene
from rudc.world.sumo import BRAKE_HARD, OWN_SPEED
from rudc.world.traffic import VEHICLE_TYPES

if TYPE_CHECKING:
    from rudc.world.events.stage import Stage

PEDESTRIAN_M = 0.5
"""m, side of the square a pedestrian takes"""
STANDS = 0.1
"""m/s, below which a stalled vehicle stands"""
STALL_DECEL = 3.0
"""m/s2, with which a stalling SV comes to a stop"""
ROADSIDE_M = 1.5
"""m beyond the road's edge where a pedestrian starts and ends"""
FOLLOWING_S = 1.2
"""s between one pedestrian and the next"""


class AccidentEffect(Effect[Accident]):
    """Stationary vehicles at any pose."""

    from_the_start = True

    def begin(self, stage: Stage, scene: Scene | None) -> bool:
        for i, placement in enumerate(self.event.vehicles):
            x, y, heading = _pose(stage, placement)
            body = VEHICLE_TYPES[placement.type]
            stage.add_obstacle(
                standing(f"{self.name}:{i}", body.kind, x, y, heading, body.length, body.width)
            )
        return True


class StalledVehicleEffect(Held[StalledVehicle]):
    """A vehicle that stands on a lane, or an SV that stops; the duration counts from standstill."""

    _stands_since: float | None = None

    @property
    def from_the_start(self) -> bool:  # pyright: ignore[reportIncompatibleVariableOverride] - depends on the event
        return self.event.lane is not None

    def begin(self, stage: Stage, scene: Scene | None) -> bool:
        if self.event.lane is None or self.event.at is None:
            return super().begin(stage, scene)
        body = VEHICLE_TYPES[self.event.type]
        x, y, psi = stage.network.place_on_lane(self.event.lane, float(self.event.at), 0.0, 0.0)
        stage.add_obstacle(standing(f"{self.name}:0", body.kind, x, y, psi, body.length, body.width))
        return True

    def hold(self, stage: Stage, name: str) -> None:
        stage.sumo.set_mode(name, BRAKE_HARD)

    def let_go(self, stage: Stage, name: str) -> None:
        stage.sumo.set_mode(name, OWN_SPEED)

    def step(self, stage: Stage, scene: Scene) -> None:
        super().step(stage, scene)
        speeds = [math.hypot(*scene.velocity[scene.ids.index(name)]) for name in self.held]
        if self._stands_since is None and max(speeds, default=math.inf) < STANDS:
            self._stands_since = scene.time_s

    def is_over(self, scene: Scene) -> bool:
        if self.event.vehicle is None or self.event.duration is None:
            return super().is_over(scene)
        return self._stands_since is not None and scene.time_s >= self._stands_since + float(
            self.event.duration
        )

    def command(self, stage: Stage, name: str, speed: float) -> None:
        stage.sumo.slow_down(name, max(speed - STALL_DECEL * stage.decision_s, 0.0), stage.decision_s)

    def end(self, stage: Stage) -> None:
        stage.remove_obstacles(f"{self.name}:")
        super().end(stage)


class LaneClosureEffect(Effect[LaneClosure]):
    """A barrier over a stretch of one lane."""

    from_the_start = True

    def begin(self, stage: Stage, scene: Scene | None) -> bool:
        length = float(self.event.length)
        middle = float(self.event.at) + 0.5 * length
        x, y, psi = stage.network.place_on_lane(self.event.lane, middle, 0.0, 0.0)
        width = stage.network.lane(self.event.lane).width - 0.4
        stage.add_obstacle(standing(f"{self.name}:0", Kind.OBSTACLE, x, y, psi, length, width))
        return True


class OcclusionEffect(Effect[Occlusion]):
    """Opaque boxes beside the road; they hide, they do not hinder."""

    from_the_start = True

    def begin(self, stage: Stage, scene: Scene | None) -> bool:
        boxes = []
        for box in self.event.boxes:
            x, y, heading = _pose(stage, box)
            length, width = (float(side) for side in box.size)
            corners = rectangle_corners(np.array([x, y]), np.array(heading), np.array([length, width]))
            if stage.network.surface.signed_distance(np.vstack([corners, [(x, y)]])).max() > 0:
                raise SimulationError(
                    f"an occlusion box at ({x:.1f}, {y:.1f}) m reaches onto the road; "
                    "move it beside the road, or use `accident` for what stands on it"
                )
            boxes.append((x, y, heading, length, width))
        stage.sensors.occluders = np.vstack([stage.sensors.occluders, boxes])
        return True


class WrongWayEffect(Effect[WrongWay]):
    """A vehicle that drives a lane against its direction, and straight on through the junction."""

    def begin(self, stage: Stage, scene: Scene | None) -> bool:
        event, network = self.event, stage.network
        body = VEHICLE_TYPES[event.type]
        lane = network.lane(event.lane)
        way = lane.xy[::-1]
        start = np.array(network.place_on_lane(event.lane, float(event.at), 0.0, 0.0)[:2])
        ahead = way[(way - start) @ (way[-1] - way[0]) > 0]
        way = np.vstack([start, ahead])
        direction = (way[-1] - way[-2]) / np.linalg.norm(way[-1] - way[-2])
        way = np.vstack([way, way[-1] + 80.0 * direction])
        stage.props.append(
            Prop(f"{self.name}:0", body.kind, (body.length, body.width), way, wanted=float(event.speed))
        )
        stage.unlawful.add(f"{self.name}:0")
        return True


class PedestrianCrossingEffect(Effect[PedestrianCrossing]):
    """Pedestrians who walk across an arm, one behind the other."""

    def begin(self, stage: Stage, scene: Scene | None) -> bool:
        event = self.event
        way = _walkway(stage, event.arm, float(event.at))
        if event.from_side == "left":
            way = way[::-1]
        for i in range(event.count):
            speed = float(event.speed)
            size = (PEDESTRIAN_M, PEDESTRIAN_M)
            prop = Prop(f"{self.name}:{i}", Kind.PEDESTRIAN, size, way, wanted=speed)
            prop.travelled = -i * FOLLOWING_S * speed
            stage.props.append(prop)
        return True


def _walkway(stage: Stage, arm_name: str, at: float) -> Array:
    """(2, 2) m, from the roadside right of traffic going towards the junction to the other side."""
    arm, network = stage.network.arm(arm_name), stage.network
    ends = []
    for lanes, other in ((arm.in_lanes, arm.out_lanes), (arm.out_lanes, arm.in_lanes)):
        # A one-way arm is crossed from the right of its outermost lane to the left of its innermost.
        names, side = (lanes, -1.0) if lanes else (other[::-1], 1.0)
        lane = network.lanes[names[0]]
        ends.append(network.place_on_lane(names[0], at, side * (0.5 * lane.width + ROADSIDE_M), 0.0)[:2])
    return np.array(ends)


def _pose(stage: Stage, placement: Pose) -> tuple[float, float, float]:
    """Centre (m, m) and heading (rad) in the world of something a file places by position or by lane."""
    if placement.lane is None or placement.at is None:
        assert placement.position is not None, "checked by the scenario"
        x, y = (float(value) for value in placement.position)
        return x + stage.network.center[0], y + stage.network.center[1], placement.heading_rad
    return stage.network.place_on_lane(
        placement.lane, float(placement.at), float(placement.lateral), placement.heading_offset_rad
    )
