"""Slippery patches: places where the road grips the ego less than elsewhere."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from rudc.arrays import Array
from rudc.scenario.events.stage import XYHeading

Piece = tuple[XYHeading, tuple[float, float]]
"""a straight piece of a patch: where its middle is, its length and width (m)"""


class Patches:
    """The slippery patches of one episode."""

    def __init__(self) -> None:
        self._laid: dict[str, tuple[Array, float]] = {}
        """name of an event -> the boxes (K, 5) of its patch, and the coefficient of friction there"""
        self.trodden: set[str] = set()
        """names of events on whose patches the ego has been"""

    def __bool__(self) -> bool:
        return bool(self._laid)

    def lay(self, event: str, pieces: Sequence[Piece], friction: float) -> None:
        """Lay the patch of an event."""
        self._laid[event] = np.array([(*place, *size) for place, size in pieces]), friction

    def remove(self, event: str) -> None:
        """Take away the patch of an event, if it has one."""
        self._laid.pop(event, None)

    def boxes(self, event: str) -> tuple[tuple[float, ...], ...]:
        """The boxes of an event's patch: centre x, y (m), heading (rad), length, width (m)."""
        return tuple(map(tuple, self._laid[event][0].tolist())) if event in self._laid else ()

    def tread(self, x: float, y: float) -> float:
        """The least coefficient of friction of the patches at the ego's place (m), inf if there is none; note
        that it has been there."""
        on = [event for event, (boxes, _) in self._laid.items() if _touch(boxes, np.array([[x, y]]))]
        self.trodden.update(on)
        return min((self._laid[event][1] for event in on), default=math.inf)

    def least(self, places: Array) -> float:
        """The least coefficient of friction of the patches at places (K, 2) m, inf if there is none."""
        found = (friction for boxes, friction in self._laid.values() if _touch(boxes, places))
        return min(found, default=math.inf)


def _touch(boxes: Array, places: Array) -> bool:
    """Whether some of the places (K, 2) m is on some of the boxes (L, 5)."""
    away, psi = places[:, None] - boxes[:, :2], boxes[:, 2]
    along = away[..., 0] * np.cos(psi) + away[..., 1] * np.sin(psi)
    beside = away[..., 1] * np.cos(psi) - away[..., 0] * np.sin(psi)
    return bool(((np.abs(along) <= 0.5 * boxes[:, 3]) & (np.abs(beside) <= 0.5 * boxes[:, 4])).any())
