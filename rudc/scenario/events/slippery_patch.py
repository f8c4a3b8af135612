"""`slippery_patch`: a place where the road is slippery."""

from __future__ import annotations

from typing import Annotated, Literal

from rudc.scenario.choices import Place
from rudc.scenario.distributions import AnyDistribution, Bounds
from rudc.scenario.events.checked_stage import LEAST, MOST
from rudc.scenario.events.event import Duration, Effect, Event
from rudc.scenario.events.registry import register_event
from rudc.scenario.events.stage import Stage
from rudc.scenario.triggers import Metre


class SlipperyPatch(Event, frozen=True):
    """A stretch of a lane where only the ego slips; it does not see that.

    The other vehicles drive over it as over the rest of the road, and so does an ego that SUMO drives
    (`--agent sumo`).
    """

    kind: Literal["slippery_patch"]
    """a stretch of a lane that is slippery for the ego"""
    lane: Place
    """lane that the patch lies on, over its whole width; the ego slips while its centre is on it"""
    at: Metre
    """m along the lane, where the patch begins"""
    length: Annotated[AnyDistribution, Bounds(0, 500, "m", above=True)]
    """m that are slippery, counted away from the junction, or inside it in driving direction"""
    friction: Annotated[AnyDistribution, Bounds(LEAST, MOST)]
    """coefficient of friction there, if that of the road and of other patches is not lower: 0.9 dry, 0.5 wet,
    0.3 snow, 0.1 ice"""
    duration: Duration | None = None
    """s until the road grips there again; by default never"""


class SlipperyPatchEffect(Effect[SlipperyPatch]):
    """The ego's tyres have less grip on a stretch of one lane."""

    from_the_start = True
    underfoot = True

    def begin(self, stage: Stage) -> bool:
        event = self.event
        at, length, friction = float(event.at), float(event.length), float(event.friction)
        stage.lay_patch(self.name, event.lane, at, length, friction)
        return True

    def end(self, stage: Stage) -> None:
        stage.remove_patch(self.name)


register_event(SlipperyPatch, SlipperyPatchEffect)
