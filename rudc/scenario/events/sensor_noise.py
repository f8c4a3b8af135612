"""`sensor_noise`: Gaussian errors of what the ego perceives of others."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Annotated, Any, Literal

from rudc.scenario.distributions import AnyDistribution, Bounds, Constant
from rudc.scenario.events.event import Event, Felt
from rudc.scenario.events.registry import register_event
from rudc.scenario.events.stage import Stage


class SensorNoise(Event, frozen=True):
    """Gaussian errors of what the ego perceives of others."""

    kind: Literal["sensor_noise"]
    """Gaussian errors of what the ego perceives of others"""
    position: Annotated[AnyDistribution, Bounds(0, 20, "m")] = Constant(value=0.0)
    """m, standard deviation along each axis"""
    speed: Annotated[AnyDistribution, Bounds(0, 20, "m/s")] = Constant(value=0.0)
    """m/s, standard deviation"""
    heading: Annotated[AnyDistribution, Bounds(0, 180, "deg")] = Constant(value=0.0)
    """deg, standard deviation"""

    @classmethod
    def misfits(cls, given: Mapping[str, Any]) -> Iterator[tuple[str, str | None]]:
        """One of its numbers at least."""
        if not {"position", "speed", "heading"} & set(given) and set(given) <= set(cls.model_fields):
            yield "expected one or more of `position`, `speed` and `heading` (standard deviations)", None


class SensorNoiseEffect(Felt[SensorNoise]):
    """Gaussian errors on what the ego sees of others."""

    from_the_start = True

    def begin(self, stage: Stage) -> bool:
        event = self.event
        stage.set_noise(float(event.position), float(event.speed), math.radians(float(event.heading)))
        return True


register_event(SensorNoise, SensorNoiseEffect)
