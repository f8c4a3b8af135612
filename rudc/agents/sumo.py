"""SUMO's own driver for the ego: it follows lanes exactly, with IDM and SUMO's right of way."""

from __future__ import annotations

from rudc.agents.base import Decision, unfiltered
from rudc.world.config import EgoDriver
from rudc.world.scene import Scene


class SumoDriver:
    """SUMO drives the ego as it drives the others; the world ignores what `act` returns."""

    name = "sumo"
    ego_driver: EgoDriver = "sumo"

    def reset(self, scene: Scene, seed: int) -> None:
        """Nothing to prepare."""

    def act(self, scene: Scene) -> Decision:
        """An action of zeros, which the world ignores."""
        return unfiltered(0.0, 0.0)
