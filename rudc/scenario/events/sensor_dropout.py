"""`sensor_dropout`: the ego misses others at random, and beyond a range."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Annotated, Any, Literal

from rudc.scenario.distributions import AnyDistribution, Bounds, Constant
from rudc.scenario.events.event import Duration, Event, Felt
from rudc.scenario.events.registry import register_event
from rudc.scenario.events.stage import Stage


class SensorDropout(Event, frozen=True):
    """The ego misses others at random, and beyond a range; a later event of this kind replaces it whole."""

    kind: Literal["sensor_dropout"]
    """the ego misses others at random, and beyond a range"""
    probability: Annotated[AnyDistribution, Bounds(0, 1)] = Constant(value=0.0)
    """probability of missing a vehicle, drawn anew for each vehicle at each decision"""
    range: Annotated[AnyDistribution, Bounds(0, 1000, "m", above=True)] | None = None
    """m beyond which nobody is seen; a road user whose centre or a corner lies within it is seen whole; by
    default no limit"""
    duration: Duration | None = None
    """s until it is over; by default for good"""

    @classmethod
    def misfits(cls, given: Mapping[str, Any]) -> Iterator[tuple[str, str | None]]:
        """One of its numbers at least."""
        if not {"probability", "range"} & set(given) and set(given) <= set(cls.model_fields):
            yield "expected `probability`, `range` or both", None


class SensorDropoutEffect(Felt[SensorDropout]):
    """Others go unseen at random, and beyond a range."""

    from_the_start = True
    replaceable = True

    def begin(self, stage: Stage) -> bool:
        reach = math.inf if self.event.range is None else float(self.event.range)
        stage.set_dropout(float(self.event.probability), reach)
        return True

    def end(self, stage: Stage) -> None:
        stage.set_dropout(0.0, math.inf)


register_event(SensorDropout, SensorDropoutEffect)
