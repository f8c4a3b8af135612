"""A view of the road to draw on, in metres, and the shapes that road users are made of."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from PIL import Image, ImageDraw

from rudc.arrays import Array
from rudc.env.road_picture import GROUND, RoadPicture

Colour = tuple[int, int, int] | tuple[int, int, int, int]

GLASS: Colour = (38, 44, 54)
BRAKE_LIGHT: Colour = (232, 48, 48)

_FRONT = [(0.44, 0.5), (0.5, 0.3), (0.5, -0.3), (0.44, -0.5)]
_BACK = [(-0.46, -0.5), (-0.5, -0.36), (-0.5, 0.36), (-0.46, 0.5)]
_WINDSCREEN = [(0.24, 0.4), (0.1, 0.34), (0.1, -0.34), (0.24, -0.4)]
_REAR_WINDOW = [(-0.36, 0.34), (-0.28, 0.3), (-0.28, -0.3), (-0.36, -0.34)]
_LEFT_LIGHT = [(-0.5, 0.46), (-0.44, 0.46), (-0.44, 0.22), (-0.5, 0.22)]
_RIGHT_LIGHT = [(x, -y) for x, y in _LEFT_LIGHT]
HALO: Array = np.array([*_FRONT, *_BACK])
"""(8, 2) a vehicle's outline in its lengths (front positive) and widths (left positive)"""
SHAPES: Array = np.array([*HALO, *_WINDSCREEN, *_REAR_WINDOW, *_LEFT_LIGHT, *_RIGHT_LIGHT])
"""(24, 2) outline, windscreen, rear window and brake lights"""
BODY = slice(0, 8)


def placed(shape: Array, position: Array, heading: Array, size: Array) -> Array:
    """(N, K, 2) m, a shape (K, 2) put at positions (N, 2) m, headings (N,) rad, in sizes (N, 2) m."""
    cos, sin = np.cos(heading)[:, None], np.sin(heading)[:, None]
    along, across = shape[:, 0] * size[:, :1], shape[:, 1] * size[:, 1:]
    turned = np.stack([along * cos - across * sin, along * sin + across * cos], axis=-1)
    return position[:, None] + turned


@dataclass
class Canvas:
    """A square view of the road's picture."""

    image: Image.Image
    scale: float
    """pixels per m"""
    left: float
    """m, x of the left edge"""
    top: float
    """m, y of the upper edge"""

    def __post_init__(self) -> None:
        self.draw = ImageDraw.Draw(self.image, "RGBA")

    def copy(self) -> Canvas:
        """The same view, to be drawn on by itself."""
        return Canvas(self.image.copy(), self.scale, self.left, self.top)

    def pixels(self, xy: Array) -> Array:
        """(..., 2) pixel coordinates of points xy (..., 2) m."""
        return (xy - (self.left, self.top)) * (self.scale, -self.scale)

    def area(self, xy: Array, fill: Colour) -> None:
        """Fill a polygon xy (K, 2) m."""
        self.draw.polygon(self.pixels(xy).ravel().tolist(), fill=fill)

    def line(self, xy: Array, colour: Colour, width_m: float) -> None:
        """Draw a line along xy (K, 2) m."""
        width = max(round(width_m * self.scale), 1)
        self.draw.line(self.pixels(xy).ravel().tolist(), fill=colour, width=width, joint="curve")

    def outline(self, xy: Array, colour: Colour, width_m: float) -> None:
        """Draw the outline of a polygon xy (K, 2) m."""
        self.line(np.vstack([xy, xy[:2]]), colour, width_m)

    def dot(self, x: float, y: float, radius_m: float, fill: Colour) -> None:
        """Fill a disc about (x, y) m."""
        self.draw.ellipse(self._box(x, y, radius_m), fill=fill)

    def ring(self, x: float, y: float, radius_m: float, colour: Colour) -> None:
        """Draw a circle about (x, y) m."""
        self.draw.ellipse(self._box(x, y, radius_m), outline=colour, width=max(round(0.3 * self.scale), 1))

    def vehicle(self, flat: list[float], colour: Colour, *, windows: bool, braking: bool) -> None:
        """Draw the `SHAPES` of one vehicle, in pixels, x and y in turn."""
        self.draw.polygon(flat[0:16], fill=colour)
        if windows:
            self.draw.polygon(flat[16:24], fill=GLASS)
            self.draw.polygon(flat[24:32], fill=GLASS)
        if windows and braking:
            self.draw.polygon(flat[32:40], fill=BRAKE_LIGHT)
            self.draw.polygon(flat[40:48], fill=BRAKE_LIGHT)

    def _box(self, x: float, y: float, radius_m: float) -> tuple[float, float, float, float]:
        (px, py), r = self.pixels(np.array([x, y])).tolist(), radius_m * self.scale
        return px - r, py - r, px + r, py + r


def cut(road: RoadPicture, corner: tuple[float, float], side: int) -> Canvas:
    """The view of `side` pixels whose upper left corner is at (x, y) m; beyond the picture is ground."""
    x, y = (int(v) for v in road.pixels(np.array(corner)))
    view = Image.new("RGB", (side, side), GROUND)
    view.paste(road.image, (-x, -y))
    return Canvas(view, road.scale, road.left + x / road.scale, road.top - y / road.scale)
