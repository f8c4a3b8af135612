"""Who stands, and where, through noise and gaps of the ego's sensors.

    stands    from when its speed falls below STILL, until its speed, averaged over SETTLE_S, exceeds MOVES or
              it is seen more than AWAY m from where it stood
    where     the mean of where it was seen, of the last MOST sightings or so
    unseen    it is still there for MEMORY_S

To sensors without flaws that is what they show, but for one who sets off: that is believed a second later.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from rudc.agents.kernels import any_slower
from rudc.world.scene import STILL, Scene

MOVES, SETTLE_S = 0.5, 1.0
"""m/s, s"""
AWAY = 1.5
"""m"""
MOST = 30
MEMORY_S = 1.5
"""s"""


@dataclass(slots=True)
class _Sighted:
    """One who stands."""

    scene: Scene
    """in which it was seen last"""
    row: int
    """of the others there"""
    place: complex
    """m, mean"""
    facing: complex
    """direction, mean"""
    speed: float
    """m/s, mean, negative backwards"""
    count: int
    """sightings"""


class Standing:
    """Watches one episode."""

    def __init__(self) -> None:
        self._known: dict[str, _Sighted] = {}
        self._seen_s = -math.inf

    def look(self, scene: Scene) -> Scene:
        """The scene with those who stand at rest where they stand, itself where nobody does; called once a
        decision.
        """
        passed, self._seen_s = max(scene.time_s - self._seen_s, 0.0), scene.time_s
        if not self._known and not any_slower(scene.velocity, STILL):
            return scene
        speed = np.hypot(scene.velocity[:, 0], scene.velocity[:, 1])
        for i, (name, now) in enumerate(zip(scene.ids, speed.tolist(), strict=True)):
            if now < STILL or name in self._known:
                self._sight(scene, i, now, passed)
        for name, one in list(self._known.items()):
            if scene.time_s - one.scene.time_s > MEMORY_S:
                del self._known[name]
        return self._as_known(scene) if self._known else scene

    def _sight(self, scene: Scene, i: int, speed: float, passed: float) -> None:
        """Take note of the other in row i, at `speed` m/s, `passed` s after the last time."""
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
        """The scene with those known to stand as they are known."""
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
