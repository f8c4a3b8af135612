"""`PathTable`: every lane-to-lane way through the junction, as padded arrays that answer for many vehicles.

A row is a chain of lanes from the outer end of one arm, over the junction, to the outer end of another. Its
arc length s is measured along the lanes' centre lines as SUMO draws them, so that a SUMO vehicle's lane and
position on it translate exactly: s = (arc length at the lane's start) + (position on the lane) * (drawn /
stated length).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from rudc.arrays import Array, Flags, Index
from rudc.network.polyline import arc_length, headings, resample, without_repeats

Edges = Mapping[str, Sequence[str]]
"""lanes of each edge, rightmost first"""

SPACING = 0.5
"""m between the stations of all paths"""


@dataclass(frozen=True)
class PathSource:
    """What one row is made of, as read from the network file."""

    origin: int
    """index of the arm it comes from"""
    destination: int
    """index of the arm it leaves by"""
    lane_ids: tuple[str, ...]
    """lanes driven, in order, those inside the junction included"""
    shapes: tuple[Array, ...]
    """centre line of each lane, (K, 2) m"""
    stated_lengths: tuple[float, ...]
    """m, length of each lane in the file (positions on it are counted in it)"""
    before_junction: int
    """how many of the lanes come before the stop line"""
    after_junction: int
    """how many of the lanes come after the junction"""
    limits: tuple[float, ...]
    """m/s, speed limit on each lane; in the junction, that of the last lane before it"""


class PathTable:
    """P ways through the junction, sampled every SPACING m, padded straight on to M stations. Immutable."""

    def __init__(
        self, sources: Sequence[PathSource], arms: Sequence[str], edges: Edges, yields: Flags
    ) -> None:
        lines = [without_repeats(np.concatenate(source.shapes)) for source in sources]
        self.length: Array = np.array([arc_length(line)[-1] for line in lines])
        """(P,) m"""
        stations = int(np.ceil(self.length.max() / SPACING)) + 2
        s: Array = np.arange(stations, dtype=np.float64) * SPACING
        self.xy: Array = np.stack([resample(line, s) for line in lines])
        """(P, M, 2) m"""
        self.heading: Array = np.stack([headings(xy) for xy in self.xy])
        """(P, M) rad, unwrapped along each row"""
        self.heading[:, 0] = self.heading[:, 1]
        self.lane_ids: tuple[tuple[str, ...], ...] = tuple(source.lane_ids for source in sources)
        """lanes of each row, in driving order"""
        self.origin: Index = np.array([source.origin for source in sources])
        """(P,) index into `Network.arms`"""
        self.destination: Index = np.array([source.destination for source in sources])
        """(P,) index into `Network.arms`"""
        self.speed_limit: Array = np.array([source.limits[source.before_junction - 1] for source in sources])
        """(P,) m/s, on the last lane before the junction and in it"""
        spans = [_lane_spans(source.shapes) for source in sources]
        self.limits = [_limits(source.limits, span) for source, span in zip(sources, spans, strict=True)]
        """of each row, pairs in driving order: arc length (m) from which on a speed limit holds, and that
        limit (m/s); the first holds from -inf on
        """
        self._limit, self._limit_from, self._limit_until = _side_by_side(self.limits)
        self.spans: tuple[dict[str, tuple[float, float]], ...] = tuple(
            dict(zip(source.lane_ids, map(tuple, span.tolist()), strict=True))
            for source, span in zip(sources, spans, strict=True)
        )
        """for each row: lane -> m, m, arc lengths at which it begins and ends"""
        self.stop_s: Array = np.array(
            [a[p.before_junction - 1, 1] for a, p in zip(spans, sources, strict=True)]
        )
        """(P,) m, the stop line"""
        self.exit_s: Array = np.array([a[-p.after_junction, 0] for a, p in zip(spans, sources, strict=True)])
        """(P,) m, where the junction ends"""
        self.stop_heading: Array = np.array(
            [np.interp(at, s, heading) for at, heading in zip(self.stop_s, self.heading, strict=True)]
        )
        """(P,) rad, at the stop line"""
        self.yields = yields
        """(P, P), [i, j]: traffic on i must yield to traffic on j"""
        self.poses: Array = np.concatenate([self.xy, self.heading[..., None]], axis=2).reshape(-1, 3)
        """(P * M, 3) x m, y m and heading rad of all stations, row after row"""
        self.stations = stations
        """M"""
        self._where = _index(sources, spans, arms, edges)
        self._rows: dict[tuple[str, str], list[int]] = {}
        for row, source in enumerate(sources):
            self._rows.setdefault((arms[source.origin], arms[source.destination]), []).append(row)
        for array in (self.length, self.xy, self.heading, self.origin, self.destination, self.speed_limit):
            array.flags.writeable = False
        for array in (self.stop_s, self.exit_s, self.stop_heading, self.yields, self.poses):
            array.flags.writeable = False

    @property
    def count(self) -> int:
        """P, the number of rows."""
        return len(self.length)

    def pose(self, rows: Index, s: Array) -> tuple[Array, Array, Array]:
        """x m, y m and heading rad, each (...), at arc length s (...) m on rows (...); straight on beyond the
        ends."""
        at = np.asarray(s) * (1.0 / SPACING)
        i = np.minimum(np.maximum(at, 0.0), self.stations - 2.0).astype(np.int64)
        t = (at - i)[..., None]
        i = i + np.asarray(rows) * self.stations
        low = self.poses[i]
        pose = low + t * (self.poses[i + 1] - low)
        return pose[..., 0], pose[..., 1], pose[..., 2]

    def body_pose(self, rows: Index, s: Array, length: float) -> tuple[Array, Array]:
        """(..., 2) m and (...) rad, centre and heading of vehicles of `length` m on rows (...), at s (...) m
        on them: both ends are on the way, as SUMO moves them."""
        x, y, _ = self.pose(rows, s + 0.5 * length)
        u, v, _ = self.pose(rows, s - 0.5 * length)
        return 0.5 * np.stack([x + u, y + v], axis=-1), np.arctan2(y - v, x - u)

    def highest_limit(self, rows: Index, begin: Array, end: Array) -> Array:
        """(n,) m/s, the highest speed limit on rows (n,) from `begin` (n,) m to `end` (n,) m, or at `begin`
        if that is farther on.
        """
        if self._limit.shape[1] == 1:
            return self._limit[rows, 0]
        reached = self._limit_from.take(rows, axis=0) <= np.maximum(begin, end)[:, None]
        ahead = begin[:, None] < self._limit_until.take(rows, axis=0)
        return (self._limit.take(rows, axis=0) * (reached & ahead)).max(axis=1)

    def locate(self, origin: str, destination: str, lane_id: str, lane_pos: float) -> tuple[int, float]:
        """Row and s (m) of a vehicle on that movement at lane_pos m on the lane; (-1, 0.0) when unknown.

        A lane of the movement's edges that has no way to the destination stands for the nearest one that has.
        """
        found = self._where.get((origin, destination, lane_id))
        if found is None:
            return -1, 0.0
        row, start, scale = found
        return row, start + lane_pos * scale

    def alongside(self, origin: str, destination: str, line: Array) -> tuple[int, float, float]:
        """The row of that movement nearest to a line (K, 2) m, and the s (m) on it beside the line's begin
        and end, which may lie beyond the row's own ends; (-1, 0.0, 0.0) where there is no such movement.

        For vehicles on lanes that no row has: bus and cycle lanes, and lanes that end before the arm does.
        """
        along = arc_length(line)
        points = resample(line, np.linspace(0.0, along[-1], 5))
        found = (math.inf, -1, 0.0, 0.0)
        for row in self._rows.get((origin, destination), ()):
            away = np.hypot(*np.moveaxis(points[:, None] - self.xy[row], -1, 0))
            nearest = away[:, : int(self.length[row] / SPACING) + 1].argmin(axis=1)
            heading = self.heading[row, nearest]
            d = points - self.xy[row, nearest]
            ahead = d[:, 0] * np.cos(heading) + d[:, 1] * np.sin(heading)
            aside = d[:, 1] * np.cos(heading) - d[:, 0] * np.sin(heading)
            s = nearest * SPACING + ahead
            found = min(found, (float(np.abs(aside).mean()), row, float(s[0]), float(s[-1])))
        return found[1:]


def _lane_spans(shapes: Sequence[Array]) -> Array:
    """(L, 2) m, arc lengths at which each of the L lanes begins and ends."""
    along = arc_length(np.concatenate(shapes))
    counts = np.array([len(shape) for shape in shapes])
    ends = np.cumsum(counts)
    return np.column_stack([along[ends - counts], along[ends - 1]])


def _limits(limits: Sequence[float], spans: Array) -> tuple[tuple[float, float], ...]:
    """(m, m/s): where each limit begins to count, and the limit, for lanes with these limits and spans."""
    found = [(-math.inf, limits[0])]
    for limit, begin in zip(limits[1:], spans[1:, 0].tolist(), strict=True):
        if limit != found[-1][1]:
            found.append((begin, limit))
    return tuple(found)


def _side_by_side(limits: Sequence[tuple[tuple[float, float], ...]]) -> tuple[Array, Array, Array]:
    """(P, K) m/s, m and m: the limits of each row, where each begins to count, and where it ends; rows with
    fewer than K are filled up with limits that never count.
    """
    most = max(map(len, limits))
    padded = np.array([[*row, *[(math.inf, 0.0)] * (most - len(row))] for row in limits])
    begin, limit = padded[..., 0], padded[..., 1]
    return limit, begin, np.pad(begin[:, 1:], ((0, 0), (0, 1)), constant_values=math.inf)


Where = dict[tuple[str, str, str], tuple[int, float, float]]
"""(origin, destination, lane) -> row, s at the lane's start in m, drawn / stated length of the lane"""


def _index(sources: Sequence[PathSource], spans: Sequence[Array], arms: Sequence[str], edges: Edges) -> Where:
    where: Where = {}
    for row, (source, span) in enumerate(zip(sources, spans, strict=True)):
        key = (arms[source.origin], arms[source.destination])
        for k, lane_id in enumerate(source.lane_ids):
            scale = float(span[k, 1] - span[k, 0]) / max(source.stated_lengths[k], 1e-6)
            where.setdefault((*key, lane_id), (row, float(span[k, 0]), scale))
    for source in sources:
        key = (arms[source.origin], arms[source.destination])
        for lane_id in source.lane_ids:
            _stand_in(where, key, edges.get(lane_id.rpartition("_")[0], ()))
    return where


def _stand_in(where: Where, key: tuple[str, str], siblings: Sequence[str]) -> None:
    """Enter each of an edge's lanes that has no way to the destination as the nearest one that has."""
    known = [index for index, lane_id in enumerate(siblings) if (*key, lane_id) in where]
    entries = {index: where[(*key, siblings[index])] for index in known}
    for index, lane_id in enumerate(siblings):
        if entries and index not in entries:
            nearest = min(known, key=lambda other: abs(other - index))
            where.setdefault((*key, lane_id), entries[nearest])
