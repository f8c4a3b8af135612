"""Who is not seen for a moment is still there.

Sensors miss some now and then, and boxes hide who drives behind them. Once somebody has been seen to come
back, whoever is missing is shown for another KEPT_S where it would be by now: at the speed that it had, along
its path (rudc/safety/prediction.py). To sensors that miss nobody this never happens: who vanishes for them
has gone.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from rudc.safety.prediction import others_later
from rudc.world.scene import Scene

KEPT_S = 1.0
"""s"""


class Memory:
    """Of one episode."""

    def __init__(self) -> None:
        self._last: dict[str, Scene] = {}
        """who was seen within KEPT_S, and the scene in which that was"""
        self._seen_s = -math.inf
        self._misses = False
        """whether sensors have been seen to miss somebody"""

    def see(self, scene: Scene) -> Scene:
        """The scene with those who are missing; called once a decision."""
        before, self._seen_s = self._seen_s, scene.time_s
        for name in scene.ids:
            last = self._last.get(name)
            self._misses = self._misses or (last is not None and last.time_s < before)
            self._last[name] = scene
        missing: dict[float, list[str]] = {}
        for name, last in list(self._last.items()):
            if scene.time_s - last.time_s > KEPT_S:
                del self._last[name]
            elif last is not scene:
                missing.setdefault(last.time_s, []).append(name)
        if not (self._misses and missing):
            return scene
        return _joined(scene, [self._now(names, scene.time_s) for names in missing.values()])

    def _now(self, names: list[str], time_s: float) -> Scene:
        """Those, last seen together, where they would be by now."""
        last = self._last[names[0]]
        rows = [last.ids.index(name) for name in names]
        return others_later(last.only(np.array(rows)), time_s - last.time_s)


def _joined(scene: Scene, others: list[Scene]) -> Scene:
    """The scene with the others of more scenes, nearest first."""
    names = "position", "heading", "velocity", "acceleration", "size", "kind", "path", "path_s"
    all_of = [scene, *others]
    rows = {name: np.concatenate([getattr(one, name) for one in all_of]) for name in names}
    ids = tuple(name for one in all_of for name in one.ids)
    away = rows["position"] - scene.ego_position
    order = np.argsort(np.hypot(away[:, 0], away[:, 1]), kind="stable")
    return replace(scene, ids=ids, **rows).only(order)
