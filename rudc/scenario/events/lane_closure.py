"""`lane_closure`: a stretch of a lane that is closed by an obstacle."""

from __future__ import annotations

from typing import Annotated, Literal

from rudc.scenario.choices import Place
from rudc.scenario.distributions import AnyDistribution, Bounds
from rudc.scenario.events.event import Duration, Effect, Event
from rudc.scenario.events.registry import register_event
from rudc.scenario.events.stage import Stage
from rudc.scenario.triggers import Metre

FREE_M = 0.4
"""m by which the barrier is narrower than its lane"""


class LaneClosure(Event, frozen=True):
    """A stretch of a lane that is closed by an obstacle."""

    kind: Literal["lane_closure"]
    """a stretch of a lane that is closed"""
    lane: Place
    """lane that is closed"""
    at: Metre
    """m along the lane, where it begins to be closed"""
    length: Annotated[AnyDistribution, Bounds(0, 500, "m", above=True)]
    """m that are closed, counted away from the junction, or inside it in driving direction"""
    duration: Duration | None = None
    """s until the lane is open again; by default never"""


class LaneClosureEffect(Effect[LaneClosure]):
    """A barrier over a stretch of one lane, in straight pieces where it bends."""

    from_the_start = True

    def begin(self, stage: Stage) -> bool:
        event, width = self.event, stage.lane_width(self.event.lane) - FREE_M
        pieces = stage.pieces_along_lane(event.lane, float(event.at), float(event.length))
        return self.put(stage, [("obstacle", place, (length, width)) for place, length in pieces])

    def end(self, stage: Stage) -> None:
        stage.remove_things(self.name)


register_event(LaneClosure, LaneClosureEffect)
