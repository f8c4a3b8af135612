"""Remembers those who are not seen for a moment.

Sensors miss others now and then, and boxes hide those who drive behind them. Once somebody has vanished and
come back within KEPT_S, or a vehicle has vanished in plain sight, everybody who vanishes is shown for another
KEPT_S, moved along its path at the speed that it had (rudc/safety/prediction.py); or, if that is longer, for
twice the longest time for which the sensors have missed somebody, LONGEST_S at most. Until then those who
vanish are taken to be gone, so that the scene of sensors that miss nobody is not changed. A vehicle vanishes
in plain sight where no box hides it, and both the sensors' reach and its path go on for END_M or more.

Where nobody at all has been seen for SURE_S, though somebody who vanished in plain sight should be, the ego
is `blind` until it sees somebody, for HOLD_S at most; those who were there are shown for LONGEST_S.
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
        self._names: set[str] = set()
        """names of those in the scene before"""
        self._last: dict[str, Scene] = {}
        """name of each who was seen within LONGEST_S -> scene in which it was seen last"""
        self._lost: set[str] = set()
        """names of those of them who vanished in plain sight"""
        self._seen_s = -math.inf
        self._misses = False
        """whether sensors have been seen to miss somebody"""
        self._longest_s = 0.0
        """s, the longest time for which they did"""
        self._blind_since = math.inf
        self.blind = False
        """whether nobody is seen, though somebody should be: the sensors may have failed"""

    def see(self, scene: Scene) -> Scene:
        """The scene, with those who are missing added; call it once for each decision."""
        before, self._seen_s = self._seen_s, scene.time_s
        names = set(scene.ids)
        for name in names - self._names:
            self._find(name, scene, before)
        self._names = names
        self._last.update(dict.fromkeys(scene.ids, scene))
        missing = self._missing(scene)
        if lost := self._in_plain_sight(missing.get(before, []), scene):
            self._misses = True
            self._lost |= lost
        self._notice_failure(scene, missing)
        if not self._misses:
            return scene
        kept_s = LONGEST_S if self.blind else max(KEPT_S, min(2.0 * self._longest_s, LONGEST_S))
        kept = [names for time_s, names in missing.items() if scene.time_s - time_s <= kept_s]
        if not kept:
            return scene
        return scene.with_others_of(*(self._now(names, scene.time_s) for names in kept))

    def _find(self, name: str, scene: Scene, before: float) -> None:
        """Somebody who was not in the scene before, at `before` s, is seen."""
        last = self._last.get(name)
        if last is not None:
            self._misses = self._misses or before - last.time_s <= KEPT_S
            if name in self._lost:
                self._longest_s = max(self._longest_s, scene.time_s - last.time_s)
        self._lost.discard(name)

    def _missing(self, scene: Scene) -> dict[float, list[str]]:
        """Names of those who are not seen, by the time (s) when they were seen last; those who have not been
        seen for LONGEST_S are forgotten."""
        missing: dict[float, list[str]] = {}
        for name in [name for name in self._last if name not in self._names]:
            seen_s = self._last[name].time_s
            if scene.time_s - seen_s > LONGEST_S:
                del self._last[name]
                self._lost.discard(name)
            else:
                missing.setdefault(seen_s, []).append(name)
        return missing

    def _notice_failure(self, scene: Scene, missing: dict[float, list[str]]) -> None:
        """Find out whether the ego is blind; `missing`: names by the time (s) when they were seen last."""
        if scene.count > 0:
            self._blind_since, self.blind = math.inf, False
            return
        unseen_s = scene.time_s - max(missing, default=math.inf)
        if (self._blind_since == math.inf and SURE_S < unseen_s <= KEPT_S) and any(
            self._lost & self._in_plain_sight(names, scene) for names in missing.values()
        ):
            self._blind_since = scene.time_s
        self.blind = 0.0 <= scene.time_s - self._blind_since <= HOLD_S

    def _in_plain_sight(self, names: list[str], scene: Scene) -> set[str]:
        """Those of the vehicles of these `names`, seen last at one time, who should be seen now."""
        if not names:
            return set()
        should = self._now(names, scene.time_s)
        drives = np.flatnonzero(should.path >= 0)
        goes_on = scene.network.paths.length[should.path[drives]] - should.path_s[drives] > END_M
        near = replace(scene, sight_m=scene.sight_m - END_M)
        visible = drives[sees(near, should.position[drives]) & goes_on]
        return {should.ids[row] for row in visible}

    def _now(self, names: list[str], time_s: float) -> Scene:
        """A scene of those `names`, which were last seen at the same time, where they would be at
        `time_s`.
        """
        last = self._last[names[0]]
        rows = [last.ids.index(name) for name in names]
        return others_later(last.only(np.array(rows)), time_s - last.time_s)
