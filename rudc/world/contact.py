"""What the ego touches, and how near the nearest thing is, at one instant."""

from __future__ import annotations

import cmath
import math
from typing import NamedTuple

from rudc.kernels import rectangle_gap
from rudc.vehicle import EgoVehicle
from rudc.world.kernels import around
from rudc.world.scene import EgoState, Scene


class Body(NamedTuple):
    """A rectangle: centre in m, direction of its length, half sizes in m."""

    name: str
    place: complex
    facing: complex
    half_length: float
    half_width: float


class Nearest(NamedTuple):
    """The smallest gap and what is touched."""

    gap: float
    """m, 0 in contact, inf with nothing around"""
    touched: str | None
    """name of what the ego touches"""


NOTHING = Nearest(math.inf, None)


def ego_body(state: EgoState, vehicle: EgoVehicle) -> Body:
    """The ego's rectangle."""
    facing = cmath.rect(1.0, state.psi)
    return Body("", complex(state.x, state.y), facing, 0.5 * vehicle.length, 0.5 * vehicle.width)


def survey(scene: Scene, reach: float) -> tuple[Nearest, list[Body]]:
    """What is nearest in a scene, and the bodies whose gap to the ego is at most `reach` m, and perhaps some
    more."""
    ego, body = scene.ego, scene.vehicle
    gap, nearest, close = around(
        ego.x, ego.y, ego.psi, body.length, body.width, scene.position, scene.heading, scene.size, reach
    )
    bodies = [_row(scene, i) for i in range(close)]
    return Nearest(gap, scene.ids[nearest] if gap == 0.0 else None), bodies


def _row(scene: Scene, i: int) -> Body:
    (x, y), (length, width) = scene.position[i].tolist(), scene.size[i].tolist()
    facing = cmath.rect(1.0, scene.heading.item(i))
    return Body(scene.ids[i], complex(x, y), facing, 0.5 * length, 0.5 * width)


def nearer(best: Nearest, ego: Body, other: Body) -> Nearest:
    """The nearest so far, or the other body if that is nearer to the ego."""
    gap = gap_between(ego, other)
    return best if gap >= best.gap else Nearest(gap, other.name if gap == 0.0 else None)


def gap_between(a: Body, b: Body) -> float:
    """Gap (m) between two rectangles, 0 where they overlap or touch."""
    return rectangle_gap(
        b.place - a.place, a.facing, b.facing, a.half_length, a.half_width, b.half_length, b.half_width
    )
