"""Surrounding vehicles (SVs) do not change lanes where SUMO would not see who is there.

In SUMO a vehicle changes lanes within one step, by a whole lane's width, and SUMO checks only these two
lanes. Inside a junction, or beside an ego that is between two lanes, this can put a vehicle onto the ego.
There SVs within NEAR m of the ego stay in their lanes. SUMO knows nothing of those whom it does not move. So
SVs stay in their lanes, too, inside the junction within NEAR_PROP m of a vehicle or obstacle of that sort,
and anywhere within NEAR_MOVING m of a pedestrian or a vehicle of that sort that moves. They change lanes then
only if rudc/world/detours.py asks them to.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rudc.geometry import rectangle_gaps
from rudc.world.kernels import near_on_paths
from rudc.world.scene import Kind

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rudc.world.props import Prop
    from rudc.world.scene import Scene
    from rudc.world.sumo import Sumo

NEAR = 15.0
"""m between centres"""
NEAR_PROP = 25.0
"""m of gap: enough to stop before somebody who comes the wrong way"""
NEAR_MOVING = 15.0
"""m of gap: enough to stop before somebody who walks or rides over the road"""
BETWEEN = 0.8
"""m of lateral offset from its route from which on the ego may reach into another lane"""


class LaneKeeping:
    """Keeps SVs near the ego and near props in their lanes, in one episode."""

    def __init__(self, sumo: Sumo) -> None:
        self._sumo = sumo
        self._modes: dict[str, int] = {}

    def step(self, scene: Scene, props: Sequence[Prop]) -> None:
        """Hold the SVs that are near now in their lanes; all others change lanes as before."""
        near = _near_ego(scene) | _near_props(scene, props)
        if not near and not self._modes:
            return
        held = {scene.ids[i] for i in near}
        for name in self._modes.keys() - held:
            mode = self._modes.pop(name)
            if name in scene.ids:
                self._sumo.set_lane_changes(name, mode)
        for name in sorted(held - self._modes.keys()):
            self._modes[name] = self._sumo.hold_lane(name)


def _near_ego(scene: Scene) -> set[int]:
    """Indices of the SVs near the ego; unless it is between two lanes, of those inside the junction."""
    ego, paths = scene.ego, scene.network.paths
    found = near_on_paths(
        ego.x, ego.y, NEAR, abs(scene.ego_offset) < BETWEEN,
        scene.position, scene.size, scene.path, scene.path_s, paths.stop_s, paths.exit_s,
    )  # fmt: skip
    return set(found.tolist())


def _near_props(scene: Scene, props: Sequence[Prop]) -> set[int]:
    """Indices of the SVs near one that moves, and of those inside the junction near a vehicle or obstacle."""
    near = np.zeros(scene.count, bool)
    if not props:
        return set()
    inside = scene.inside
    others = scene.position, scene.heading, scene.size
    for prop in props:
        if not (prop.moves or inside.any()):
            continue
        gaps = rectangle_gaps(*prop.pose(), prop.length, prop.width, *others)
        if prop.kind != Kind.PEDESTRIAN:
            near |= inside & (gaps < NEAR_PROP)
        if prop.moves:
            near |= gaps < NEAR_MOVING
    return set(np.flatnonzero(near & (scene.path >= 0)).tolist())
