"""`slow_vehicle`: a surrounding vehicle crawls."""

from __future__ import annotations

from typing import Literal

from rudc.scenario.events.event import UNHURRIED, Duration, Held, MovingSpeed, VehicleEvent
from rudc.scenario.events.registry import register_event
from rudc.scenario.events.stage import Stage
from rudc.scenario.selectors import Selector


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


SETTLED = 0.1
"""m/s above its new top speed at which a vehicle counts as slow enough"""


class SlowVehicleEffect(Held[SlowVehicle]):
    """It slows down without hurry, and then goes no faster than a given speed."""

    def __init__(self, event: SlowVehicle, name: str) -> None:
        super().__init__(event, name)
        self._slow: set[str] = set()

    def command(self, stage: Stage, name: str) -> None:
        wanted = float(self.event.speed)
        if name in self._slow:
            return
        if stage.speed(name) > wanted + SETTLED:
            stage.slow_down(name, UNHURRIED, least=wanted)
        else:
            stage.set_top_speed(name, wanted, self.name)
            self._slow.add(name)

    def let_go(self, stage: Stage, name: str) -> None:
        stage.set_top_speed(name, None, self.name)


register_event(SlowVehicle, SlowVehicleEffect)
