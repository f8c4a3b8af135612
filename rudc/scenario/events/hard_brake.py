"""`hard_brake`: a surrounding vehicle brakes hard for no visible reason."""

from __future__ import annotations

from typing import Annotated, Literal

from rudc.scenario.distributions import AnyDistribution, Bounds, Constant
from rudc.scenario.events.event import HARDEST, Duration, Held, VehicleEvent
from rudc.scenario.events.registry import register_event
from rudc.scenario.events.stage import Stage
from rudc.scenario.selectors import Selector


class HardBrake(VehicleEvent, frozen=True):
    """A surrounding vehicle brakes hard for no visible reason."""

    kind: Literal["hard_brake"]
    """a surrounding vehicle brakes hard for no visible reason"""
    vehicle: Selector = "leader"
    """which vehicle"""
    deceleration: Annotated[AnyDistribution, Bounds(0, HARDEST, "m/s2", above=True)] = Constant(value=7.0)
    """m/s2"""
    duration: Duration = Constant(value=3.0)
    """s that this lasts, braking included; a vehicle that has stopped stands until then"""


class HardBrakeEffect(Held[HardBrake]):
    """It drives on when the event's duration has passed."""

    def hold(self, stage: Stage, name: str) -> None:
        stage.seize(name)

    def let_go(self, stage: Stage, name: str) -> None:
        stage.release(name)

    def command(self, stage: Stage, name: str) -> None:
        stage.slow_down(name, float(self.event.deceleration))


register_event(HardBrake, HardBrakeEffect)
