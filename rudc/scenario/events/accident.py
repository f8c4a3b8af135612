"""`accident`: stationary vehicles anywhere, at any heading."""

from __future__ import annotations

from typing import Literal

from pydantic import model_validator

from rudc.scenario.base import refuse
from rudc.scenario.events.event import Duration, Effect, Event
from rudc.scenario.events.registry import register_event
from rudc.scenario.events.stage import Stage
from rudc.scenario.poses import Placement


class Accident(Event, frozen=True):
    """Stationary vehicles anywhere, at any heading."""

    kind: Literal["accident"]
    """stationary vehicles anywhere, at any heading"""
    vehicles: tuple[Placement, ...]
    """the vehicles involved"""
    duration: Duration | None = None
    """s until they are taken away; by default never"""

    @model_validator(mode="after")
    def _check(self) -> Accident:
        if not self.vehicles:
            refuse("an accident involves one vehicle at least", "vehicles")
        return self


class AccidentEffect(Effect[Accident]):
    """They stand where they are placed."""

    from_the_start = True

    def begin(self, stage: Stage) -> bool:
        return self.put(stage, [(car.type, stage.pose(car), None) for car in self.event.vehicles])

    def end(self, stage: Stage) -> None:
        stage.remove_things(self.name)


register_event(Accident, AccidentEffect)
