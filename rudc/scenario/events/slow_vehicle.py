"""`slow_vehicle`: a surrounding vehicle crawls."""

from __future__ import annotations

from typing import Literal

from rudc.scenario.events.event import Duration, Held, MovingSpeed, VehicleEvent
from rudc.scenario.events.registry import register_event
from rudc.scenario.events.stage import Stage
from rudc.scenario.triggers import Selector


class SlowVehicle(VehicleEvent, frozen=True):
    """A surrounding vehicle crawls."""

    kind: Literal["slow_vehicle"]
    """a surrounding vehicle crawls"""
    vehicle: Selector = "leader"
    """which vehicle"""
    speed: MovingSpeed
    """m/s it does not exceed"""
    duration: Duration | None = None
    """s; by default for good"""


class SlowVehicleEffect(Held[SlowVehicle]):
    """It goes no faster than a given speed."""

    def hold(self, stage: Stage, name: str) -> None:
        stage.set_top_speed(name, float(self.event.speed), self.name)

    def let_go(self, stage: Stage, name: str) -> None:
        stage.set_top_speed(name, None, self.name)


register_event(SlowVehicle, SlowVehicleEffect)
