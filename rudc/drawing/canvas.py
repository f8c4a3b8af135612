"""A view of the road to draw on, in metres: `FINE` times the pixels of what comes out, to smooth edges."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from PIL import Image, ImageDraw

from rudc.arrays import Array
from rudc.drawing.palette import GROUND, HIDDEN_AREA, HIDDEN_SHARE, Colour
from rudc.drawing.road_picture import RoadPicture
from rudc.network.polyline import arc_length, resample

FINE = 2
"""drawn pixels for one of the picture, along each axis"""


@dataclass
class Canvas:
    """A view of the road's picture."""

    image: Image.Image
    scale: float
    """pixels per m"""
    left: float
    """m, x of the left edge"""
    top: float
    """m, y of the upper edge"""

    shaded: Image.Image | None = None
    """the view before anything was drawn on it, as it looks where the ego's sensors do not reach"""

    def __post_init__(self) -> None:
        self.draw = ImageDraw.Draw(self.image, "RGBA")

    def copy(self, *, shaded: bool = False) -> Canvas:
        """The same view, to be drawn on by itself; `shaded`: some of it may be shaded."""
        if shaded and self.shaded is None:
            self.shaded = Image.blend(
                self.image, Image.new("RGB", self.image.size, HIDDEN_AREA[:3]), HIDDEN_SHARE
            )
        return Canvas(self.image.copy(), self.scale, self.left, self.top, self.shaded)

    def pixels(self, xy: Array) -> Array:
        """(..., 2) pixel coordinates of points xy (..., 2) m."""
        return (xy - (self.left, self.top)) * (self.scale, -self.scale)

    @property
    def centre(self) -> Array:
        """(2,) m, the middle of the view."""
        width, height = self.image.size
        return np.array([self.left + 0.5 * width / self.scale, self.top - 0.5 * height / self.scale])

    def holds(self, xy: Array, margin_m: float | Array = 0.0) -> np.ndarray:
        """(...) whether points xy (..., 2) m are in view, or at most `margin_m` (one, or (...)) beyond its
        edges.
        """
        px, more = self.pixels(xy), margin_m * self.scale
        width, height = self.image.size
        across = (px[..., 0] >= -more) & (px[..., 0] <= width + more)
        return across & (px[..., 1] >= -more) & (px[..., 1] <= height + more)

    def area(self, xy: Array, fill: Colour) -> None:
        """Fill a polygon xy (K, 2) m."""
        self.draw.polygon(self.pixels(xy).ravel().tolist(), fill=fill)

    def line(self, xy: Array, colour: Colour, width_m: float) -> None:
        """Draw a line along xy (K, 2) m."""
        width = max(round(width_m * self.scale), 1)
        self.draw.line(self.pixels(xy).ravel().tolist(), fill=colour, width=width, joint="curve")

    def dashes(self, xy: Array, colour: Colour, width_m: float, dash_m: float, gap_m: float) -> None:
        """Draw a broken line along xy (K, 2) m."""
        length = float(arc_length(xy)[-1])
        for start in np.arange(0.0, length, dash_m + gap_m):
            self.line(resample(xy, np.array([start, min(start + dash_m, length)])), colour, width_m)

    def outline(self, xy: Array, colour: Colour, width_m: float) -> None:
        """Draw the outline of a polygon xy (K, 2) m."""
        self.line(np.vstack([xy, xy[:2]]), colour, width_m)

    def dot(self, x: float, y: float, radius_m: float, fill: Colour) -> None:
        """Fill a disc about (x, y) m."""
        self.draw.ellipse(self._box(x, y, radius_m), fill=fill)

    def ring(self, x: float, y: float, radius_m: float, colour: Colour, width_m: float = 0.3) -> None:
        """Draw a circle about (x, y) m."""
        width = max(round(width_m * self.scale), 1)
        self.draw.ellipse(self._box(x, y, radius_m), outline=colour, width=width)

    def _box(self, x: float, y: float, radius_m: float) -> tuple[float, float, float, float]:
        (px, py), r = self.pixels(np.array([x, y])).tolist(), radius_m * self.scale
        return px - r, py - r, px + r, py + r


def cut(road: RoadPicture, corner: tuple[float, float], width: int, height: int) -> Canvas:
    """The view of `width` by `height` pixels whose upper left corner is at (x, y) m; beyond the picture is
    ground.
    """
    x, y = (int(v) for v in road.pixels(np.array(corner)))
    view = Image.new("RGB", (width, height), GROUND)
    view.paste(road.image, (-x, -y))
    return Canvas(view, road.scale, road.left + x / road.scale, road.top - y / road.scale)
