"""The drivable area: signed distance to its edge and direction of travel.

The area is the union of polygons (lanes and junctions). Distances are kept as square tiles of raster points
(`tiles.py`), each made when it is first asked for: reading a network costs the same however long its arms
are, and memory grows with the ground that was driven. Each raster point holds its exact distance to the
union's boundary, d > 0 inside; between raster points d is interpolated bilinearly, which is exact where the
edge is straight. Farther than MARGIN m from the area's extent, values are those at that margin.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rudc.arrays import Array
from rudc.network.holes import without_holes
from rudc.network.polyline import straightened
from rudc.network.tiles import SIDE, Edge, Tile, TileMaker

MARGIN = 12.0
"""m beyond the area's extent where places are still told apart"""


class Surface:
    """Drivable area of a network. Immutable, except that tiles are made when they are first asked for."""

    def __init__(self, polygons: Sequence[Array], lanes: Sequence[tuple[Array, Array]]) -> None:
        """`polygons`: (K, 2) m each, whose union is drivable; `lanes`: (centre line (K, 2) m, polygon) of
        each lane that gives a direction of travel."""
        corners = np.concatenate(list(polygons))
        self.polygons, self.boundary = without_holes(polygons)
        """the polygons, those that fill holes last; (B, 2, 2) m, the edge in short straight pieces"""
        self.boundary.flags.writeable = False
        self._low, self._high = corners.min(axis=0) - MARGIN, corners.max(axis=0) + MARGIN
        self._west, self._south = (float(v) for v in self._low)
        self._east, self._north = (float(v) for v in self._high)
        self._edge = Edge(straightened(self.boundary))
        self._maker = TileMaker(self.polygons, lanes, self._edge)
        self._tiles: dict[tuple[int, int], Tile] = {}

    def signed_distance(self, xy: Array) -> Array:
        """(...) m, distance from xy (..., 2) to the edge of the drivable area, positive inside."""
        places = np.asarray(xy, dtype=float)
        flat = np.minimum(np.maximum(places.reshape(-1, 2), self._low), self._high)
        result = np.empty(len(flat))
        if not len(flat):
            return result.reshape(places.shape[:-1])
        cells = np.floor(flat * (1.0 / SIDE)).astype(np.int64)
        first, rows = cells.min(axis=0), int(np.ptp(cells[:, 1])) + 1
        tiles, which = np.unique((cells - first) @ (rows, 1), return_inverse=True)
        for k, tile in enumerate(tiles.tolist()):
            mine = which == k
            column, row = int(first[0]) + tile // rows, int(first[1]) + tile % rows
            result[mine] = self._tile(column, row).depths(flat[mine])
        return result.reshape(places.shape[:-1])

    def project(self, xy: Array) -> Array:
        """(..., 2) m, the point of the edge nearest to xy (..., 2)."""
        points = np.asarray(xy, dtype=float)
        return self._edge.nearest(points.reshape(-1, 2)).reshape(points.shape)

    def depth(self, x: float, y: float) -> float:
        """`signed_distance` (m) of one point (m, m), in plain arithmetic: ten times as fast for a single
        one."""
        x, y = min(max(x, self._west), self._east), min(max(y, self._south), self._north)
        return self._tile(int(x // SIDE), int(y // SIDE)).depth(x, y)

    def direction(self, x: float, y: float) -> float:
        """rad, direction of travel of the lane under a point (m, m); nan inside nodes, off the road, and
        where lanes of opposite directions overlap."""
        x, y = min(max(x, self._west), self._east), min(max(y, self._south), self._north)
        return self._tile(int(x // SIDE), int(y // SIDE)).direction(x, y)

    def _tile(self, column: int, row: int) -> Tile:
        """The tile of that place, made now if there is none yet."""
        tile = self._tiles.get((column, row))
        if tile is None:
            tile = self._tiles[column, row] = self._maker.make(column, row)
        return tile
