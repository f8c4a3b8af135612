"""What can be known of a route before an episode starts: where other paths lie along it, and gaps on them.

For every 0.5 m of every way through the junction: its arc length, lateral offset and direction relative to
the ego's path. For every such way that comes into conflict with the ego's (`Network.conflict`) and every size
of vehicle seen on it so far: the gap between the two rectangles for each pair of arc lengths, up to 10 m, in
steps of 4 cm. With these, predicting gaps for many futures is a matter of looking up.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from rudc.arrays import Array, Index
from rudc.geometry import gaps_between
from rudc.network.network import Network, Route
from rudc.vehicle import EgoVehicle

FARTHEST = 10.0
"""m, gaps above count as this"""
UNIT = 0.04
"""m, step in which gaps are kept"""


class RouteTables:
    """Tables of one route of one network; gap tables are added as sizes of vehicles turn up."""

    def __init__(self, network: Network, route: Route) -> None:
        self.network, self.route = network, route
        self.ds = network.paths.ds
        paths, conflict = network.paths, network.conflict(route)
        in_zone = np.column_stack([conflict[:, 2], np.minimum(conflict[:, 3], paths.exit_s)])
        in_zone[paths.origin == paths.origin[route.row]] = np.nan
        self.rows: Array = np.column_stack([conflict[:, 1], conflict[:, 3], in_zone, paths.speed_limit])
        """(P, 5) for each way through the junction: arc lengths (m) on the ego's path and on it where their
        conflict ends, where it enters and leaves the ego's conflict zone (nan: never); speed limit, m/s"""
        self._per_row = paths.heading.shape[1]
        self._tree = KDTree(route.path.xy)
        self._lines = self.relative_to(paths.xy.reshape(-1, 2), paths.heading.ravel())
        self._entries: dict[tuple[EgoVehicle, int], tuple[int, ...]] = {}
        self._gaps = np.zeros(0, dtype=np.uint8)

    def relative(self, rows: Index, s: Array) -> Array:
        """(N, 4) as in `relative_to`, of arc lengths s (N,) m on rows (N,) of `network.paths`."""
        station = np.minimum(np.maximum(np.rint(s * (1.0 / self.ds)), 0.0), self._per_row - 1.0)
        return self._lines.take((station + rows * self._per_row).astype(np.int64), axis=0, mode="wrap")

    def relative_to(self, xy: Array, heading: Array) -> Array:
        """(N, 4), of poses xy (N, 2) m, heading (N,) rad, relative to the ego's path.

        Arc length on it (m), offset to its left (m), cosine and sine of the angle to it.
        """
        path = self.route.path
        _, nearest = self._tree.query(xy)
        away, course = xy - path.xy[nearest], path.heading[nearest]
        cos, sin = np.cos(course), np.sin(course)
        turn = heading - course
        along = path.s[nearest] + away[:, 0] * cos + away[:, 1] * sin
        return np.column_stack([along, away[:, 1] * cos - away[:, 0] * sin, np.cos(turn), np.sin(turn)])

    def gaps(self, body: EgoVehicle, ego_s: Array, rows: Index, s: Array, size: Array) -> NDArray[np.uint8]:
        """(A, H, T) least gap to any of N others in units of `UNIT`, for A futures of the ego, H of theirs.

        ego_s (A, T) m, rows (N,), s (N, H, T) m, size (N, 2) m.
        """
        entries = np.array(self._find(body, rows, size))
        base, first, last, their_first, their_last, width = entries.T[:, :, None, None]
        per_m = 1.0 / self.ds
        ours = np.minimum(np.maximum(np.rint(ego_s * per_m), first), last)
        theirs = np.minimum(np.maximum(np.rint(s * per_m), their_first), their_last)
        ours *= width
        ours += base - their_first - first * width
        index = ours.astype(np.int64)[:, :, None] + theirs.astype(np.int64)[:, None]
        return self._gaps.take(index).min(axis=0)

    def _find(self, body: EgoVehicle, rows: Index, size: Array) -> list[tuple[int, ...]]:
        """Where in the gap tables each vehicle's is, see `_add`."""
        codes = (rows * 1_000_000 + np.rint(size @ (10_000.0, 10.0)).astype(np.int64)).tolist()
        known = self._entries
        try:
            return [known[body, code] for code in codes]
        except KeyError:
            for code in codes:
                if (body, code) not in known:
                    self._add(body, code)
            return [known[body, code] for code in codes]

    def _add(self, body: EgoVehicle, code: int) -> None:
        """Make the table for a path and a size, coded in decimetres, and note where it is.

        Its base in `_gaps`, the ego's first and last station in it, the other's, and how many the other has.
        """
        row, decimetres = divmod(code, 1_000_000)
        size = np.array(divmod(decimetres, 1000)) / 10.0
        first, their_first, table = self._gap_table(row, size, body)
        last, their_last = first + table.shape[0] - 1, their_first + table.shape[1] - 1
        self._entries[body, code] = (len(self._gaps), first, last, their_first, their_last, table.shape[1])
        self._gaps = np.concatenate([self._gaps, table.ravel()])

    def _gap_table(self, row: int, size: Array, body: EgoVehicle) -> tuple[int, int, NDArray[np.uint8]]:
        """First stations of the ego and of the other, and gaps (E, O), those at the border `FARTHEST`."""
        paths, path = self.network.paths, self.route.path
        count = int(paths.length[row] / self.ds) + 1
        xy, heading = paths.xy[row, :count], paths.heading[row, :count]
        own_size = np.array([body.length, body.width])
        reach = FARTHEST + 0.5 * (np.hypot(*own_size) + np.hypot(*size))
        pairs = KDTree(path.xy).sparse_distance_matrix(KDTree(xy), reach, output_type="ndarray")
        ours, theirs = pairs["i"], pairs["j"]
        if not len(ours):
            return 0, 0, np.full((1, 1), round(FARTHEST / UNIT), dtype=np.uint8)
        gaps = gaps_between(path.xy[ours], path.heading[ours], own_size, xy[theirs], heading[theirs], size)
        first, their_first = int(ours.min()) - 1, int(theirs.min()) - 1
        shape = (int(ours.max()) - first + 2, int(theirs.max()) - their_first + 2)
        table = np.full(shape, round(FARTHEST / UNIT), dtype=np.uint8)
        table[ours - first, theirs - their_first] = np.rint(np.minimum(gaps, FARTHEST) / UNIT)
        return first, their_first, table
