"""What the ego touches, and how near the nearest thing is, at one instant.

Few bodies are near enough to matter, so this is plain arithmetic on one pair at a time, in a fifteenth of the
time that `rudc.geometry`, which is for arrays, needs for one; the gap is the same: the least of the eight
distances from a corner of one rectangle to the other.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from rudc.vehicle import EgoVehicle
from rudc.world.scene import EgoState, Scene


class Body(NamedTuple):
    """A rectangle: centre in m, direction of its length, half sizes in m."""

    name: str
    x: float
    y: float
    cos: float
    sin: float
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
    return body_of("", state.x, state.y, state.psi, vehicle.length, vehicle.width)


def survey(scene: Scene, ego: Body, reach: float) -> tuple[Nearest, list[Body]]:
    """What is nearest in a scene, and the bodies whose gap to the ego is at most `reach` m, and perhaps some
    more."""
    best, close, others = NOTHING, [], scene.count
    if not others:
        return best, close
    radii = 0.5 * math.hypot(*scene.size.max(axis=0)) + math.hypot(ego.half_length, ego.half_width)
    position, heading, size = scene.position, scene.heading, scene.size
    for i in range(others):  # nearest centre first
        x, y = position[i].tolist()
        least = math.hypot(x - ego.x, y - ego.y) - radii
        if least > reach and least >= best.gap:
            break
        body = body_of(scene.ids[i], x, y, heading.item(i), *size[i].tolist())
        if least <= reach:
            close.append(body)
        if best.gap > 0:
            best = nearer(best, ego, body)
    return best, close


def overlapping(scene: Scene) -> list[tuple[int, int]]:
    """Pairs of the scene's rows, lower first, whose rectangles overlap or touch."""
    if not scene.count:
        return []
    found = []
    reach = math.hypot(*scene.size.max(axis=0))
    places = sorted((x, y, i) for i, (x, y) in enumerate(scene.position.tolist()))
    for rank, (x, y, i) in enumerate(places):
        for other_x, other_y, j in places[rank + 1 :]:
            if other_x - x > reach:
                break
            if abs(other_y - y) <= reach and gap_between(_row(scene, i), _row(scene, j)) == 0:
                found.append((min(i, j), max(i, j)))
    return found


def _row(scene: Scene, i: int) -> Body:
    x, y = scene.position[i].tolist()
    return body_of(scene.ids[i], x, y, scene.heading.item(i), *scene.size[i].tolist())


def body_of(name: str, x: float, y: float, psi: float, length: float, width: float) -> Body:
    """A rectangle by its centre (m, m), heading (rad) and sizes (m)."""
    return Body(name, x, y, math.cos(psi), math.sin(psi), 0.5 * length, 0.5 * width)


def nearer(best: Nearest, ego: Body, other: Body) -> Nearest:
    """The nearest so far, or the other body if that is nearer to the ego."""
    radii = math.hypot(ego.half_length, ego.half_width) + math.hypot(other.half_length, other.half_width)
    if math.hypot(other.x - ego.x, other.y - ego.y) - radii >= best.gap:
        return best
    gap = gap_between(ego, other)
    return best if gap >= best.gap else Nearest(gap, other.name if gap == 0 else None)


def gap_between(a: Body, b: Body) -> float:
    """Gap (m) between two rectangles, 0 where they overlap or touch."""
    dx, dy = b.x - a.x, b.y - a.y
    cos, sin = a.cos * b.cos + a.sin * b.sin, a.cos * b.sin - a.sin * b.cos
    x_a, y_a = dx * a.cos + dy * a.sin, dy * a.cos - dx * a.sin
    x_b, y_b = -dx * b.cos - dy * b.sin, dx * b.sin - dy * b.cos
    length_a, width_a, length_b, width_b = a.half_length, a.half_width, b.half_length, b.half_width
    c, s = abs(cos), abs(sin)
    if (
        abs(x_a) <= length_a + length_b * c + width_b * s
        and abs(y_a) <= width_a + length_b * s + width_b * c
        and abs(x_b) <= length_b + length_a * c + width_a * s
        and abs(y_b) <= width_b + length_a * s + width_a * c
    ):
        return 0.0
    return math.sqrt(
        min(
            _corners_away(x_a, y_a, cos, sin, length_b, width_b, length_a, width_a),
            _corners_away(x_b, y_b, cos, -sin, length_a, width_a, length_b, width_b),
        )
    )


def _corners_away(
    x: float,
    y: float,
    cos: float,
    sin: float,
    length: float,
    width: float,
    box_length: float,
    box_width: float,
) -> float:
    """Least squared distance (m2) from a corner of a rectangle centred at (x, y), turned by (cos, sin), to a
    box.

    All in half sizes; the box lies about the origin along the axes.
    """
    forward_x, forward_y, left_x, left_y = length * cos, length * sin, -width * sin, width * cos
    best = math.inf
    for corner_x, corner_y in (
        (x + forward_x + left_x, y + forward_y + left_y),
        (x + forward_x - left_x, y + forward_y - left_y),
        (x - forward_x + left_x, y - forward_y + left_y),
        (x - forward_x - left_x, y - forward_y - left_y),
    ):
        beyond_x, beyond_y = abs(corner_x) - box_length, abs(corner_y) - box_width
        square = beyond_x * beyond_x if beyond_x > 0 else 0.0
        if beyond_y > 0:
            square += beyond_y * beyond_y
        if square < best:
            best = square
    return best
