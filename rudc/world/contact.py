"""What the ego touches, and how near the nearest thing is, at one instant."""

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
    """m, 0 in contact, inf with nothing around"""
    touched: str | None
    """name of what the ego touches"""


NOTHING = Nearest(math.inf, None)


def nearest_of(
    ego: EgoState, body: EgoVehicle, names: Sequence[str], position: Array, heading: Array, size: Array,
    reach: float = 0.0,
) -> tuple[Nearest, int]:  # fmt: skip
    """What of rectangles with centres (N, 2) m, headings (N,) rad and sizes (N, 2) m is nearest to the ego's.

    And how many of the first of them hold all whose gap is at most `reach` m, and perhaps some more.
    """
    gap, nearest, close = around(
        ego.x, ego.y, ego.psi, body.length, body.width, position, heading, size, reach
    )
    return Nearest(gap, names[nearest] if gap == 0.0 else None), close


def survey(scene: Scene, reach: float) -> tuple[Nearest, int]:
    """`nearest_of` a scene."""
    return nearest_of(scene.ego, scene.vehicle, scene.ids, scene.position, scene.heading, scene.size, reach)
