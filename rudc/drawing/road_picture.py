"""The road as a picture: drivable area, lane marks, stop lines, arrows. Drawn once; views are cut from it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from PIL import Image, ImageDraw

from rudc.arrays import Array
from rudc.drawing.palette import ASPHALT, GROUND, MARK, PAVEMENT, RESERVED, VERGE, Colour
from rudc.network.network import Arm, Lane, Network
from rudc.network.polyline import arc_length, offset_polyline, resample, strip

MARK_M, DASH_M, GAP_M = 0.16, 3.0, 4.5
"""m, width of lines, length of dashes and of the gaps between them"""
MARGIN_M = 30.0
"""m of ground drawn around the road"""
SHAFT_M, HEAD_M = 0.17, 0.38
"""m, width of an arrow's shaft and of half its head"""


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


@lru_cache(maxsize=3)
def draw_road(
    network: Network, scale: float, reach_m: float, middle: tuple[float, float] = (0.0, 0.0)
) -> RoadPicture:
    """The picture of a network at `scale` pixels per m, `reach_m` each way from `middle` (m east and north of
    its centre); kept.
    """
    polygons = network.surface.polygons
    corners = np.concatenate(polygons)
    about = network.center + middle
    low = np.maximum(corners.min(axis=0) - MARGIN_M, about - reach_m)
    high = np.maximum(np.minimum(corners.max(axis=0) + MARGIN_M, about + reach_m), low)
    width, height = (int(n) for n in np.ceil((high - low) * scale))
    picture = RoadPicture(Image.new("RGB", (width, height), GROUND), scale, float(low[0]), float(high[1]))
    paint_road(network, _PictureBrush(picture))
    return picture


class Brush(ABC):
    """Draws shapes given in metres; subclasses say on what."""

    @abstractmethod
    def area(self, polygon: Array, colour: Colour) -> None:
        """Fill a polygon (K, 2) m."""

    @abstractmethod
    def line(self, xy: Array, width_m: float, colour: Colour) -> None:
        """Draw a line along xy (K, 2) m."""

    def pieces(self, segments: Array, width_m: float, colour: Colour) -> None:
        """Draw short straight lines (B, 2, 2) m."""
        for segment in segments:
            self.line(segment, width_m, colour)

    def dashes(self, xy: Array, colour: Colour, dash_m: float = DASH_M, gap_m: float = GAP_M) -> None:
        """Draw a broken line along xy (K, 2) m."""
        length = float(arc_length(xy)[-1])
        for start in np.arange(gap_m / 2, length - dash_m, dash_m + gap_m):
            self.line(resample(xy, np.array([start, start + dash_m])), MARK_M, colour)


def paint_road(network: Network, brush: Brush) -> None:
    """Lanes without cars, drivable area, its edge, lane marks, stop lines, arrows: from below upwards."""
    polygons = network.surface.polygons
    for polygon in (*(lane.area for lane in network.reserved), *polygons):
        brush.line(np.vstack([polygon, polygon[:2]]), 2.4, VERGE)
    for lane in network.reserved:
        brush.area(lane.area, PAVEMENT if lane.is_pavement else RESERVED)
        for side in np.split(lane.area, 2):
            brush.line(side, MARK_M, RESERVED if lane.is_pavement else MARK)
    for polygon in polygons:
        brush.area(polygon, ASPHALT)
        brush.line(np.vstack([polygon, polygon[:1]]), 0.12, ASPHALT)  # closes hairlines between neighbours
    brush.pieces(network.surface.boundary, MARK_M, MARK)
    for edge in _round_the_ring(network):
        _draw_lane_marks(brush, network, edge)
    for arm in network.arms:
        _draw_arm(brush, network, arm)
        if not network.is_roundabout:
            _draw_arrows(brush, network, arm)


class _PictureBrush(Brush):
    """Draws on a picture."""

    def __init__(self, picture: RoadPicture) -> None:
        self._picture = picture
        self._draw = ImageDraw.Draw(picture.image)

    def area(self, polygon: Array, colour: Colour) -> None:
        self._draw.polygon(_flat(self._picture.pixels(polygon)), fill=colour)

    def line(self, xy: Array, width_m: float, colour: Colour) -> None:
        width = max(round(width_m * self._picture.scale), 1)
        self._draw.line(_flat(self._picture.pixels(xy)), fill=colour, width=width, joint="curve")

    def pieces(self, segments: Array, width_m: float, colour: Colour) -> None:
        width = max(round(width_m * self._picture.scale), 1)
        for segment in self._picture.pixels(segments):
            self._draw.line(_flat(segment), fill=colour, width=width)


def _draw_arm(brush: Brush, network: Network, arm: Arm) -> None:
    """Marks of an arm: dashes between lanes of one direction, lines between directions, stop lines."""
    for edges in (arm.in_edges, arm.out_edges):
        for edge in edges:
            lanes = _draw_lane_marks(brush, network, edge)
            if lanes and arm.in_edges and arm.out_edges:
                brush.line(offset_polyline(lanes[-1].xy, lanes[-1].width / 2), 1.6 * MARK_M, MARK)
    equal = not network.is_roundabout and not any(other.major for other in network.arms)
    for lane_id in arm.in_lanes:
        free = arm.major or equal
        sign = "stop" if lane_id in network.stopping else "" if free else "yield"
        _draw_stop(brush, network.lanes[lane_id], sign)


def _draw_lane_marks(brush: Brush, network: Network, edge: str) -> list[Lane]:
    """Draw dashes between the lanes of an edge; the lanes, the rightmost first."""
    lanes = sorted(
        (lane for lane in network.lanes.values() if lane.edge == edge), key=lambda lane: lane.index
    )
    for lane in lanes[:-1]:
        brush.dashes(offset_polyline(lane.xy, lane.width / 2), MARK)
    return lanes


def _round_the_ring(network: Network) -> list[str]:
    """Edges of a roundabout's ring, and those inside its nodes that lead from one to the next."""
    found = set[str]()
    for ids in network.paths.lane_ids:
        edges = [network.lanes[i].edge for i in ids if i in network.lanes]
        ring = [k for k, edge in enumerate(edges) if edge in network.ring_edges]
        found.update(edges[ring[0] : ring[-1] + 1] if ring else ())
    return sorted(found)


def _draw_stop(brush: Brush, lane: Lane, sign: str) -> None:
    """Where a lane ends at the junction: a bar where one must stop, teeth towards those who must yield, else
    dots.
    """
    end, back = lane.xy[-1], lane.xy[-2]
    course = (end - back) / np.hypot(*(end - back))
    across = np.array([-course[1], course[0]])
    bar = np.array([end - 0.5 * lane.width * across, end + 0.5 * lane.width * across])
    if sign == "stop":
        brush.line(bar, 0.45, MARK)
    elif sign == "yield":
        for place in np.arange(-0.38, 0.39, 0.19):
            base = end + place * lane.width * across
            brush.area(np.array([base - 0.22 * across, base + 0.22 * across, base - 0.75 * course]), MARK)
    else:
        brush.dashes(bar, MARK, 0.35, 0.35)


def _draw_arrows(brush: Brush, network: Network, arm: Arm) -> None:
    """Painted arrows before the junction: where each inbound lane leads."""
    angles: dict[str, set[float]] = {}
    for movement in network.onward:
        if movement.origin == arm.name:
            for row in movement.rows:
                angles.setdefault(network.inbound_lane(row).id, set()).add(movement.angle)
    for lane_id, turns in angles.items():
        lane = network.lanes[lane_id]
        if lane.length < 11.0:
            continue
        knee, tail = resample(lane.xy[::-1], np.array([6.5, 9.5]))
        psi = float(np.arctan2(*(knee - tail)[::-1]))
        brush.area(strip(np.array([tail, knee]), SHAFT_M), MARK)
        for turn in turns:
            bend = psi + float(np.clip(turn, -1.2, 1.2))
            u, v = np.array([np.cos(bend), np.sin(bend)]), np.array([-np.sin(bend), np.cos(bend)])
            neck = knee + (0.8 if abs(turn) > 0.3 else 1.8) * u
            brush.area(strip(np.array([knee - 0.08 * u, neck]), SHAFT_M), MARK)
            brush.area(np.array([neck + HEAD_M * v, neck + 0.8 * u, neck - HEAD_M * v]), MARK)


def _flat(pixels: Array) -> list[float]:
    return pixels.reshape(-1).tolist()
