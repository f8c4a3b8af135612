"""`vehicle_crossing`: cyclists, motorcyclists or others ride across an arm in front of traffic."""

from __future__ import annotations

from typing import Annotated, Literal

from rudc.scenario.choices import AnyVehicleType, Place, Side
from rudc.scenario.distributions import AnyDistribution, Bounds, Constant
from rudc.scenario.events.event import Event, Gap, MovingSpeed, Passing
from rudc.scenario.events.pause import Pause, halt_of
from rudc.scenario.events.registry import register_event
from rudc.scenario.events.stage import ROADSIDE_M, Size, Stage
from rudc.scenario.triggers import Metre

CrosserSide = Annotated[AnyDistribution, Bounds(0.2, 25, "m")]


class VehicleCrossing(Event, frozen=True):
    """Cyclists, motorcyclists or others ride across an arm, from a path or yard beside it."""

    kind: Literal["vehicle_crossing"]
    """cyclists, motorcyclists or others ride across an arm"""
    arm: Place
    """arm they cross; or ego_in or ego_out, the arm the ego comes from or leaves by"""
    type: AnyVehicleType = "bicycle"
    """what crosses"""
    size: tuple[CrosserSide, CrosserSide] | None = None
    """its length and width in m, such as a cart's; by default those of traffic of that type"""
    at: Metre = Constant(value=4.0)
    """m from the junction, of their way; they wait until traffic there can stop, but not for the ego"""
    speed: MovingSpeed = Constant(value=4.0)
    """m/s; they stop for what stands in their way and for an ego below 2 m/s, not for a faster one"""
    count: Annotated[AnyDistribution, Bounds(1, 30, whole=True)] = Constant(value=1.0)
    """how many, one behind the other"""
    gap: Gap | None = None
    """s between the rear of one and the front of the next; by default 1.2"""
    from_side: Side = "right"
    """side they start from, as seen going towards the junction: on `ego_out`, `right` is the ego's left"""
    pause: Pause | None = None
    """where they stop on their way, all at once, and for how long; by default nowhere"""


def size_or_none(event: VehicleCrossing) -> Size | None:
    """Length and width in m, if the event says them, drawn."""
    return None if event.size is None else (float(event.size[0]), float(event.size[1]))


def beyond_way(length: float) -> float:
    """m that one of `length` m drives beyond its way's end, so that its rear leaves the road."""
    return 0.5 * length if 0.5 * length > ROADSIDE_M else 0.0


class VehicleCrossingEffect(Passing[VehicleCrossing]):
    """They ride straight across, one behind the other, once traffic can still stop before the first.

    The first begins with its front at the roadside. Long ones end with their rear there, so that no part of
    them is still on the road.
    """

    def begin(self, stage: Stage) -> bool:
        event, speed = self.event, float(self.event.speed)
        way = stage.across_arm(event.arm, float(event.at))
        if event.from_side == "left":
            way = way[::-1]
        size = size_or_none(event)
        length = stage.length_of(event.type) if size is None else size[0]
        if not stage.has_room(event.type, way, speed, 0.5 * length, size):
            return False
        beyond_m = beyond_way(length)
        for i in range(event.count):
            late_m = 0.5 * length + i * (length + self.gap_s(event.gap) * speed)
            name, halt = f"{self.name}:{i}", halt_of(event.pause)
            stage.send(name, event.type, way, speed, late_m, beyond_m, halt=halt, size=size)
        return True


register_event(VehicleCrossing, VehicleCrossingEffect)
