"""`actuator_delay`: the ego's commands take effect late."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Annotated, Any, Literal

from rudc.scenario.distributions import AnyDistribution, Bounds, Constant
from rudc.scenario.events.event import Duration, Event, Felt
from rudc.scenario.events.registry import register_event
from rudc.scenario.events.stage import Stage


class ActuatorDelay(Event, frozen=True):
    """The ego's pedals and steering take effect late; a later event of this kind replaces it whole."""

    kind: Literal["actuator_delay"]
    """the ego's commands take effect late"""
    delay: Annotated[AnyDistribution, Bounds(0, 2, "s")] = Constant(value=0.0)
    """s until a command takes effect, of the pedals and of the steering alike"""
    lag: Annotated[AnyDistribution, Bounds(0, 3, "s")] = Constant(value=0.0)
    """s, time constant of a first-order lag"""
    duration: Duration | None = None
    """s until it is over; by default for good"""

    @classmethod
    def misfits(cls, given: Mapping[str, Any]) -> Iterator[tuple[str, str | None]]:
        """One of its numbers at least."""
        if not {"delay", "lag"} & set(given) and set(given) <= set(cls.model_fields):
            yield "expected `delay`, `lag` or both", None


class ActuatorDelayEffect(Felt[ActuatorDelay]):
    """The ego's commands arrive late and are followed with a lag."""

    from_the_start = True
    replaceable = True

    def begin(self, stage: Stage) -> bool:
        stage.set_actuators(float(self.event.delay), float(self.event.lag))
        return True

    def end(self, stage: Stage) -> None:
        stage.set_actuators(0.0, 0.0)


register_event(ActuatorDelay, ActuatorDelayEffect)
