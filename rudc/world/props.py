"""Props: things on the road that SUMO does not move: accident vehicles, wrong-way drivers, pedestrians.

A prop follows a polyline at a constant speed, or stands. The yielding layer makes SVs see it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rudc.world.scene import Array, Kind


@dataclass(slots=True)
class Prop:
    """One of them; angles in rad, lengths in m, speed in m/s."""

    name: str
    kind: Kind
    length: float
    width: float
    way: Array
    """(K, 2) m, the polyline its centre follows"""
    heading: float
    """rad, used while it stands"""
    speed: float = 0.0
    travelled: float = 0.0
    """m along the way"""

    @property
    def finished(self) -> bool:
        """Whether a moving prop has come to the end of its way."""
        return self.speed > 0 and self.travelled >= _length(self.way)

    def step(self, dt: float) -> None:
        """Move on by dt s."""
        self.travelled += self.speed * dt

    def pose(self) -> tuple[float, float, float]:
        """Its centre (m, m) and heading (rad)."""
        if self.speed == 0 and self.travelled == 0:
            return float(self.way[0, 0]), float(self.way[0, 1]), self.heading
        legs = np.diff(self.way, axis=0)
        lengths = np.hypot(legs[:, 0], legs[:, 1])
        ends = np.cumsum(lengths)
        leg = min(int(np.searchsorted(ends, self.travelled, side="right")), len(legs) - 1)
        share = (self.travelled - (ends[leg] - lengths[leg])) / lengths[leg]
        x, y = self.way[leg] + min(share, 1.0) * legs[leg]
        return float(x), float(y), float(np.arctan2(legs[leg, 1], legs[leg, 0]))


def standing(name: str, kind: Kind, x: float, y: float, heading: float, length: float, width: float) -> Prop:
    """A prop that never moves."""
    return Prop(name, kind, length, width, np.array([[x, y]]), heading)


def _length(way: Array) -> float:
    legs = np.diff(way, axis=0)
    return float(np.hypot(legs[:, 0], legs[:, 1]).sum())
