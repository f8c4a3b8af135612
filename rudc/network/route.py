"""`ReferencePath` and `Route`: the line that the ego follows through the junction, and what goes with it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial import KDTree

from rudc.arrays import Array, Flags
from rudc.network.line_kernels import between, projected
from rudc.network.paths import SPACING
from rudc.network.polyline import arc_length, headings, resample, without_repeats
from rudc.vehicle import EgoVehicle

DEPARTS = 0.5
"""m from its route beyond which a course has left it"""


class ReferencePath:
    """A smooth line sampled every 0.5 m, for projecting a vehicle on it and reading off poses. Immutable."""

    def __init__(self, xy: Array, route: ReferencePath | None = None) -> None:
        """`xy`: (K, 2) m, a fine polyline (its points closer together than SPACING); `route`: for a course,
        the path that it replaces.
        """
        line = without_repeats(xy)
        count = int(arc_length(line)[-1] / SPACING) + 1
        self.s: Array = np.arange(count, dtype=np.float64) * SPACING
        """(M,) m, arc length of the stations"""
        self.xy: Array = resample(line, self.s)
        """(M, 2) m"""
        self.heading: Array = headings(self.xy)
        """(M,) rad, unwrapped"""
        self.curvature: Array = np.gradient(self.heading, SPACING)
        """(M,) 1/m, positive to the left"""
        self.length = float(self.s[-1])
        """m"""
        self.poses: Array = np.column_stack([self.xy, self.heading])
        """(M, 3) x m, y m and heading rad of the stations"""
        self.departs: Flags = np.zeros(count, dtype=np.bool_)
        """(M,) whether each station of a course is more than DEPARTS off its route; else all false"""
        if route is not None:
            self.departs = KDTree(route.xy).query(self.xy)[0] > DEPARTS
        for array in (self.s, self.xy, self.heading, self.curvature, self.poses, self.departs):
            array.flags.writeable = False

    def pose(self, s: Array | float) -> tuple[Array, Array, Array]:
        """x m, y m and heading rad, each (...), at arc length s (...) m; straight on beyond both ends."""
        at = np.asarray(s, dtype=float) * (1.0 / SPACING)
        i = np.minimum(np.maximum(at, 0.0), len(self.s) - 2.0).astype(np.int64)
        t = at - i
        low = self.poses[i]
        step = self.poses[i + 1] - low
        xy = low[..., :2] + t[..., None] * step[..., :2]
        return xy[..., 0], xy[..., 1], low[..., 2] + np.minimum(np.maximum(t, 0.0), 1.0) * step[..., 2]

    def body_pose(self, s: Array, body: EgoVehicle) -> tuple[Array, Array]:
        """(..., 2) m and (...) rad, the pose of a car whose centre of gravity follows the path, at s (...) m.

        With its front wheels turned it slips (rudc/world/ego.py): its body points out of the bend by
        asin(cg_to_rear x curvature).
        """
        x, y, heading = self.pose(s)
        turn = np.clip(body.cg_to_rear * np.interp(s, self.s, self.curvature), -0.9, 0.9)
        return np.stack([x, y], axis=-1), heading - np.arcsin(turn)

    def heading_at(self, s: float) -> float:
        """`pose`'s heading (rad) at one arc length (m), faster."""
        return between(self.heading, s)

    def curvature_at(self, s: float) -> float:
        """1/m, at one arc length (m); beyond an end, the curvature there."""
        return between(self.curvature, s)

    def project(self, x: float, y: float, near: float | None = None) -> tuple[float, float]:
        """Arc length (m) of the nearest point of the path to (x, y) and the offset (m) to the path's left.

        With `near`, an arc length not far from the result, the search walks downhill from there (a few
        microseconds); without, all stations are looked at. Negative, or above `length`, before or beyond the
        path's ends.
        """
        if near is None:
            i = int(np.argmin((self.xy[:, 0] - x) ** 2 + (self.xy[:, 1] - y) ** 2))
        else:
            i = int(near / SPACING)
        return projected(self.poses, float(x), float(y), i)


@dataclass(frozen=True)
class RouteKey:
    """The key by which a route is found again."""

    network: Path
    """the .net.xml"""
    junction: str | None
    """the junction that was asked for, if any"""
    origin: str
    """arm"""
    destination: str
    """arm"""
    lane: int | None
    """inbound lane asked for"""
    vehicle: EgoVehicle
    """who drives it"""


@dataclass(frozen=True, eq=False)
class Route:
    """One movement of the ego: reference path, where to stop and wait, the road's edges beside it. Pickled as
    its key (see `rudc.network.network`).
    """

    origin: str
    """arm it comes from"""
    destination: str
    """arm it leaves by"""
    turn: str
    """left, straight, right or u_turn"""
    task: int
    """0 left (and u_turn), 1 straight, 2 right"""
    edges: tuple[str, ...]
    """SUMO edges driven, in order"""
    row: int
    """row of `network.paths` with the same lanes"""
    path: ReferencePath
    """the line to follow"""
    alternatives: tuple[ReferencePath, ...]
    """lines for the same movement from the same lane to the other outbound lanes; may be empty"""
    stop_line_s: float
    """m, arc length of the stop line (the front bumper stops there)"""
    waiting_s: float
    """m, farthest arc length of the front bumper clear of all traffic it must yield to; at least
    `stop_line_s`"""
    zone_start_s: float
    """m, arc length of the centre where conflict with traffic from other arms begins (see
    `Network.conflict`)"""
    zone_end_s: float
    """m, arc length of the centre where the last such conflict in the junction ends, at most `exit_s`"""
    exit_s: float
    """m, arc length where the junction ends"""
    length: float
    """m, of the path"""
    major: bool
    """whether the arm it comes from has priority (`Arm.major`)"""
    limits: tuple[tuple[float, float], ...]
    """pairs in driving order: arc length (m) from which on a speed limit holds, and that limit (m/s); the
    first holds from -inf on"""
    left_edge: Array
    """(M, 2) m, left edge of the ego's carriageway beside each station of `path`"""
    right_edge: Array
    """(M, 2) m, right edge"""
    left_width: Array
    """(M,) m from the path to `left_edge`"""
    right_width: Array
    """(M,) m from the path to `right_edge`"""
    canonical_angle: float
    """rad, turning the world by its negative brings the origin arm to the south (entering traffic heads
    north)"""
    key: RouteKey
    """the key by which it is found again"""

    def limit_at(self, s: float) -> float:
        """The speed limit (m/s) at arc length s (m)."""
        return next(limit for begin, limit in reversed(self.limits) if begin <= s)

    @property
    def speed_limit(self) -> float:
        """m/s, on the last lane before the junction and in it."""
        return self.limit_at(self.stop_line_s)
