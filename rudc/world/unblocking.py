"""Surrounding vehicles (SVs) do not stand for ever because of an ego that stands in nobody's way.

In SUMO a vehicle waits for anybody inside the junction whose lane there crosses its own, for as long as that
one is on it. So an ego that has stopped a little beyond its line and gives way there would hold up those who
have priority, and they the ego. The yielding layer knows better who must wait for the ego. Once the ego has
stood for STOOD_S, the SVs that stand and that the layer does not hold overlook the ego at junctions in SUMO,
until the ego drives again.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import TYPE_CHECKING

import numpy as np

from rudc.world.scene import STANDING
from rudc.world.traffic import EGO

if TYPE_CHECKING:
    from rudc.world.scene import Scene
    from rudc.world.sumo import Sumo

STOOD_S = 5.0
"""s for which the ego must have stood"""


class Unblocking:
    """Sets SVs free in one episode."""

    def __init__(self, sumo: Sumo) -> None:
        self._sumo = sumo
        self._free: set[str] = set()

    def step(self, scene: Scene, held: Collection[str]) -> None:
        """Set free the SVs that stand and are not `held` by the yielding layer, once the ego has stood long
        enough. When the ego drives, all heed it again.
        """
        if scene.waited_s == 0.0 and self._free:
            for name in self._free.intersection(scene.ids):
                self._sumo.overlook(name, "")
            self._free.clear()
        if scene.waited_s < STOOD_S:
            return
        stand = (scene.path >= 0) & (np.hypot(*scene.velocity.T) < STANDING)
        for i in stand.nonzero()[0].tolist():
            if scene.ids[i] not in self._free and scene.ids[i] not in held:
                self._sumo.overlook(scene.ids[i], EGO)
                self._free.add(scene.ids[i])
