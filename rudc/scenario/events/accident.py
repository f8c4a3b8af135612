"""`accident`: stationary vehicles and objects anywhere, at any heading."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import ConfigDict, SerializerFunctionWrapHandler, model_serializer, model_validator

from rudc.scenario.base import Truth, refuse
from rudc.scenario.events.event import Duration, Effect, Event
from rudc.scenario.events.registry import register_event
from rudc.scenario.events.stage import Stage, Thing
from rudc.scenario.poses import Obstacle, Placement


class Accident(Event, frozen=True):
    """Stationary vehicles, and objects such as stones, anywhere, at any heading."""

    model_config = ConfigDict(
        json_schema_extra={"anyOf": [{"required": ["vehicles"]}, {"required": ["objects"]}]}
    )

    kind: Literal["accident"]
    """stationary vehicles and objects anywhere, at any heading"""
    vehicles: tuple[Placement, ...] = ()
    """the vehicles involved"""
    objects: tuple[Obstacle, ...] = ()
    """what lies on the road: stones, a mattress, a load; without `vehicles` it lies there alone"""
    opaque: Truth = False
    """whether they hide what is behind them from the ego, as a bus hides who walks out in front of it"""
    duration: Duration | None = None
    """s until they are taken away; by default never"""

    @model_serializer(mode="wrap")
    def _without_what_is_not_there(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        optional = {"vehicles", "objects", "opaque"}
        return {key: value for key, value in handler(self).items() if value or key not in optional}

    @model_validator(mode="after")
    def _check(self) -> Accident:
        if not self.vehicles and not self.objects:
            empty = self.model_fields_set & {"vehicles", "objects"}
            refuse(
                "an accident involves one vehicle at least, in `vehicles`, or one of `objects`",
                *sorted(empty)[:1],
            )
        return self


class AccidentEffect(Effect[Accident]):
    """They stand where they are placed."""

    from_the_start = True

    def begin(self, stage: Stage) -> bool:
        things: list[Thing] = [(car.type, stage.pose(car), None) for car in self.event.vehicles]
        for thing in self.event.objects:
            things.append(("obstacle", stage.pose(thing), thing.sides))
        stand = self.put(stage, things)
        if stand and self.event.opaque:
            stage.hide_behind_things(self.name)
        return stand

    def end(self, stage: Stage) -> None:
        stage.remove_things(self.name)
        stage.reveal(self.name)


register_event(Accident, AccidentEffect)
