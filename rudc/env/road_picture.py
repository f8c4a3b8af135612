"""The road as a picture: drivable area, lane marks, stop lines. Drawn once; frames are cut from it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from PIL import Image, ImageDraw

from rudc.arrays import Array
from rudc.network.network import Arm, Lane, Network
from rudc.network.polyline import arc_length, offset_polyline, resample

GROUND, VERGE, ASPHALT = (221, 226, 214), (196, 204, 188), (82, 87, 95)
MARK, DIVIDER = (235, 237, 240), (240, 196, 68)
REACH_M = 170.0
"""m from the junction's centre, beyond which nothing is drawn"""
MARK_M, DASH_M, GAP_M = 0.16, 3.0, 4.5
"""m, width of lines, length of dashes and of the gaps between them"""


@dataclass(frozen=True)
class RoadPicture:
    """A network's road, seen from above, north up."""

    image: Image.Image
    scale: float
    """pixels per m"""
    left: float
    """m, x of the left edge"""
    top: float
    """m, y of the upper edge"""

    def pixels(self, xy: Array) -> Array:
        """(..., 2) pixel coordinates of points xy (..., 2) m."""
        return (np.asarray(xy) - (self.left, self.top)) * (self.scale, -self.scale)


def draw_road(network: Network, scale: float) -> RoadPicture:
    """The picture of a network at `scale` pixels per m."""
    polygons = network.surface.polygons
    corners = np.concatenate(polygons)
    low = np.maximum(corners.min(axis=0) - 30.0, network.center - REACH_M)
    high = np.minimum(corners.max(axis=0) + 30.0, network.center + REACH_M)
    width, height = (int(n) for n in np.ceil((high - low) * scale))
    picture = RoadPicture(Image.new("RGB", (width, height), GROUND), scale, float(low[0]), float(high[1]))
    brush = _Brush(picture)
    for polygon in polygons:
        brush.line(np.vstack([polygon, polygon[:2]]), 2.4, VERGE)
    for polygon in polygons:
        brush.area(polygon, ASPHALT)
        brush.line(np.vstack([polygon, polygon[:1]]), 0.12, ASPHALT)  # closes hairlines between neighbours
    brush.pieces(network.surface.boundary, MARK_M, MARK)
    for arm in network.arms:
        _draw_arm(brush, network, arm)
    return picture


class _Brush:
    """Draws shapes given in metres."""

    def __init__(self, picture: RoadPicture) -> None:
        self._picture = picture
        self._draw = ImageDraw.Draw(picture.image)

    def area(self, polygon: Array, colour: tuple[int, int, int]) -> None:
        self._draw.polygon(_flat(self._picture.pixels(polygon)), fill=colour)

    def line(self, xy: Array, width_m: float, colour: tuple[int, int, int]) -> None:
        width = max(round(width_m * self._picture.scale), 1)
        self._draw.line(_flat(self._picture.pixels(xy)), fill=colour, width=width, joint="curve")

    def pieces(self, segments: Array, width_m: float, colour: tuple[int, int, int]) -> None:
        """segments (B, 2, 2) m."""
        width = max(round(width_m * self._picture.scale), 1)
        for segment in self._picture.pixels(segments):
            self._draw.line(_flat(segment), fill=colour, width=width)

    def dashes(self, xy: Array, colour: tuple[int, int, int]) -> None:
        length = float(arc_length(xy)[-1])
        for start in np.arange(GAP_M / 2, length - DASH_M, DASH_M + GAP_M):
            self.line(resample(xy, np.array([start, start + DASH_M])), MARK_M, colour)


def _draw_arm(brush: _Brush, network: Network, arm: Arm) -> None:
    """Marks of an arm: dashes between lanes of one direction, lines between directions, stop lines."""
    for edges in (arm.in_edges, arm.out_edges):
        for edge in edges:
            lanes = sorted(
                (lane for lane in network.lanes.values() if lane.edge == edge), key=lambda lane: lane.index
            )
            for lane in lanes[:-1]:
                brush.dashes(offset_polyline(lane.xy, lane.width / 2), MARK)
            if lanes and arm.in_edges and arm.out_edges:
                brush.line(offset_polyline(lanes[-1].xy, lanes[-1].width / 2 - 0.18), MARK_M, DIVIDER)
    inbound = [network.lanes[lane_id] for lane_id in arm.in_lanes]
    for lane in inbound:
        _draw_stop(brush, lane, yields=not arm.major)


def _draw_stop(brush: _Brush, lane: Lane, *, yields: bool) -> None:
    """Where a lane ends at the junction: a solid line, or teeth towards those who must yield."""
    end, back = lane.xy[-1], lane.xy[-2]
    course = (end - back) / np.hypot(*(end - back))
    across = np.array([-course[1], course[0]])
    if not yields:
        brush.line(np.array([end - 0.46 * lane.width * across, end + 0.46 * lane.width * across]), 0.3, MARK)
        return
    for place in np.arange(-0.38, 0.39, 0.19):
        base = end + place * lane.width * across
        tooth = np.array([base - 0.22 * across, base + 0.22 * across, base - 0.75 * course])
        brush.area(tooth, MARK)


def _flat(pixels: Array) -> list[float]:
    return pixels.reshape(-1).tolist()
