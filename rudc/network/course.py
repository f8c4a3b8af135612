"""Courses: lines round what stands in the way, for the same movement as the route that they replace.

A course is a `Route` with another line, and all that goes with a line: stations, road edges, conflict
table. It is planned on a lattice about the route's reference path (rudc/network/lattice.py), whose profile
is smoothed and then judged by exact rectangles.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rudc.arrays import Array
from rudc.geometry import Rectangles, gaps_between, rectangle_corners
from rudc.network.conflicts import waiting_bumper
from rudc.network.depths import Depths
from rudc.network.lattice import STEP, Lattice
from rudc.network.network import Network
from rudc.network.paths import SPACING
from rudc.network.polyline import arc_length, resample, smooth, union_boundary
from rudc.network.road_edges import edge_widths
from rudc.network.route import ReferencePath, Route
from rudc.vehicle import EgoVehicle

REACH = 80.0
"""m ahead that a course is planned for"""
SHORTEST = 12.0
"""m of path left below which nothing is planned"""
RETURN = 8.0, 20.0
"""m, m behind the ego: there the line is as far off as the ego, and goes back to the path within the
second"""
SMOOTHING = 2.0
"""m, window of the moving averages over offsets and line"""
FINE = 0.05
"""m, spacing at which lines are drawn before they are sampled"""
ROAD_MARGINS = 0.15, 0.25, 0.35, 0.45
"""m of carriageway beside the car at the lattice's nodes; the next where the finished line, which is smoother
than the profile, leaves the road"""
NEAR = 3.0
"""m, gaps above are not told apart"""


def gaps_along(
    path: ReferencePath, first: float, last: float, body: EgoVehicle, others: Rectangles
) -> tuple[Array, Array]:
    """(K,) m, arc lengths between two, and (K,) m, the gap there of a car on the path to the nearest
    rectangle.

    inf where it is more than NEAR.
    """
    spacing = float(path.s[1])
    s = np.arange(max(first, 0.0), min(last, path.length), spacing)
    gap = np.full(len(s), np.inf)
    if not len(s) or not others.number:
        return s, gap
    xy, psi = path.body_pose(s, body)
    size = np.array([body.length, body.width])
    reach = NEAR + 0.5 * (np.hypot(*size) + np.hypot(*others.size.T))
    away = xy[:, None] - others.position
    here, who = np.nonzero(np.hypot(away[..., 0], away[..., 1]) < reach)
    found = gaps_between(
        xy[here], psi[here], size, others.position[who], others.heading[who], others.size[who]
    )
    np.minimum.at(gap, here, np.where(found < NEAR, found, np.inf))
    return s, gap


class CoursePlanner:
    """Plans courses for one route; what the road says is worked out once."""

    def __init__(
        self, network: Network, route: Route, body: EgoVehicle, may_cross_centre: bool = False
    ) -> None:
        """`may_cross_centre`: courses may use the lanes of oncoming traffic."""
        self._network, self._route, self._body = network, route, body
        movement = network.movement(route.origin, route.destination)
        carriageway = network.carriageway(movement, may_cross_centre)
        self._boundary = union_boundary(carriageway)
        depths = Depths(route.path, carriageway, self._boundary)
        self._lattice = Lattice(route.path, depths, body, body.tightest)

    def plan(
        self, s: float, offset: float, slope: float, standing: Rectangles, coming: Rectangles
    ) -> Route | None:
        """A course round bodies for a car at arc length s (m) of the route's path, `offset` m to its left.

        `slope`: tangent of the angle between path and car. `coming`: bodies that count beyond the junction
        only. None if the lattice has no way on which the car stays on the road; whether the course that
        comes out is clear is the caller's to ask (`gaps_along`).
        """
        first = round(s / STEP)
        last = min(first + round(REACH / STEP), len(self._lattice.s) - 1)
        if (last - first) * STEP < SHORTEST:
            return None
        bodies = [(standing, 0.0), (coming, self._route.exit_s)]
        for margin in ROAD_MARGINS:
            profile = self._lattice.search(first, last, (offset, slope), bodies, margin)
            if profile is None:
                return None
            path = ReferencePath(self._line(first, profile, offset))
            if self._stays_on_road(path, s, s + REACH):
                return self._along(path)
        return None

    def _stays_on_road(self, path: ReferencePath, first: float, last: float) -> bool:
        """Whether a car on the line stays on the road with all corners, between the places at first and
        last m of the route's path; not asked of where the car is now.
        """
        size = np.array([self._body.length, self._body.width])
        s = np.arange(self._same_place(path, first) + STEP, self._same_place(path, last), 2 * SPACING)
        xy, psi = path.body_pose(s, self._body)
        corners = rectangle_corners(xy, psi, np.broadcast_to(size, (len(s), 2)))
        return bool((self._network.surface.signed_distance(corners) >= 0.0).all())

    def _line(self, first: int, profile: Array, offset: float) -> Array:
        """(K, 2) m: back to the path behind the car, the profile, and on from its end at the offset there."""
        stations = self._lattice.s
        offsets = np.full(len(stations), profile[-1])
        offsets[first : first + len(profile)] = profile
        behind = (first - np.arange(first)) * STEP
        offsets[:first] = offset * np.clip(1.0 - (behind - RETURN[0]) / RETURN[1], 0.0, 1.0)
        fine = np.arange(0.0, stations[-1], FINE)
        x, y, psi = self._route.path.pose(fine)
        window = 2 * round(SMOOTHING / FINE / 2) + 1
        padded = np.pad(np.interp(fine, stations, offsets), window // 2, mode="edge")
        beside = np.convolve(padded, np.full(window, 1.0 / window), mode="valid")
        xy = np.column_stack([x - beside * np.sin(psi), y + beside * np.cos(psi)])
        return smooth(resample(xy, np.arange(0.0, arc_length(xy)[-1], FINE)), FINE, SMOOTHING)

    def _along(self, path: ReferencePath) -> Route:
        """The route with another line."""
        network, old = self._network, self._route
        paths, row = network.paths, old.row
        stop, exit_s = (self._same_place(path, s) for s in (old.stop_line_s, old.exit_s))
        table = network.conflict(path)
        crossing = table[(paths.origin != paths.origin[row]) & np.isfinite(table[:, 0])]
        left, right = edge_widths(self._boundary, path, self._body)
        normal = np.column_stack([-np.sin(path.heading), np.cos(path.heading)])
        return replace(
            old,
            path=path,
            stop_line_s=stop,
            waiting_s=waiting_bumper(path, paths, row, stop, exit_s, self._body.width),
            zone_start_s=float(crossing[:, 0].min()) if len(crossing) else stop,
            zone_end_s=min(float(crossing[:, 1].max()), exit_s) if len(crossing) else stop,
            exit_s=exit_s,
            length=path.length,
            left_edge=path.xy + left[:, None] * normal,
            right_edge=path.xy - right[:, None] * normal,
            left_width=left,
            right_width=right,
        )

    def _same_place(self, path: ReferencePath, s: float) -> float:
        """m, arc length on another line of the place at s m on the route's."""
        x, y, _ = self._route.path.pose(s)
        return path.project(float(x), float(y))[0]
