"""Finds who stands, and where, although the ego's sensors have noise and gaps.

    stands    a body stands from the time when its speed falls below STILL until its speed, averaged over
              SETTLE_S, exceeds MOVES, or until it is seen more than AWAY m from where it stood
    where     it stands at the mean of where it was seen, over about the last MOST sightings
    unseen    it is taken to be there for another MEMORY_S after it was last seen

With perfect sensors this changes only one thing: that somebody has set off is recognised a second later.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from rudc.agents.kernels import any_slower
from rudc.world.scene import STILL, Scene

MOVES, SETTLE_S = 0.5, 1.0
"""m/s, s: a body whose speed, averaged over the second, exceeds the first does not stand any more"""
AWAY = 1.5
"""m, a body that is seen farther than this from where it stood does not stand any more"""
MOST = 30
MEMORY_S = 1.5
"""s, how long a body that is not seen is remembered"""


@dataclass(slots=True)
class _Sighted:
    """A body that stands."""

    scene: Scene
    """scene in which it was seen last"""
    row: int
    """its row among the others of that scene"""
    place: complex
    """m, mean position"""
    facing: complex
    """mean direction"""
    speed: float
    """m/s, mean, negative for backwards"""
    count: int
    """number of sightings, at most MOST"""


class Standing:
    """Finds who stands in one episode."""

    def __init__(self) -> None:
        self._known: dict[str, _Sighted] = {}
        self._seen_s = -math.inf

    def look(self, scene: Scene) -> Scene:
        """The scene in which those who stand have their mean position and direction and speed 0; the scene
        itself if nobody stands. Call it once for each decision.
        """
        passed, self._seen_s = max(scene.time_s - self._seen_s, 0.0), scene.time_s
        if not self._known and not any_slower(scene.velocity, STILL):
            return scene
        speed = scene.speed
        for i, (name, now) in enumerate(zip(scene.ids, speed.tolist(), strict=True)):
            if now < STILL or name in self._known:
                self._sight(scene, i, now, passed)
        for name, one in list(self._known.items()):
            if scene.time_s - one.scene.time_s > MEMORY_S:
                del self._known[name]
        return self._as_known(scene) if self._known else scene

    def _sight(self, scene: Scene, i: int, speed: float, passed: float) -> None:
        """Take in a sighting of the other in row i, at `speed` m/s, `passed` s after the last decision."""
        name, psi = scene.ids[i], float(scene.heading[i])
        place, facing = complex(*scene.position[i]), complex(math.cos(psi), math.sin(psi))
        one = self._known.get(name)
        if one is not None:
            ahead = float(scene.velocity[i, 0]) * facing.real + float(scene.velocity[i, 1]) * facing.imag
            one.speed += (ahead - one.speed) * min(passed / SETTLE_S, 1.0)
            if abs(one.speed) <= MOVES and abs(place - one.place) <= AWAY:
                one.count = min(one.count + 1, MOST)
                one.place += (place - one.place) / one.count
                one.facing += (facing - one.facing) / one.count
                one.scene, one.row = scene, i
                return
            del self._known[name]
        if speed < STILL:
            self._known[name] = _Sighted(scene, i, place, facing, 0.0, 1)

    def _as_known(self, scene: Scene) -> Scene:
        """The scene with those who are known to stand at their mean positions, unseen ones added."""
        seen = set(scene.ids)
        for name, one in self._known.items():
            if name not in seen:
                scene = scene.with_others_of(one.scene.only(np.array([one.row])))
        position, heading, velocity = scene.position.copy(), scene.heading.copy(), scene.velocity.copy()
        for i, name in enumerate(scene.ids):
            one = self._known.get(name)
            if one is not None:
                position[i] = one.place.real, one.place.imag
                heading[i], velocity[i] = math.atan2(one.facing.imag, one.facing.real), 0.0
        return replace(scene, position=position, heading=heading, velocity=velocity)
