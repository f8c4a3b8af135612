"""`pedestrian_crossing`: pedestrians walk across an arm in front of traffic."""

from __future__ import annotations

from typing import Annotated, Literal

from rudc.scenario.choices import Place, Side
from rudc.scenario.distributions import AnyDistribution, Bounds, Constant
from rudc.scenario.events.event import Event, Gap, Passing
from rudc.scenario.events.pause import WalkersPause, halt_of
from rudc.scenario.events.registry import register_event
from rudc.scenario.events.stage import Stage
from rudc.scenario.triggers import Metre


class PedestrianCrossing(Event, frozen=True):
    """Pedestrians walk across an arm in front of traffic."""

    kind: Literal["pedestrian_crossing"]
    """pedestrians walk across an arm"""
    arm: Place
    """arm they cross; or ego_in or ego_out, the arm the ego comes from or leaves by"""
    at: Metre = Constant(value=3.0)
    """m from the junction, of the line they walk along"""
    speed: Annotated[AnyDistribution, Bounds(0, 10, "m/s", above=True)] = Constant(value=1.4)
    """m/s"""
    count: Annotated[AnyDistribution, Bounds(1, 30, whole=True)] = Constant(value=1.0)
    """how many, one behind the other"""
    gap: Gap | None = None
    """s between one and the next; by default 1.2"""
    from_side: Side = "right"
    """side they start from, as seen going towards the junction: on `ego_out`, `right` is the ego's left"""
    pause: WalkersPause | None = None
    """where they stop on their way, all at once, and for how long; by default nowhere"""


class PedestrianCrossingEffect(Passing[PedestrianCrossing]):
    """Pedestrians who walk across an arm, one behind the other."""

    def begin(self, stage: Stage) -> bool:
        event, speed = self.event, float(self.event.speed)
        way = stage.across_arm(event.arm, float(event.at))
        if event.from_side == "left":
            way = way[::-1]
        for i in range(event.count):
            late_m = i * self.gap_s(event.gap) * speed
            stage.send(f"{self.name}:{i}", "pedestrian", way, speed, late_m, halt=halt_of(event.pause))
        return True


register_event(PedestrianCrossing, PedestrianCrossingEffect)
