"""`occlusion`: boxes that hide what is behind them from the ego; nothing collides with them."""

from __future__ import annotations

from typing import Literal

from pydantic import model_validator

from rudc.scenario.base import refuse
from rudc.scenario.events.event import Duration, Event, Felt
from rudc.scenario.events.registry import register_event
from rudc.scenario.events.stage import Stage
from rudc.scenario.poses import OpaqueBox


class Occlusion(Event, frozen=True):
    """Boxes that hide what is behind them from the ego; nothing collides with them."""

    kind: Literal["occlusion"]
    """boxes that hide what is behind them from the ego"""
    boxes: tuple[OpaqueBox, ...]
    """the boxes"""
    duration: Duration | None = None
    """s until they are taken away; by default never"""

    @model_validator(mode="after")
    def _check(self) -> Occlusion:
        if not self.boxes:
            refuse("nothing is hidden without a box", "boxes")
        return self


class OcclusionEffect(Felt[Occlusion]):
    """Opaque boxes beside the road; they hide, they do not hinder."""

    from_the_start = True

    def begin(self, stage: Stage) -> bool:
        for box in self.event.boxes:
            stage.hide_behind(self.name, stage.pose(box), box.sides)
        return True

    def end(self, stage: Stage) -> None:
        stage.reveal(self.name)


register_event(Occlusion, OcclusionEffect)
