"""What the ego touches at one instant, and how near the nearest thing is."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from rudc.arrays import Array
from rudc.vehicle import EgoVehicle
from rudc.world.kernels import around
from rudc.world.scene import EgoState, Scene


class Nearest(NamedTuple):
    """The smallest gap and what is touched."""

    gap: float
    """m, 0 in contact, inf if there is nothing else"""
    touched: str | None
    """name of what the ego touches; None if it touches nothing"""


NOTHING = Nearest(math.inf, None)


def nearest_of(
    ego: EgoState, body: EgoVehicle, names: Sequence[str], position: Array, heading: Array, size: Array,
    reach: float = 0.0,
) -> tuple[Nearest, int]:  # fmt: skip
    """Which of N rectangles is nearest to the ego's rectangle, and how many of the first rows are close.

    The rectangles have centres (N, 2) m, headings (N,) rad and sizes (N, 2) m. Every rectangle whose gap to
    the ego is at most `reach` m is among the first so many rows; others may be among them, too.
    """
    gap, nearest, close = around(
        ego.x, ego.y, ego.psi, body.length, body.width, position, heading, size, reach
    )
    return Nearest(gap, names[nearest] if gap == 0.0 else None), close


def survey(scene: Scene, reach: float) -> tuple[Nearest, int]:
    """As `nearest_of`, for all the others of a scene."""
    return nearest_of(scene.ego, scene.vehicle, scene.ids, scene.position, scene.heading, scene.size, reach)
