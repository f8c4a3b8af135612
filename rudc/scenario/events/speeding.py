"""`speeding`: a surrounding vehicle drives above the limit."""

from __future__ import annotations

from typing import Annotated, Literal

from rudc.scenario.distributions import AnyDistribution, Bounds
from rudc.scenario.events.event import Duration, Held, VehicleEvent
from rudc.scenario.events.registry import register_event
from rudc.scenario.events.stage import Stage
from rudc.scenario.selectors import Selector


class Speeding(VehicleEvent, frozen=True):
    """A surrounding vehicle drives above the limit."""

    kind: Literal["speeding"]
    """a surrounding vehicle drives above the limit"""
    vehicle: Selector = "crossing"
    """which vehicle"""
    factor: Annotated[AnyDistribution, Bounds(1, 4, above=True)]
    """times the limit"""
    duration: Duration | None = None
    """s; by default for good"""


class SpeedingEffect(Held[Speeding]):
    """It wants a multiple of the limit."""

    def hold(self, stage: Stage, name: str) -> None:
        stage.set_speed_factor(name, float(self.event.factor), self.name)

    def let_go(self, stage: Stage, name: str) -> None:
        stage.set_speed_factor(name, None, self.name)


register_event(Speeding, SpeedingEffect)
