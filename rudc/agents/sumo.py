"""SUMO's own driver in the ego's seat: IDM and SUMO's right of way, on rails along its lanes."""

from __future__ import annotations

from rudc.agents.base import Decision, EgoDriver, unfiltered
from rudc.world.scene import Scene


class SumoDriver:
    """SUMO drives the ego as it drives the others; the world ignores what `act` returns."""

    name = "sumo"
    ego_driver: EgoDriver = "sumo"

    def reset(self, scene: Scene, seed: int) -> None:
        """Nothing to prepare."""

    def act(self, scene: Scene) -> Decision:
        """Zeros."""
        return unfiltered(0.0, 0.0)
