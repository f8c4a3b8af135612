"""Road users as shapes: each kind has its own, and all show which way they head. Events' numbers beside."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from rudc.arrays import Array
from rudc.drawing.canvas import FINE, Canvas
from rudc.drawing.palette import (
    BRAKE_LIGHT,
    EGO,
    EVENT,
    FAINT_TEXT,
    GLASS,
    INK,
    PAPER,
    SENSED,
    SHADOW,
    TRAFFIC,
    Colour,
    faint,
)
from rudc.drawing.text import font
from rudc.world.scene import Kind, Scene

if TYPE_CHECKING:
    from rudc.drawing.view import ShownEvent

_Points = list[tuple[float, float]]


def _both(points: _Points) -> list[_Points]:
    """A shape on the left side, and the same on the right."""
    return [points, [(x, -y) for x, y in points]]


_FRONT: _Points = [(0.44, 0.5), (0.5, 0.3), (0.5, -0.3), (0.44, -0.5)]
_BACK: _Points = [(-0.46, -0.5), (-0.5, -0.36), (-0.5, 0.36), (-0.46, 0.5)]
BODY: Array = np.array([*_FRONT, *_BACK])
"""(8, 2) a vehicle's outline in its lengths (front positive) and widths (left positive)"""
BRAKE_LIGHTS = _both([(-0.5, 0.46), (-0.45, 0.46), (-0.45, 0.2), (-0.5, 0.2)])
BLINKERS: list[_Points] = [
    [(0.51, 0.66), (0.38, 0.66), (0.38, 0.3), (0.51, 0.3)],
    [(-0.38, 0.66), (-0.51, 0.66), (-0.51, 0.3), (-0.38, 0.3)],
]
"""of the left side, front and back, larger than life"""
DARK_PARTS: dict[Kind, list[_Points]] = {
    Kind.CAR: [
        [(0.24, 0.4), (0.08, 0.34), (0.08, -0.34), (0.24, -0.4)],
        [(-0.36, 0.34), (-0.27, 0.3), (-0.27, -0.3), (-0.36, -0.34)],
    ],
    Kind.TRUCK: [
        [(0.46, 0.36), (0.38, 0.36), (0.38, -0.36), (0.46, -0.36)],
        [(0.26, 0.5), (0.23, 0.5), (0.23, -0.5), (0.26, -0.5)],
    ],
    Kind.BUS: [
        [(0.48, 0.4), (0.43, 0.4), (0.43, -0.4), (0.48, -0.4)],
        *_both([(0.38, 0.46), (0.38, 0.34), (-0.46, 0.34), (-0.46, 0.46)]),
    ],
    Kind.MOTORCYCLE: [[(0.18, 0.4), (0.02, 0.5), (0.02, -0.5), (0.18, -0.4)]],
    Kind.BICYCLE: [[(0.12, 0.4), (-0.06, 0.5), (-0.06, -0.5), (0.12, -0.4)]],
    Kind.OBSTACLE: [[(x + 0.06, 0.5), (x - 0.02, -0.5), (x + 0.06, -0.5), (x + 0.14, 0.5)] for x in
                    (-0.46, -0.26, -0.06, 0.14, 0.34)],
}  # fmt: skip
"""dark parts of each kind: windows, the gap behind a cab, riders, the stripes of a barrier"""
HAS_LIGHTS = (Kind.CAR, Kind.TRUCK, Kind.BUS)
BRAKES_MPS2, STANDS_MPS = -0.7, 0.3
"""m/s2, m/s: below which brake lights are lit"""

PEDESTRIAN_M = 0.6
"""m, radius of the disc that stands for a pedestrian, larger than life"""
EDGE_M = 0.16
"""m, width of outlines"""
BADGE_PX, BADGE_TEXT_PX = 8.5, 12.0
"""pixels of the picture: radius of an event's number, height of its digits"""
BESIDE_M = 2.0
"""m around a body: nothing that is drawn of it (edge, shadow, where a pedestrian goes) lies farther out"""


def placed(shape: Array, position: Array, heading: Array, size: Array) -> Array:
    """(N, K, 2) m, a shape (K, 2) put at positions (N, 2) m, headings (N,) rad, in sizes (N, 2) m."""
    cos, sin = np.cos(heading)[:, None], np.sin(heading)[:, None]
    along, across = shape[:, 0] * size[:, :1], shape[:, 1] * size[:, 1:]
    turned = np.stack([along * cos - across * sin, along * sin + across * cos], axis=-1)
    return position[:, None] + turned


@cache
def _parts(kind: Kind) -> tuple[Array, tuple[slice, ...], tuple[slice, ...]]:
    """All points (K, 2) of a kind's shape; where in them its dark parts are, and its brake lights."""
    shapes, spans, n = [BODY], [], len(BODY)
    lights = BRAKE_LIGHTS if kind in HAS_LIGHTS else []
    for part in (*DARK_PARTS[kind], *lights):
        shapes.append(np.array(part))
        spans.append(slice(2 * n, 2 * (n + len(part))))
        n += len(part)
    dark = len(DARK_PARTS[kind])
    return np.concatenate(shapes), tuple(spans[:dark]), tuple(spans[dark:])


def draw_others(
    canvas: Canvas, scene: Scene, involved: Collection[str], hidden: Collection[str] = ()
) -> None:
    """Everybody but the ego. `involved`: who takes part in an event; `hidden`: whom the ego does not see."""
    in_view = canvas.holds(scene.position, 0.5 * np.hypot(*scene.size.T) + BESIDE_M)
    braking = (scene.acceleration < BRAKES_MPS2) | (scene.speed < STANDS_MPS)
    for kind in Kind:
        rows = np.flatnonzero((scene.kind == int(kind)) & in_view)
        if not len(rows):
            continue
        if kind is Kind.PEDESTRIAN:
            for i in rows:
                colour = EVENT if scene.ids[i] in involved else TRAFFIC
                _draw_pedestrian(canvas, scene, int(i), colour, seen=scene.ids[i] not in hidden)
            continue
        shape, dark, lights = _parts(kind)
        flat = canvas.pixels(placed(shape, scene.position[rows], scene.heading[rows], scene.size[rows]))
        for i, points in zip(rows, flat.reshape(len(rows), -1).tolist(), strict=True):
            colour = EVENT if scene.ids[i] in involved else TRAFFIC
            lit = lights if braking[i] and kind is not Kind.OBSTACLE else ()
            _draw_body(canvas, points, colour, dark, lit, seen=scene.ids[i] not in hidden)


def draw_ego(canvas: Canvas, scene: Scene) -> None:
    """The ego."""
    ego, body = scene.ego, scene.vehicle
    shape, dark, lights = _parts(Kind.CAR)
    place = np.array([[ego.x, ego.y]]), np.array([ego.psi]), np.array([[body.length, body.width]])
    points = canvas.pixels(placed(shape, *place)).ravel().tolist()
    braking = ego.acceleration < BRAKES_MPS2 or ego.v < STANDS_MPS
    _draw_body(canvas, points, EGO, dark, lights if braking else (), seen=True)


def draw_sensed(canvas: Canvas, perceived: Scene, rows: Iterable[int]) -> None:
    """Outlines of those in these rows of what the ego's sensors show."""
    for k in rows:
        shape = placed(
            BODY, perceived.position[k : k + 1], perceived.heading[k : k + 1], perceived.size[k : k + 1]
        )
        canvas.outline(shape[0], SENSED, 0.2)


def _draw_badge(canvas: Canvas, place: Array, text: str, *, there: bool = True) -> None:
    """An event's number, or several, centred on a place (2,) m; grey where nothing of the event is there
    yet.
    """
    (px, py), r = canvas.pixels(place).tolist(), BADGE_PX * FINE
    letters = font(BADGE_TEXT_PX * FINE)
    half = max(r, 0.5 * letters.getlength(text) + 0.5 * r)
    box, edge = (px - half, py - r, px + half, py + r), round(1.4 * FINE)
    canvas.draw.rounded_rectangle(
        box, radius=r, fill=PAPER, outline=EVENT if there else FAINT_TEXT, width=edge
    )
    ink = INK if there else (110, 116, 124)
    canvas.draw.text((px, py), text, fill=ink, font=letters, anchor="mm")


def draw_marks(canvas: Canvas, events: Iterable[ShownEvent]) -> None:
    """The numbers of events at the places they mark; in one badge where two of a colour would overlap."""
    marks: list[tuple[Array, bool, list[str]]] = []
    near = 2 * BADGE_PX * FINE / canvas.scale
    for event in events:
        for place in map(np.array, event.places):
            for at, waits, numbers in marks:
                if np.hypot(*(at - place)) < near and waits == event.waits:
                    if str(event.number) not in numbers:
                        numbers.append(str(event.number))
                    break
            else:
                marks.append((place, event.waits, [str(event.number)]))
    for at, waits, numbers in marks:
        _draw_badge(canvas, at, ",".join(numbers), there=not waits)


def draw_badges(canvas: Canvas, scene: Scene, numbers: Mapping[str, str]) -> None:
    """The numbers of its events beside everybody in `numbers` (name -> text) who is in view: beside the
    middle, or, where that is not in view, where the body comes nearest to the view's centre.
    """
    away = (BADGE_PX * FINE + 3) / canvas.scale
    for i, name in enumerate(scene.ids):
        if name not in numbers:
            continue
        place = scene.position[i]
        if not canvas.holds(place):
            place = _nearest_to(canvas.centre, place, float(scene.heading[i]), float(scene.size[i, 0]))
        if canvas.holds(place):
            aside = 0.35 * float(scene.size[i].min()) + away
            _draw_badge(canvas, place + 0.8 * aside, numbers[name])


def _nearest_to(target: Array, position: Array, heading: float, length: float) -> Array:
    """(2,) m, the place on a body's axis that is nearest to a target (2,) m."""
    course = np.array([np.cos(heading), np.sin(heading)])
    return position + np.clip((target - position) @ course, -0.5 * length, 0.5 * length) * course


def _draw_body(
    canvas: Canvas,
    points: list[float],
    colour: Colour,
    dark: tuple[slice, ...],
    lights: tuple[slice, ...],
    *,
    seen: bool,
) -> None:
    """A vehicle or an obstacle, `points` in pixels, x and y in turn; only its outline where not seen."""
    draw, body = canvas.draw, points[: 2 * len(BODY)]
    edge = max(round(EDGE_M * canvas.scale), 1)
    if not seen:
        draw.polygon(body, fill=faint(colour, 50))
        draw.line([*body, *body[:4]], fill=faint(colour, 200), width=edge)
        return
    shift = 0.35 * canvas.scale
    draw.polygon([v + shift for v in body], fill=SHADOW)
    draw.polygon(body, fill=colour)
    for span in dark:
        draw.polygon(points[span], fill=GLASS)
    for span in lights:
        draw.polygon(points[span], fill=BRAKE_LIGHT)
    draw.line([*body, *body[:4]], fill=INK if colour is not EVENT else PAPER, width=edge)


def _draw_pedestrian(canvas: Canvas, scene: Scene, i: int, colour: Colour, *, seen: bool) -> None:
    """A disc, and a dark tick that points the way the pedestrian walks."""
    (x, y), psi = scene.position[i].tolist(), float(scene.heading[i])
    if not seen:
        canvas.ring(x, y, PEDESTRIAN_M, faint(colour, 200), EDGE_M)
        return
    canvas.dot(x, y, PEDESTRIAN_M + EDGE_M, PAPER)
    canvas.dot(x, y, PEDESTRIAN_M, colour)
    tip = np.array([[x, y], [x + np.cos(psi), y + np.sin(psi)]])
    canvas.line(tip, INK, 0.25)
