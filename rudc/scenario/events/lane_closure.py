"""`lane_closure`: a stretch of a lane that is closed by an obstacle."""

from __future__ import annotations

from typing import Annotated, Literal

from rudc.scenario.base import Identifier
from rudc.scenario.distributions import AnyDistribution, Bounds
from rudc.scenario.events.event import Effect, Event
from rudc.scenario.events.registry import register_event
from rudc.scenario.events.stage import Stage
from rudc.scenario.triggers import Metre

FREE_M = 0.4
"""m by which the barrier is narrower than its lane"""


class LaneClosure(Event, frozen=True):
    """A stretch of a lane that is closed by an obstacle."""

    kind: Literal["lane_closure"]
    """a stretch of a lane that is closed"""
    lane: Identifier
    """lane that is closed"""
    at: Metre
    """m from the junction, the end nearer to it"""
    length: Annotated[AnyDistribution, Bounds(0, 500, "m", above=True)]
    """m, away from the junction"""


class LaneClosureEffect(Effect[LaneClosure]):
    """A barrier over a stretch of one lane."""

    from_the_start = True

    def begin(self, stage: Stage) -> bool:
        length, width = float(self.event.length), stage.lane_width(self.event.lane) - FREE_M
        place = stage.pose_on_lane(self.event.lane, float(self.event.at) + 0.5 * length)
        stage.stand(f"{self.name}:0", "obstacle", place, (length, width))
        return True


register_event(LaneClosure, LaneClosureEffect)
