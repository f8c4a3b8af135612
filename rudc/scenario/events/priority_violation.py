"""`priority_violation`: a surrounding vehicle disregards the right of way."""

from __future__ import annotations

from typing import Literal

from rudc.scenario.events.event import Duration, Held, VehicleEvent
from rudc.scenario.events.registry import register_event
from rudc.scenario.events.stage import Stage
from rudc.scenario.selectors import Selector


class PriorityViolation(VehicleEvent, frozen=True):
    """A surrounding vehicle disregards the right of way."""

    kind: Literal["priority_violation"]
    """a surrounding vehicle disregards the right of way"""
    vehicle: Selector = "crossing"
    """which vehicle"""
    duration: Duration | None = None
    """s; by default for good. Whoever is in the junction at that time goes on until it is out, and the event
    is over only then"""


class PriorityViolationEffect(Held[PriorityViolation]):
    """It takes no notice of who has the right of way, nor of an ego that stands in its way. It keeps its
    distance to its leader, which may be the ego, and brakes for pedestrians and obstacles.
    """

    def hold(self, stage: Stage, name: str) -> None:
        stage.seize(name, heedless=True)

    def step(self, stage: Stage) -> None:
        super().step(stage)
        if self.has_lasted(stage):
            for name in self.held:
                if not stage.is_inside(name):
                    self.let_go(stage, name)
            self.held = [name for name in self.held if stage.is_inside(name)]

    def is_over(self, stage: Stage) -> bool:
        """Whether its duration has passed and its vehicles are out of the junction, or all have left."""
        there = any(stage.is_inside(name) for name in self.held)
        return self.all_left(stage) or (self.has_lasted(stage) and not there)

    def let_go(self, stage: Stage, name: str) -> None:
        stage.release(name, heedless=True)


register_event(PriorityViolation, PriorityViolationEffect)
