"""Tables of a route: where other paths lie along it, and the gaps between vehicles on them. They do not
depend on the episode, and are computed when they are first needed.

For every 0.5 m of every way through the junction on which somebody was seen, they contain arc length, lateral
offset and direction relative to the ego's path. For every such way that is in conflict with the ego's
(`Network.conflict`), and every size of vehicle seen on it so far, they contain the gap between the two
rectangles for each pair of arc lengths, up to 10 m, in steps of 4 cm. So gaps in many predicted futures are
only looked up.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rudc.arrays import Array, Index
from rudc.env.kernels import FARTHEST, UNIT, seen_from_line
from rudc.network.kernels import gaps_at
from rudc.network.network import Network, Route
from rudc.network.paths import SPACING
from rudc.vehicle import EgoVehicle

LONG = 6.0
"""m, of vehicles longer than this the tables know that both ends are on the way, as SUMO moves them; cars
have their centre on it, as the shipped agents have learnt it
"""


class RouteTables:
    """Tables of one route of one network; gap tables are added when a size of vehicle is first seen."""

    def __init__(self, network: Network, route: Route) -> None:
        self.network, self.route = network, route
        paths, conflict = network.paths, network.conflict(route)
        in_zone = np.column_stack([conflict[:, 2], np.minimum(conflict[:, 3], paths.exit_s)])
        in_zone[paths.origin == paths.origin[route.row]] = np.nan
        self.rows: Array = np.column_stack([conflict[:, 1], conflict[:, 3], in_zone, paths.speed_limit])
        """(P, 5) for each way through the junction: arc length (m) on the ego's path and on this way
        where their conflict ends; arc lengths (m) on this way where it enters and leaves the ego's
        conflict zone (nan: never); speed limit, m/s"""
        self.per_row = paths.heading.shape[1]
        self._lines: Array = np.zeros((paths.heading.size, 4))
        """(P * M, 4) as `lines` returns it; 0 for ways on which nobody was seen yet"""
        self._lined: set[int] = {-1}
        """rows of the ways whose stations are filled in, and -1 for no way"""
        self._entries: dict[tuple[float, float], dict[int, tuple[int, ...]]] = {}
        """length and width of the ego, m -> path and size of another -> place of their table"""
        self._gaps = np.zeros(0, dtype=np.uint8)

    def lines(self, path: Index) -> Array:
        """(P * M, 4) for each station of each way on which others are, `path` (N,), -1 for none: arc
        length on the ego's path (m), offset to its left (m), cosine and sine of the angle to it.
        """
        ours = self.route.path
        for row in set(path.tolist()) - self._lined:
            paths, first = self.network.paths, row * self.per_row
            self._lines[first : first + self.per_row] = seen_from_line(
                ours.xy, ours.heading, SPACING, paths.xy[row], paths.heading[row]
            )
            self._lined.add(row)
        return self._lines

    def find(self, body: EgoVehicle, codes: Index) -> tuple[NDArray[np.uint8], Index]:
        """All gap tables in one array, and (K, 6) the place of each vehicle's table in it (see `_add`).
        `codes` (K,): path and size of each vehicle (`kernels.code`).
        """
        known, wanted = self._entries.setdefault((body.length, body.width), {}), codes.tolist()
        for code in wanted:
            if code not in known:
                known[code] = self._add(body, code)
        entries = np.array([known[code] for code in wanted], dtype=np.int64).reshape(-1, 6)
        return self._gaps, entries

    def _add(self, body: EgoVehicle, code: int) -> tuple[int, ...]:
        """Make the table for a path and a size, and return its place: where it begins in `_gaps`, the ego's
        first and last station in it, those of the other, and the number of the other's stations.
        """
        row, decimetres = divmod(code, 1_000_000)
        size = np.array(divmod(decimetres, 1000)) / 10.0
        first, their_first, table = self._gap_table(row, size, body)
        last, their_last = first + table.shape[0] - 1, their_first + table.shape[1] - 1
        base = len(self._gaps)
        self._gaps = np.concatenate([self._gaps, table.ravel()])
        return base, first, last, their_first, their_last, table.shape[1]

    def _gap_table(self, row: int, size: Array, body: EgoVehicle) -> tuple[int, int, NDArray[np.uint8]]:
        """First stations of the ego and of the other, and gaps (E, O) in units of UNIT; those at the
        border are `FARTHEST`.
        """
        paths, path = self.network.paths, self.route.path
        count = int(paths.length[row] / SPACING) + 1
        xy, heading = paths.xy[row, :count], paths.heading[row, :count]
        if size[0] > LONG:
            at: Array = SPACING * np.arange(count, dtype=np.float64)
            xy, heading = paths.body_pose(np.full(count, row), at, float(size[0]))
        gaps = gaps_at(
            path.xy, path.heading, body.length, body.width,
            xy, heading, np.broadcast_to(size, (count, 2)), FARTHEST,
        )  # fmt: skip
        ours, theirs = (np.flatnonzero(np.isfinite(gaps).any(axis=axis)) for axis in (1, 0))
        if not len(ours):
            return 0, 0, np.full((1, 1), round(FARTHEST / UNIT), dtype=np.uint8)
        first, their_first = int(ours[0]) - 1, int(theirs[0]) - 1
        near = gaps[ours[0] : ours[-1] + 1, theirs[0] : theirs[-1] + 1]
        table = np.full((near.shape[0] + 2, near.shape[1] + 2), round(FARTHEST / UNIT), dtype=np.uint8)
        table[1:-1, 1:-1] = np.rint(np.minimum(near, FARTHEST) / UNIT)
        return first, their_first, table
