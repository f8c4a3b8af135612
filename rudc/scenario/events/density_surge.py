"""`density_surge`: traffic density changes during the episode."""

from __future__ import annotations

from typing import Annotated, Literal

from rudc.scenario.distributions import AnyDistribution, Bounds
from rudc.scenario.events.event import Duration, Event, Felt
from rudc.scenario.events.registry import register_event
from rudc.scenario.events.stage import Stage


class DensitySurge(Event, frozen=True):
    """Traffic density changes during the episode."""

    kind: Literal["density_surge"]
    """traffic density changes during the episode"""
    density: Annotated[AnyDistribution, Bounds(0, 150, "veh/km")]
    """veh/km of two-way road from then on"""
    duration: Duration | None = None
    """s; by default for good"""


class DensitySurgeEffect(Felt[DensitySurge]):
    """Another density, held by inflow from now on."""

    def begin(self, stage: Stage) -> bool:
        stage.set_density(float(self.event.density), self.name)
        return True

    def end(self, stage: Stage) -> None:
        stage.set_density(None, self.name)


register_event(DensitySurge, DensitySurgeEffect)
