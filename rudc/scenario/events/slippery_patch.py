"""`slippery_patch`: a place where the road is slippery."""

from __future__ import annotations

from typing import Annotated, Literal

from rudc.scenario.base import Identifier
from rudc.scenario.distributions import AnyDistribution, Bounds
from rudc.scenario.events.event import Duration, Effect, Event
from rudc.scenario.events.low_friction import LEAST, MOST
from rudc.scenario.events.registry import register_event
from rudc.scenario.events.stage import Stage
from rudc.scenario.triggers import Metre


class SlipperyPatch(Event, frozen=True):
    """A stretch of a lane that is slippery."""

    kind: Literal["slippery_patch"]
    """a stretch of a lane that is slippery for the ego, as long as its centre is on it; others drive over it
    as over the rest of the road; the ego does not see it, and it counts as seen once the ego is on it"""
    lane: Identifier
    """lane"""
    at: Metre
    """m along the lane, where the patch begins"""
    length: Annotated[AnyDistribution, Bounds(0, 500, "m", above=True)]
    """m that are slippery, counted away from the junction, or inside it in driving direction"""
    friction: Annotated[AnyDistribution, Bounds(LEAST, MOST)]
    """coefficient of friction: 0.9 dry, 0.5 wet, 0.3 snow, 0.1 ice; the lowest counts where patches overlap,
    or the whole road is slippery"""
    duration: Duration | None = None
    """s until the road grips there again; by default never"""


class SlipperyPatchEffect(Effect[SlipperyPatch]):
    """The ego's tyres have less grip on a stretch of one lane, over its whole width."""

    from_the_start = True

    def begin(self, stage: Stage) -> bool:
        event = self.event
        pieces = stage.pieces_along_lane(event.lane, float(event.at), float(event.length))
        width = stage.lane_width(event.lane)
        patch = [(place, (length, width)) for place, length in pieces]
        stage.lay_patch(self.name, patch, float(event.friction))
        return True

    def end(self, stage: Stage) -> None:
        stage.remove_patch(self.name)


register_event(SlipperyPatch, SlipperyPatchEffect)
