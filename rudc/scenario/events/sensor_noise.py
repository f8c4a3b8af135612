"""`sensor_noise`: Gaussian errors of what the ego perceives of others and of itself."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Annotated, Any, Literal

from rudc.scenario.distributions import AnyDistribution, Bounds, Constant
from rudc.scenario.events.event import Duration, Event, Felt
from rudc.scenario.events.registry import register_event
from rudc.scenario.events.stage import Stage


class SensorNoise(Event, frozen=True):
    """Gaussian errors of what the ego sees of others and of itself; a later one replaces it whole."""

    kind: Literal["sensor_noise"]
    """Gaussian errors of what the ego perceives of others and of itself"""
    position: Annotated[AnyDistribution, Bounds(0, 20, "m")] = Constant(value=0.0)
    """m, standard deviation along each axis"""
    speed: Annotated[AnyDistribution, Bounds(0, 20, "m/s")] = Constant(value=0.0)
    """m/s, standard deviation"""
    heading: Annotated[AnyDistribution, Bounds(0, 180, "deg")] = Constant(value=0.0)
    """deg, standard deviation"""
    own_acceleration: Annotated[AnyDistribution, Bounds(0, 5, "m/s2")] = Constant(value=0.0)
    """m/s2, standard deviation of what the ego measures of its own acceleration"""
    duration: Duration | None = None
    """s until it is over; by default for good"""

    @classmethod
    def misfits(cls, given: Mapping[str, Any]) -> Iterator[tuple[str, str | None]]:
        """One of its numbers at least."""
        numbers = {"position", "speed", "heading", "own_acceleration"}
        if not numbers & set(given) and set(given) <= set(cls.model_fields):
            said = "`position`, `speed`, `heading` and `own_acceleration`"
            yield f"expected one or more of {said} (standard deviations)", None


class SensorNoiseEffect(Felt[SensorNoise]):
    """Gaussian errors on what the ego sees of others and measures of itself."""

    from_the_start = True
    replaceable = True

    def begin(self, stage: Stage) -> bool:
        event = self.event
        stage.set_noise(float(event.position), float(event.speed), math.radians(float(event.heading)))
        stage.set_own_noise(float(event.own_acceleration))
        return True

    def end(self, stage: Stage) -> None:
        stage.set_noise(0.0, 0.0, 0.0)
        stage.set_own_noise(0.0)


register_event(SensorNoise, SensorNoiseEffect)
