"""`wrong_way`: a vehicle drives along a lane against its direction."""

from __future__ import annotations

from typing import Literal

from rudc.scenario.choices import AnyVehicleType, Place
from rudc.scenario.distributions import Constant
from rudc.scenario.events.event import Event, MovingSpeed, Passing
from rudc.scenario.events.registry import register_event
from rudc.scenario.events.stage import Stage
from rudc.scenario.triggers import Metre


class WrongWay(Event, frozen=True):
    """A vehicle drives along a lane against its direction."""

    kind: Literal["wrong_way"]
    """a vehicle drives along a lane against its direction"""
    lane: Place
    """lane it drives along; on ARM_out_INDEX it comes towards the junction, and goes straight on through it;
    from inside the junction it drives out by the arm from which the lane comes"""
    at: Metre
    """m from the junction along the lane, where its centre appears, once traffic there can stop before it;
    the ego is not waited for"""
    speed: MovingSpeed = Constant(value=6.0)
    """m/s; it stops for what stands in its way and for an ego below 2 m/s, not for a faster one; once it
    stands, it waits while the ego passes"""
    type: AnyVehicleType = "car"
    """what vehicle; `rudc scenario keys mix` says how long each is"""


class WrongWayEffect(Passing[WrongWay]):
    """It drives along a lane against the lane's direction, through the junction where it lies ahead, and off
    the road by an arm."""

    def begin(self, stage: Stage) -> bool:
        event, speed = self.event, float(self.event.speed)
        way = stage.against_lane(event.lane, float(event.at))
        if not stage.has_room(event.type, way, speed):
            return False
        behind = stage.behind_on_lane(event.lane, float(event.at))
        stage.send(f"{self.name}:0", event.type, way, speed, behind=behind)
        stage.unlawful.add(f"{self.name}:0")
        return True


register_event(WrongWay, WrongWayEffect)
