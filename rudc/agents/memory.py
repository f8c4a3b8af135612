"""Remembers those who are not seen for a moment.

Sensors miss others now and then, and boxes hide those who drive behind them. Once somebody has vanished and
come back, everybody who vanishes is shown for another KEPT_S, moved along its path at the speed that it had
(rudc/safety/prediction.py). As long as nobody has come back, those who vanish are taken to be gone, so that
the scene of sensors that miss nobody is not changed.
"""

from __future__ import annotations

import math

import numpy as np

from rudc.safety.prediction import others_later
from rudc.world.scene import Scene

KEPT_S = 1.0
"""s, how long somebody who vanishes is shown"""


class Memory:
    """Remembers the others of one episode."""

    def __init__(self) -> None:
        self._last: dict[str, Scene] = {}
        """name of each who was seen within KEPT_S -> scene in which it was seen last"""
        self._seen_s = -math.inf
        self._misses = False
        """whether sensors have been seen to miss somebody"""

    def see(self, scene: Scene) -> Scene:
        """The scene, with those who are missing added; call it once for each decision."""
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
        joined = scene.with_others_of(*(self._now(names, scene.time_s) for names in missing.values()))
        away = joined.position - scene.ego_position
        return joined.only(np.argsort(np.hypot(away[:, 0], away[:, 1]), kind="stable"))

    def _now(self, names: list[str], time_s: float) -> Scene:
        """A scene of those `names`, which were last seen at the same time, where they would be at
        `time_s`.
        """
        last = self._last[names[0]]
        rows = [last.ids.index(name) for name in names]
        return others_later(last.only(np.array(rows)), time_s - last.time_s)
