"""Remembers those who are not seen for a moment.

Sensors miss others now and then, and boxes hide those who drive behind them. Once somebody has vanished and
come back, or a vehicle has vanished in plain sight, everybody who vanishes is shown for another KEPT_S, moved
along its path at the speed that it had (rudc/safety/prediction.py), and for twice the longest time after
which somebody came back if that is more, up to LONGEST_S. Until then those who vanish are taken to be gone,
so that the scene of sensors that miss nobody is not changed. A vehicle vanishes in plain sight where no box
hides it, and both the sensors' reach and its path go on for END_M or more.

Where nobody at all has been seen for SURE_S, though somebody should be, the ego is `blind`, until it sees
somebody, or for HOLD_S; those who were there are shown for LONGEST_S.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from rudc.agents.hidden import sees
from rudc.safety.prediction import others_later
from rudc.world.scene import Scene

KEPT_S, LONGEST_S = 1.0, 3.0
"""s, s: how long somebody who vanishes is shown, at least and at most"""
HOLD_S = 10.0
"""s after which an ego that sees nobody takes the roads for empty"""
SURE_S = 0.25
"""s for which nobody is seen before the ego counts as blind: sensors miss a single vehicle now and then"""
END_M = 10.0
"""m before the end of its path or of the sensors' reach, from which on a vehicle that vanishes may have left
"""


class Memory:
    """Remembers the others of one episode."""

    def __init__(self) -> None:
        self._last: dict[str, Scene] = {}
        """name of each who was seen within LONGEST_S -> scene in which it was seen last"""
        self._seen_s = -math.inf
        self._longest_s = 0.0
        """s, the longest time after which somebody came back"""
        self._misses = False
        """whether sensors have been seen to miss somebody"""
        self._blind_since = math.inf
        self.blind = False
        """whether nobody is seen, though somebody should be: the sensors may have failed"""

    def see(self, scene: Scene) -> Scene:
        """The scene, with those who are missing added; call it once for each decision."""
        before, self._seen_s = self._seen_s, scene.time_s
        for name in scene.ids:
            last = self._last.get(name)
            if last is not None and last.time_s < before:
                self._misses, gap_s = True, scene.time_s - last.time_s
                self._longest_s = max(self._longest_s, gap_s)
            self._last[name] = scene
        kept_s = max(KEPT_S, min(2.0 * self._longest_s, LONGEST_S))
        if self.blind and scene.count == 0:
            kept_s = LONGEST_S
        missing: dict[float, list[str]] = {}
        for name, last in list(self._last.items()):
            if scene.time_s - last.time_s > LONGEST_S:
                del self._last[name]
            elif last is not scene and scene.time_s - last.time_s <= kept_s:
                missing.setdefault(last.time_s, []).append(name)
        if before in missing and not self._misses:
            self._misses = self._in_plain_sight(missing[before], scene)
        unseen_s = scene.time_s - max(missing, default=math.inf)
        if scene.count > 0:
            self._blind_since = math.inf
        elif (self._blind_since == math.inf and unseen_s > SURE_S) and any(
            self._in_plain_sight(names, scene) for names in missing.values()
        ):
            self._blind_since = scene.time_s
        self.blind = 0.0 <= scene.time_s - self._blind_since <= HOLD_S
        self._misses = self._misses or self.blind
        if not (self._misses and missing):
            return scene
        joined = scene.with_others_of(*(self._now(names, scene.time_s) for names in missing.values()))
        away = joined.position - scene.ego_position
        return joined.only(np.argsort(np.hypot(away[:, 0], away[:, 1]), kind="stable"))

    def _in_plain_sight(self, names: list[str], scene: Scene) -> bool:
        """Whether any of the vehicles of these names, seen last at one time, should be seen now."""
        should = self._now(names, scene.time_s)
        drives = np.flatnonzero(should.path >= 0)
        goes_on = scene.network.paths.length[should.path[drives]] - should.path_s[drives] > END_M
        near = replace(scene, sight_m=scene.sight_m - END_M)
        return bool((sees(near, should.position[drives]) & goes_on).any())

    def _now(self, names: list[str], time_s: float) -> Scene:
        """A scene of those `names`, which were last seen at the same time, where they would be at
        `time_s`.
        """
        last = self._last[names[0]]
        rows = [last.ids.index(name) for name in names]
        return others_later(last.only(np.array(rows)), time_s - last.time_s)
