"""Props: things on the road that SUMO does not move: accident vehicles, wrong-way drivers, pedestrians.

A prop stands, or follows a polyline. A vehicle that does stops short of what stands in its way and of
surrounding vehicles (SVs), and goes on when the way is free, but it does not stop for a moving ego: that it
is a hazard is the point. A pedestrian stops only for what is already before its feet. The yielding layer
makes SVs see all props.
"""

from __future__ import annotations

import math

import numpy as np

from rudc.arrays import Array
from rudc.geometry import rectangle_gaps
from rudc.world.scene import STANDING, Kind, Scene

BRAKING = 6.0
"""m/s2, with which a moving prop stops"""
ACCELERATION = 2.0
"""m/s2, with which it goes on"""
CLEARANCE_M = 0.8
"""m, it stops short by at least this"""


class Prop:
    """One of them; angles in rad, lengths in m, speeds in m/s."""

    def __init__(
        self,
        name: str,
        kind: Kind,
        size: tuple[float, float],
        way: Array,
        heading: float = 0.0,
        wanted: float = 0.0,
    ) -> None:
        """`size`: length and width; `way`: (K, 2) m, the polyline its centre follows at speed `wanted`.

        One point is enough for a prop that stands, and `heading` is where it looks then.
        """
        self.name = name
        self.kind = kind
        self.length, self.width = size
        self.wanted = wanted
        self.speed = wanted
        self.travelled = 0.0
        """m along the way"""
        legs = np.diff(way, axis=0)
        self._way = way
        self._free = True
        self._ends = np.cumsum(np.hypot(legs[:, 0], legs[:, 1]))
        self._headings = np.arctan2(legs[:, 1], legs[:, 0]) if wanted > 0 else np.array([heading])

    @property
    def moves(self) -> bool:
        """Whether it follows its way."""
        return self.wanted > 0

    @property
    def finished(self) -> bool:
        """Whether it has come to the end of its way."""
        return self.moves and self.travelled >= self._ends[-1]

    def look_out(self, scene: Scene) -> None:
        """Decide by what is around whether to go on or to stop."""
        self._free = not self.moves or self._way_is_free(scene)

    def step(self, dt: float) -> None:
        """Move on by dt s."""
        if not self.moves:
            return
        brakes = -math.inf if self.kind == Kind.PEDESTRIAN else -BRAKING
        change = (ACCELERATION if self._free else brakes) * dt
        self.speed = min(max(self.speed + change, 0.0), self.wanted)
        self.travelled += self.speed * dt

    def pose(self, ahead: float = 0.0) -> tuple[float, float, float]:
        """Its centre (m, m) and heading (rad), now or `ahead` m along its way."""
        if not self.moves:
            return float(self._way[0, 0]), float(self._way[0, 1]), float(self._headings[0])
        at = self.travelled + ahead
        leg = min(int(np.searchsorted(self._ends, at, side="right")), len(self._headings) - 1)
        psi = float(self._headings[leg])
        back = float(self._ends[leg]) - at
        x, y = self._way[leg + 1]
        return float(x) - back * math.cos(psi), float(y) - back * math.sin(psi), psi

    def _way_is_free(self, scene: Scene) -> bool:
        """Whether the stretch in which it can stop is clear of what stands, and of where SVs come to stand if
        they brake."""
        walks = self.kind == Kind.PEDESTRIAN
        reach = CLEARANCE_M + (0.0 if walks else self.speed**2 / (2 * BRAKING))
        box = (*self.pose(0.5 * (self.length + reach)), reach, self.width)
        ego, body = scene.ego, scene.vehicle
        if walks or ego.v < STANDING:
            here, facing = np.array([[ego.x, ego.y]]), np.array([ego.psi])
            if (rectangle_gaps(*box, here, facing, np.array([[body.length, body.width]])) == 0.0).any():
                return False
        speed = np.hypot(scene.velocity[:, 0], scene.velocity[:, 1])
        way = np.zeros_like(speed) if walks else speed**2 / (2 * BRAKING)
        heeded = np.array([name != self.name for name in scene.ids], dtype=bool)
        if not walks:
            heeded &= (scene.path >= 0) | (speed < STANDING)
        away = scene.position - box[:2]
        rows = np.flatnonzero(heeded & (np.hypot(away[:, 0], away[:, 1]) < reach + way + 10.0))
        course = np.column_stack([np.cos(scene.heading[rows]), np.sin(scene.heading[rows])])
        size = scene.size[rows] + way[rows, None] * (1.0, 0.0)
        position = scene.position[rows] + 0.5 * way[rows, None] * course
        return bool((rectangle_gaps(*box, position, scene.heading[rows], size) > 0.0).all())


def standing(name: str, kind: Kind, x: float, y: float, heading: float, length: float, width: float) -> Prop:
    """A prop that never moves."""
    return Prop(name, kind, (length, width), np.array([[x, y]]), heading)
