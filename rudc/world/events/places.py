"""Where events take place on a network, given the ego's route, and which things would stand in the same
place.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rudc.arrays import Array
from rudc.geometry import rectangle_corners, rectangle_gaps
from rudc.network.polyline import in_any
from rudc.network.stretches import stretch_by_id
from rudc.scenario.events.stage import ROADSIDE_M, Body, Stage, XYHeading
from rudc.world.events.patches import Piece
from rudc.world.vehicle_types import VEHICLE_TYPES

if TYPE_CHECKING:
    from rudc.network.network import Network, Route
    from rudc.network.stretches import Stretch
    from rudc.scenario.poses import Pose

PEDESTRIAN_M = 0.5
"""m, side of the square that a pedestrian takes up"""
BEYOND_M = 15.0
"""m that a wrong-way driver goes straight on beyond the road's end, where it vanishes"""
EDGE_M = 0.1
"""m, to which the road's edge beside lanes for buses or bicycles is found"""
ON_THE_ROAD = "it reaches onto the road; move it beside the road, or use `accident` for what stands on it"
"""what is wrong with a box that should hide what is beside the road"""
TOUCH_M = 0.01
"""m by which standing things may overlap and still count as only touching"""


class NetworkStage(Stage):
    """The part of a stage that needs only the network and the ego's route; subclasses implement the rest."""

    __slots__ = ()

    network: Network
    route: Route
    """the ego's"""

    def pose(self, place: Pose) -> XYHeading:
        if place.lane is None or place.at is None:
            assert place.position is not None, "checked by the scenario"
            x, y = (float(value) for value in place.position)
            return x + float(self.network.center[0]), y + float(self.network.center[1]), place.heading_rad
        return self.network.place_on_lane(
            place.lane, float(place.at), float(place.lateral), place.heading_offset_rad, self.route
        )

    def pose_on_lane(self, lane: str, at: float) -> XYHeading:
        return self.network.place_on_lane(lane, at, route=self.route)

    def behind_on_lane(self, lane: str, at: float) -> Array:
        return self.network.stretch(lane, self.route).behind(at)

    def lane_width(self, lane: str) -> float:
        return self.network.stretch(lane, self.route).lane.width

    def pieces_along_lane(self, lane: str, at: float, length: float) -> list[tuple[XYHeading, float]]:
        return pieces_along_lane(self.network, self.route, lane, at, length)

    def against_lane(self, lane: str, at: float) -> Array:
        return against_lane(self.network, self.route, lane, at)

    def across_arm(self, arm: str, at: float) -> Array:
        return across_arm(self.network, self.route, arm, at)

    def length_of(self, body: Body) -> float:
        return size_of(body)[0]


def pieces_along_lane(
    network: Network, route: Route, lane: str, at: float, length: float
) -> list[tuple[XYHeading, float]]:
    """As `Stage.pieces_along_lane`."""
    number = network.stretch(lane, route).pieces(at, at + length)
    each = length / number
    return [(network.place_on_lane(lane, at + (i + 0.5) * each, route=route), each) for i in range(number)]


def patch_along_lane(network: Network, route: Route, lane: str, at: float, length: float) -> list[Piece]:
    """The straight pieces that cover a stretch of a lane; where it bends, they overlap on its inner side."""
    pieces = pieces_along_lane(network, route, lane, at, length)
    width = network.stretch(lane, route).lane.width
    headings = np.unwrap([place[2] for place, _ in pieces])
    more = width * math.tan(0.5 * float(np.abs(np.diff(headings)).max(initial=0.0)))
    return [(place, (each + more, width)) for place, each in pieces]


class Standing(NamedTuple):
    """Something that stands on the road."""

    name: str
    """`EVENT:I`, the I-th thing of an event, from 0"""
    body: str
    place: XYHeading
    size: tuple[float, float]
    """m, length and width"""


def overlapped(new: Standing, others: Sequence[Standing]) -> list[Standing]:
    """Those of `others` that `new` would overlap. The pieces by which one event closes a lane may overlap."""
    event = new.name.partition(":")[0]
    others = [o for o in others if o.body != "obstacle" or o.name.partition(":")[0] != event]
    if not others:
        return []
    places = np.array([other.place for other in others])
    sizes = np.array([other.size for other in others])
    length, width = new.size
    gaps = rectangle_gaps(
        *new.place, length - TOUCH_M, width - TOUCH_M, places[:, :2], places[:, 2], sizes - TOUCH_M
    )
    return [other for other, gap in zip(others, gaps, strict=True) if gap == 0.0]


def said(network: Network, place: XYHeading) -> str:
    """A place in words, in m from the junction's centre as in scenario files."""
    x, y = (float(value) for value in np.array(place[:2]) - network.center)
    return f"at ({x:.1f}, {y:.1f}) m"


def reaches_onto_road(network: Network, place: XYHeading, size: tuple[float, float]) -> bool:
    """Whether any part of a rectangle with length and width `size` (m) is on the road: a corner or the middle
    of it is, or an edge of the road passes through it."""
    x, y, heading = place
    corners = rectangle_corners(np.array([x, y]), np.array(heading), np.array(size))
    if network.surface.signed_distance(np.vstack([corners, [(x, y)]])).max() > 0:
        return True
    return _passes_through(network.surface.boundary, place, (size[0] - TOUCH_M, size[1] - TOUCH_M))


def _passes_through(pieces: Array, place: XYHeading, size: tuple[float, float]) -> bool:
    """Whether any of the straight pieces (B, 2, 2) m passes through a rectangle.

    A rectangle is where two slabs meet, one along and one across it. A piece passes through the rectangle if
    it enters the second of them before it leaves the first.
    """
    x, y, heading = place
    ends = (pieces[..., 0] - x + 1j * (pieces[..., 1] - y)) * np.exp(-1j * heading)
    ends = np.stack([ends.real, ends.imag], axis=-1)
    step = ends[:, 1] - ends[:, 0]
    step[step == 0.0] = np.finfo(float).tiny  # parallel to a slab: it meets its sides infinitely far away
    half = 0.5 * np.array(size)
    with np.errstate(over="ignore"):
        sides = np.sort([(-half - ends[:, 0]) / step, (half - ends[:, 0]) / step], axis=0)
    return bool((np.maximum(sides[0].max(axis=1), 0.0) < np.minimum(sides[1].min(axis=1), 1.0)).any())


def size_of(body: Body) -> tuple[float, float]:
    """Length and width (m) of a vehicle or pedestrian."""
    if body in VEHICLE_TYPES:
        return VEHICLE_TYPES[body].length, VEHICLE_TYPES[body].width
    return PEDESTRIAN_M, PEDESTRIAN_M


def against_lane(network: Network, route: Route, lane: str, at: float) -> Array:
    """(K, 2) m, as `Stage.against_lane`; `route`: the ego's."""
    way = network.stretch(lane, route).against(at)
    direction = (way[-1] - way[-2]) / np.linalg.norm(way[-1] - way[-2])
    return np.vstack([way, way[-1] + BEYOND_M * direction])


def across_arm(network: Network, route: Route | None, name: str, at: float) -> Array:
    """(2, 2) m, as `Stage.across_arm`; `route`: the ego's, needed where `name` is relative to it."""
    arm, ends = network.arm(name, route), []
    for lanes, other in ((arm.in_lanes, arm.out_lanes), (arm.out_lanes, arm.in_lanes)):
        # A one-way arm is crossed from the right of its outermost lane to the left of its innermost.
        ids, side = (lanes, -1.0) if lanes else (other[::-1], 1.0)
        stretch = stretch_by_id(network, ids[0])
        ends.append(stretch.place(at, side * (_road_beside(network, stretch, at, side) + ROADSIDE_M))[:2])
    return np.array(ends)


def _road_beside(network: Network, stretch: Stretch, at: float, side: float) -> float:
    """m from the middle of a lane to the road's edge on one side, lanes for buses or bicycles included."""
    areas = [reserved.area for reserved in network.reserved if not reserved.is_pavement]
    beside = 0.5 * stretch.lane.width
    while in_any(areas, np.array([stretch.place(at, side * (beside + EDGE_M))[:2]])).any():
        beside += EDGE_M
    return beside
