"""Courses: lines round what stands in the way, for the same movement as the route that they replace.

A course is a `Route` with another line, and with all that goes with a line: stations, road edges, conflict
table. It is planned on a lattice about the route's reference path (rudc/network/lattice.py). The lattice
gives a profile, that is offsets from the path; it is smoothed and then judged by exact rectangles.

A car too near to a body for that first pulls out: on an arc with its wheels turned nearly as far as they
go, and from the arc's end on a profile.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from rudc.arrays import Array
from rudc.geometry import Rectangles, rectangle_corners
from rudc.network.depths import Depths
from rudc.network.kernels import any_beside, gaps_at
from rudc.network.lattice import STEP, Lattice
from rudc.network.network import Network
from rudc.network.paths import SPACING
from rudc.network.polyline import arc_length, resample, smooth, union_boundary
from rudc.network.route import ReferencePath, Route
from rudc.network.route_builder import along, moved
from rudc.vehicle import EgoVehicle

REACH = 80.0
"""m ahead that a course is planned for"""
SHORTEST = 12.0
"""m of path left below which nothing is planned"""
RETURN = 8.0, 20.0
"""m, m: behind the ego the line keeps the ego's offset over the first length, and returns to the path over
the second"""
HOMEWARDS = 0.1
"""slope with which the line returns to the path beyond the end of what is planned"""
SMOOTHING = 2.0
"""m, window of the moving averages over offsets and line"""
FINE = 0.05
"""m, spacing at which lines are drawn before they are sampled"""
ROAD_MARGINS = 0.15, 0.25, 0.35, 0.45
"""m of carriageway to keep beside the car at the lattice's nodes; the next is tried where the finished line,
which is smoother than the profile, leaves the road"""
NEAR = 3.0
"""m, larger gaps are not told apart"""
PULL_OUT = 1.0, 1.5, 2.0, 2.5, 3.0, 4.0
"""m, lengths of the arcs on which a car pulls out"""
FULL = 0.97
"""share of the largest front-wheel angle that such an arc takes"""
ROOMY = 0.5
"""m, gap to bodies that is tried first when a car pulls out"""
ROOMIER = (0.0, 0.15), (0.0, 0.45), (0.4, 0.15), (0.7, 0.15)
"""m added to the gap, and m of carriageway beside the car, that the lattice's nodes must keep; the next pair
is tried where the finished line is not clear or leaves the road"""
STEEPEST = 0.85
"""largest slope with which such an arc may end; where the lattice has no slope so large, it starts from its
own largest"""
SWINGS_OUT = 0.1
"""m, by which a corner may swing out over the road's edge where a car pulls out, or farther out if it is over
the edge already"""
BEHIND = 1.0
"""m of the arc that are drawn behind the car, so that the car is on it from the start"""


def gaps_along(
    path: ReferencePath, first: float, last: float, body: EgoVehicle, others: Rectangles
) -> tuple[Array, Array]:
    """(K,) m, arc lengths from `first` to `last`, and (K,) m, the gap there between a car on the path and the
    nearest rectangle; inf where it is NEAR or more.
    """
    s = np.arange(max(first, 0.0), min(last, path.length), SPACING)
    gap = np.full(len(s), np.inf)
    if not len(s) or not others.number:
        return s, gap
    reach = NEAR + 0.5 * math.hypot(body.length, body.width) + SPACING
    stations = int(s[0] / SPACING), int(s[-1] / SPACING) + 1
    if not any_beside(path.xy, *stations, reach, others.position, others.size):
        return s, gap
    xy, psi = path.body_pose(s, body)
    gap = gaps_at(xy, psi, body.length, body.width, *others, NEAR).min(axis=1)
    gap[gap >= NEAR] = np.inf
    return s, gap


class CoursePlanner:
    """Plans courses for one route; what depends only on the road is computed once."""

    def __init__(
        self, network: Network, route: Route, body: EgoVehicle, may_cross_centre: bool = False
    ) -> None:
        """`may_cross_centre`: courses may use the lanes of oncoming traffic."""
        self._network, self._route, self._body = network, route, body
        movement = network.movement(route.origin, route.destination)
        carriageway = network.carriageway(movement, may_cross_centre)
        self._boundary = union_boundary(carriageway)
        depths = Depths(route.path, carriageway, self._boundary)
        self._lattice = Lattice(route.path, depths, body)

    def plan(
        self,
        s: float,
        offset: float,
        slope: float,
        standing: Rectangles,
        coming: Rectangles,
        inside: Rectangles,
    ) -> Route | None:
        """A course round bodies for a car at arc length s (m) of the route's path, `offset` m to its left.

        `slope`: tangent of the angle between path and car (`angle`). `standing`: bodies that count
        everywhere, `coming`: before the junction and beyond it, `inside`: in it. None if less than SHORTEST m
        of the path are left, or if no course keeps the car on the road. Whether the course is clear of bodies
        is for the caller to check (`gaps_along`).
        """
        first, last = self._span(s)
        if (last - first) * STEP < SHORTEST:
            return None
        behind = (first - np.arange(first)) * STEP
        before = offset * np.clip(1.0 - (behind - RETURN[0]) / RETURN[1], 0.0, 1.0)
        stop, leave = self._route.stop_line_s, self._route.exit_s
        bodies = [
            (standing, 0.0, np.inf), (coming, 0.0, stop), (inside, stop, leave), (coming, leave, np.inf)
        ]  # fmt: skip
        for margin in ROAD_MARGINS:
            profile = self._lattice.search(first, last, (offset, slope), bodies, margin)
            if profile is None:
                return None
            path = ReferencePath(self._line(before, profile), self._route.path)
            if self._stays_on_road(path, s, s + REACH):
                return self._along(path)
        return None

    def pull_outs(
        self, x: float, y: float, psi: float, standing: Rectangles, clear: float
    ) -> Iterator[Route | None]:
        """Courses for a car that stands at (x, y) m with heading psi rad, too near to a body for `plan`. It
        pulls out to either side or straight on: first with a gap of ROOMY m, then of `clear` m, each with the
        shortest arcs first. None for each arc from which no course leads on.
        """
        for least, way, side in product((ROOMY, clear), PULL_OUT, (1.0, -1.0, 0.0)):
            xy, turned = _full_lock(x, y, psi, side, way, self._body)
            driven = slice(round(BEHIND / FINE), None, round(SPACING / FINE))
            gaps = gaps_at(xy[driven], turned[driven], self._body.length, self._body.width, *standing, least)
            if (gaps >= least).all():
                yield self._after(xy, float(turned[-1]), standing, least)

    def _after(self, arc: Array, psi: float, standing: Rectangles, clear: float) -> Route | None:
        """The arc (K, 2) m, and a profile from its end, where the car's heading is psi rad."""
        path = self._route.path
        s, offset = path.project(*arc[-1].tolist())
        slope = math.tan(self.angle(s, psi))
        first, last = self._span(s)
        if abs(slope) > STEEPEST or (last - first) * STEP < SHORTEST:
            return None
        start = offset + slope * (self._lattice.s[first] - s), slope
        for more, margin in ROOMIER:
            profile = self._lattice.search(
                first, last, start, [(standing, 0.0, np.inf)], margin, clear + more
            )
            if profile is None:
                continue
            line = self._joined(arc, profile, first, slope)
            here = line.project(*arc[0].tolist())[0] + BEHIND
            _, gaps = gaps_along(line, here + SPACING, here + REACH, self._body, standing)
            on_path = self._same_place(line, s) + STEP
            is_free = gaps.min(initial=np.inf) >= clear and not self._swings_out(line, here, on_path)
            if is_free and self._stays_on_road(line, s, s + REACH):
                return self._along(line)
        return None

    def _joined(self, arc: Array, profile: Array, first: int, slope: float) -> ReferencePath:
        """One line: the route's path up to the arc (K, 2) m, the arc, and the profile from station `first`
        on, which the arc reaches with `slope`.
        """
        path, stations = self._route.path, self._lattice.s
        straight = profile[0] + slope * (stations[:first] - stations[first])
        rest = self._line(np.clip(straight, -NEAR, NEAR), profile)
        ahead = ReferencePath(rest).project(*arc[-1].tolist())[0] + SMOOTHING / 2
        begin = int(np.searchsorted(arc_length(rest), ahead))
        x, y, _ = path.pose(np.arange(0.0, path.project(*arc[0].tolist())[0] - STEP, FINE))
        joined = np.vstack([np.column_stack([x, y]), arc, rest[begin:]])
        fine = resample(joined, np.arange(0.0, arc_length(joined)[-1], FINE))
        return ReferencePath(smooth(fine, FINE, BEHIND), path)

    def angle(self, s: float, psi: float) -> float:
        """rad, from the direction of the route's path at s m to the direction in which a car there moves, if
        its heading is psi rad and its wheels are turned as the path bends.
        """
        path = self._route.path
        slip = math.asin(min(max(self._body.cg_to_rear * path.curvature_at(s), -0.9), 0.9))
        return math.remainder(psi + slip - path.heading_at(s), 2 * math.pi)

    def _span(self, s: float) -> tuple[int, int]:
        """The stations at s m and at the end of what is planned from there."""
        first = round(s / STEP)
        return first, min(first + round(REACH / STEP), len(self._lattice.s) - 1)

    def _stays_on_road(self, path: ReferencePath, first: float, last: float) -> bool:
        """Whether a car on the line stays on the road with all corners, between the places at `first` and
        `last` m of the route's path. Where the car is now is not checked, nor are the route's last metres,
        where its front is past the end of the road.
        """
        last = min(last, self._route.length - self._body.length)
        s = np.arange(self._same_place(path, first) + STEP, self._same_place(path, last), 2 * SPACING)
        return bool((self._depths(*path.body_pose(s, self._body)) >= 0.0).all())

    def _swings_out(self, path: ReferencePath, first: float, last: float) -> bool:
        """Whether a car on the line swings out over the road's edge between `first` m of it, where it is, and
        `last` m, from where on `_stays_on_road` looks.
        """
        s = np.arange(first, max(first, last) + SPACING, SPACING)  # on a loop, `last` may be found before
        depths = self._depths(*path.body_pose(s, self._body))
        return bool(depths.min() < min(depths[0], 0.0) - SWINGS_OUT)

    def _depths(self, xy: Array, psi: Array) -> Array:
        """(K,) m, the least distance of the car's corners from the road's edge, negative off the road, at
        places (K, 2) m with headings (K,) rad.
        """
        size = np.broadcast_to((self._body.length, self._body.width), (len(psi), 2))
        return self._network.surface.signed_distance(rectangle_corners(xy, psi, size)).min(axis=1)

    def _line(self, before: NDArray[np.floating], profile: Array) -> Array:
        """(K, 2) m, the line: the offsets `before` (first,) m, the profile, and from its end back to the
        route."""
        stations, first = self._lattice.s, len(before)
        end = first + len(profile) - 1
        back = np.maximum(np.abs(profile[-1]) - HOMEWARDS * (stations - stations[end]), 0.0)
        offsets = np.copysign(back, profile[-1])
        offsets[:first], offsets[first : end + 1] = before, profile
        fine = np.arange(0.0, stations[-1], FINE)
        x, y, psi = self._route.path.pose(fine)
        window = 2 * round(SMOOTHING / FINE / 2) + 1
        padded = np.pad(np.interp(fine, stations, offsets), window // 2, mode="edge")
        beside = np.convolve(padded, np.full(window, 1.0 / window), mode="valid")
        xy = np.column_stack([x - beside * np.sin(psi), y + beside * np.cos(psi)])
        return smooth(resample(xy, np.arange(0.0, arc_length(xy)[-1], FINE)), FINE, SMOOTHING)

    def _along(self, path: ReferencePath) -> Route:
        """The route with another line."""
        old = self._route
        stop, exit_s = (self._same_place(path, s) for s in (old.stop_line_s, old.exit_s))
        line = along(self._network, old.row, path, stop, exit_s, self._boundary, self._body)
        limits = moved(old.limits, lambda s: self._same_place(path, s))
        return replace(old, limits=limits, **line)

    def _same_place(self, path: ReferencePath, s: float) -> float:
        """m, arc length on another line of the place that is at s m on the route's."""
        x, y, _ = self._route.path.pose(s)
        return path.project(float(x), float(y))[0]


def _full_lock(
    x: float, y: float, psi: float, side: float, way: float, body: EgoVehicle
) -> tuple[Array, Array]:
    """(K, 2) m and (K,) rad, places and headings of a car that drives `way` m from (x, y) m with its wheels
    turned to the left (`side` 1), right (-1) or not at all (0); they begin BEHIND m before that place.
    """
    slip = side * math.atan(body.cg_to_rear / body.wheelbase * math.tan(FULL * body.delta_max))
    bend = math.sin(slip) / body.cg_to_rear
    driven = np.arange(-BEHIND, way, FINE)
    chord = driven * np.sinc(0.5 * bend * driven / math.pi)
    middle = psi + slip + 0.5 * bend * driven
    places = np.column_stack([x + chord * np.cos(middle), y + chord * np.sin(middle)])
    return places, psi + bend * driven
