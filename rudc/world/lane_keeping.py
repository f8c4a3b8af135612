"""Surrounding vehicles (SVs) near the ego do not change lanes where SUMO would not see the ego.

In SUMO a vehicle changes lanes within one step, by a whole lane's width, and SUMO checks only these two
lanes. Inside a junction, or beside an ego that is between two lanes, this can put a vehicle onto the ego.
There SVs within NEAR m of the ego stay in their lanes.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from rudc.world.kernels import near_on_paths

if TYPE_CHECKING:
    from rudc.world.scene import Scene
    from rudc.world.sumo import Sumo

NEAR = 15.0
"""m between centres"""
BETWEEN = 0.8
"""m of lateral offset from its route from which on the ego may reach into another lane"""


class LaneKeeping:
    """Keeps SVs near the ego in their lanes, in one episode."""

    def __init__(self, sumo: Sumo) -> None:
        self._sumo = sumo
        self._modes: dict[str, int] = {}

    def step(self, scene: Scene) -> None:
        """Hold the SVs that are near now in their lanes; all others change lanes as before."""
        ego, paths = scene.ego, scene.network.paths
        near = near_on_paths(
            ego.x, ego.y, NEAR, abs(scene.ego_offset) < BETWEEN,
            scene.position, scene.size, scene.path, scene.path_s, paths.stop_s, paths.exit_s,
        )  # fmt: skip
        if not len(near) and not self._modes:
            return
        held = {scene.ids[i] for i in near.tolist()}
        for name in self._modes.keys() - held:
            mode = self._modes.pop(name)
            if name in scene.ids:
                self._sumo.set_lane_changes(name, mode)
        for name in sorted(held - self._modes.keys()):
            self._modes[name] = self._sumo.hold_lane(name)
