"""`low_friction`: a slippery road."""

from __future__ import annotations

from typing import Annotated, Literal

from rudc.scenario.distributions import AnyDistribution, Bounds
from rudc.scenario.events.checked_stage import LEAST, MOST
from rudc.scenario.events.event import Duration, Event, Felt
from rudc.scenario.events.registry import register_event
from rudc.scenario.events.stage import Stage


class LowFriction(Event, frozen=True):
    """A slippery road; a later event of this kind replaces it."""

    kind: Literal["low_friction"]
    """a slippery road: nobody brakes or accelerates harder than mu g; the ego slides if it turns harder,
    others slow down more for bends"""
    friction: Annotated[AnyDistribution, Bounds(LEAST, MOST)]
    """coefficient of friction: 0.9 dry, 0.5 wet, 0.3 snow, 0.1 ice"""
    duration: Duration | None = None
    """s until it is over; by default for good"""


class LowFrictionEffect(Felt[LowFriction]):
    """The ego's tyres and the others' brakes have that grip."""

    from_the_start = True
    replaceable = True

    def begin(self, stage: Stage) -> bool:
        stage.set_friction(float(self.event.friction))
        return True

    def end(self, stage: Stage) -> None:
        stage.set_friction(None)


register_event(LowFriction, LowFrictionEffect)
