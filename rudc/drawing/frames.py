"""Frames of an episode, seen from above, with a caption.

    frame = Renderer(network).frame(view_of(world))          # (600, 600, 3) uint8

Drawn with Pillow; some ms a frame, no display needed.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from rudc.drawing.bodies import draw_badges, draw_ego, draw_marks, draw_others, draw_sensed
from rudc.drawing.canvas import FINE, Canvas, cut
from rudc.drawing.caption import correction_line, events_lines, state_line, title
from rudc.drawing.overlays import draw_constraints, draw_patch, draw_path, draw_sensor_reach, draw_way
from rudc.drawing.palette import (
    ACTIVE,
    EVENT,
    EVENT_TEXT,
    FAINT_TEXT,
    INK,
    OUTCOMES,
    PAPER,
    TEXT,
    faint,
)
from rudc.drawing.road_picture import RoadPicture, draw_road
from rudc.drawing.text import Line, font, panel, panel_height
from rudc.drawing.view import Driving, View
from rudc.network.network import Network
from rudc.world.scene import Scene

Frame = NDArray[np.uint8]

MARGIN_M = 12.0
"""m of view kept around the ego"""
VIEW_M = 110.0
"""m across a frame"""
REACH_M = 170.0
"""m of road each way from the middle of a picture of it: some 40 MB"""
BAR_M = 10.0
"""m, length of the scale's bar"""


def draw_view(canvas: Canvas, view: View, driving: Driving) -> None:
    """Everything that is on the road, over a picture of it (`shaded` if the view's sensors are limited)."""
    scene, numbers = view.truth, view.numbers
    draw_sensor_reach(canvas, view)
    for event in view.events:
        draw_patch(canvas, event.patch)
    draw_path(canvas, scene)
    draw_others(canvas, scene, numbers, view.hidden)
    if view.perceived is not None:
        draw_sensed(canvas, view.perceived, view.misplaced)
    draw_ego(canvas, scene)
    draw_constraints(canvas, scene, driving)
    for event in view.events:
        if event.way is not None:
            draw_way(canvas, event.way)
    draw_marks(canvas, view.events)
    draw_badges(canvas, scene, numbers)


class Renderer:
    """Draws views of one network."""

    def __init__(self, network: Network, size: int = 600) -> None:
        """`size`: pixels along each side of a frame."""
        self._network = network
        self._size = size
        self._text = size / 41
        self._road: tuple[tuple[float, float], RoadPicture] | None = None
        self._empty: tuple[tuple[float, float, int], Canvas] | None = None

    def frame(self, view: View, driving: Driving | None = None) -> Frame:
        """(size, size, 3) picture of a view: a caption of three lines, and more for events, and below it
        the road. `driving`: what the driver says of itself, if it does.
        """
        driving = driving or Driving()
        lines = _caption(view, driving)
        above = panel_height(len(lines), self._text)
        canvas = self._view_of_road(view.truth, self._size - above).copy(shaded=view.sensors_limited)
        draw_view(canvas, view, driving)
        picture = Image.new("RGB", (self._size, self._size))
        picture.paste(panel(lines, self._size, self._text), (0, 0))
        picture.paste(canvas.image.reduce(FINE), (0, above))
        self._draw_bar(picture)
        if view.outcome:
            self._announce(picture, view.outcome, above)
        return np.asarray(picture)

    def _view_of_road(self, scene: Scene, height: int) -> Canvas:
        """The part of the road in view: about the junction's centre, moved so that the ego is in it."""
        per_m, centre, ego = self._size / VIEW_M, self._network.center, scene.ego
        half_x, half_y = 0.5 * VIEW_M, 0.5 * height / per_m
        x = min(max(float(centre[0]), ego.x - half_x + MARGIN_M), ego.x + half_x - MARGIN_M)
        y = min(max(float(centre[1]), ego.y - half_y + MARGIN_M), ego.y + half_y - MARGIN_M)
        key = x - half_x, y + half_y, height
        if self._empty is None or self._empty[0] != key:
            self._empty = (key, cut(self._road_about(x, y), key[:2], FINE * self._size, FINE * height))
        return self._empty[1]

    def _road_about(self, x: float, y: float) -> RoadPicture:
        """A picture of the road that holds the view about (x, y) m: the one about the junction, where that
        does, else one of those beside it. A picture of all the road would be too large where arms are long.
        """
        apart = 2.0 * REACH_M - VIEW_M
        centre = self._network.center.tolist()
        middle = round((x - centre[0]) / apart) * apart, round((y - centre[1]) / apart) * apart
        if self._road is None or self._road[0] != middle:
            scale = FINE * self._size / VIEW_M
            self._road = middle, draw_road(self._network, scale, REACH_M, middle)
        return self._road[1]

    def _draw_bar(self, picture: Image.Image) -> None:
        """The scale: a bar and its length."""
        side, draw = self._size, ImageDraw.Draw(picture)
        length, pad = BAR_M * self._size / VIEW_M, side / 40
        right, y = side - pad, side - pad
        draw.line((right - length, y, right, y), fill=INK, width=max(side // 300, 1))
        for x in (right - length, right):
            draw.line((x, y - side / 120, x, y), fill=INK, width=max(side // 300, 1))
        middle = (right - 0.5 * length, y - side / 150)
        draw.text(
            middle, f"{BAR_M:.0f} m", fill=INK, font=font(0.9 * self._text), anchor="mb",
            stroke_width=max(side // 300, 1), stroke_fill=PAPER,
        )  # fmt: skip

    def _announce(self, picture: Image.Image, outcome: str, above: int) -> None:
        text, colour = OUTCOMES.get(outcome, (outcome, EVENT))
        draw, side, large = ImageDraw.Draw(picture, "RGBA"), self._size, font(self._size / 22)
        half = 0.5 * draw.textlength(text, font=large) + side / 30
        box = (side / 2 - half, above + side * 0.02, side / 2 + half, above + side * 0.1)
        draw.rounded_rectangle(box, side / 60, fill=faint(colour, 235))
        draw.text((side / 2, above + side * 0.06), text, fill=TEXT, font=large, anchor="mm")


def _caption(view: View, driving: Driving) -> list[Line]:
    acts = bool(driving.active)
    lines: list[Line] = [
        ((title(view, driving), TEXT),),
        ((state_line(view.truth, driving), TEXT),),
        ((correction_line(view, driving), ACTIVE if acts else FAINT_TEXT),),
    ]
    return lines + [((line, EVENT_TEXT),) for line in events_lines(view.events)]
