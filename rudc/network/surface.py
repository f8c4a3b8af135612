"""The drivable area as rasters: signed distance to its edge and direction of travel.

The area is the union of polygons (lanes and junctions). Each raster point within BAND m of the area holds its
exact distance to the union's boundary, d > 0 inside; farther out the distance is that of the Euclidean
distance transform, and beyond MARGIN m around the area's extent it stays what it is there. Between raster
points d is interpolated bilinearly, which is exact where the edge is straight.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.ndimage import binary_dilation, distance_transform_edt
from scipy.spatial import KDTree

from rudc.arrays import Array, Flags, Index
from rudc.network.polyline import GAP, headings, in_any, inside, resample, straightened, union_boundary

CELL = 0.25
"""m, spacing of the raster points"""
BAND = 2.0
"""m around the area in which the distance is exact"""
POINTS_AT_ONCE = 512
"""whose distances to all straights of the edge are kept at a time; they stay in the processor's cache"""
MARGIN = 12.0
"""m of raster beyond the area's extent"""


class Surface:
    """Drivable area of a network. Immutable."""

    def __init__(self, polygons: Sequence[Array], lanes: Sequence[tuple[Array, Array]]) -> None:
        """`polygons`: (K, 2) m each, whose union is drivable; `lanes`: (centre line (K, 2) m, polygon) of
        each lane that gives a direction of travel."""
        corners = np.concatenate(list(polygons))
        self.polygons = tuple(polygons)
        self.boundary = union_boundary(self.polygons)
        """(B, 2, 2) m, the edge in short straight pieces"""
        self.origin = np.floor(corners.min(axis=0) - MARGIN)
        """(2,) m, raster point [0, 0]"""
        self.shape = tuple(int(n) for n in np.ceil((corners.max(axis=0) + MARGIN - self.origin) / CELL) + 1)
        """raster points along x and y"""
        self._x0, self._y0 = (float(v) for v in self.origin)
        straights = straightened(self.boundary)
        self._start_x, self._start_y = straights[:, 0].T.copy()
        self._step_x, self._step_y = (straights[:, 1] - straights[:, 0]).T.copy()
        self._inverse_square = 1.0 / (self._step_x**2 + self._step_y**2)
        self._distance = self._build_distance()
        self._directions, which = np.unique(self._build_direction(lanes), return_inverse=True)
        self._direction = which.astype(np.min_scalar_type(len(self._directions)))
        """(X * Y,) which of the few directions there are; a quarter of the memory"""
        self._last = np.array([self.shape[0] - 1.001, self.shape[1] - 1.001])
        for array in (self.boundary, self._distance, self._direction, self._directions, self.origin):
            array.flags.writeable = False

    def signed_distance(self, xy: Array) -> Array:
        """(...) m, distance from xy (..., 2) to the edge of the drivable area, positive inside."""
        cell = (np.asarray(xy) - self.origin) * (1.0 / CELL)
        cell = np.minimum(np.maximum(cell, 0.0), self._last)
        low = cell.astype(np.int64)
        t = cell - low
        columns = self.shape[1]
        at = low[..., 0] * columns + low[..., 1]
        flat = self._distance
        ty = t[..., 1]
        near = flat[at] + ty * (flat[at + 1] - flat[at])
        far = flat[at + columns]
        far = far + ty * (flat[at + columns + 1] - far)
        return near + t[..., 0] * (far - near)

    def project(self, xy: Array) -> Array:
        """(..., 2) m, the point of the edge nearest to xy (..., 2)."""
        points = np.asarray(xy, dtype=float)
        flat = points.reshape(-1, 2)
        return self._nearest(flat).reshape(points.shape)

    def lane_direction(self, xy: Array) -> Array:
        """(...) rad, direction of travel of the lane under xy (..., 2); nan inside nodes and off the road."""
        cell = (np.asarray(xy) - self.origin) * (1.0 / CELL) + 0.5
        cell = np.minimum(np.maximum(cell, 0.0), self._last).astype(np.int64)
        return self._directions[self._direction[cell[..., 0] * self.shape[1] + cell[..., 1]]]

    def depth(self, x: float, y: float) -> float:
        """`signed_distance` (m) of one point (m, m), in plain arithmetic: ten times as fast for so few."""
        u = min(max((x - self._x0) / CELL, 0.0), self.shape[0] - 1.001)
        v = min(max((y - self._y0) / CELL, 0.0), self.shape[1] - 1.001)
        i, j, columns, value = int(u), int(v), self.shape[1], self._distance.item
        u, v, at = u - i, v - j, i * columns + j
        near = value(at) * (1 - v) + value(at + 1) * v
        far = value(at + columns) * (1 - v) + value(at + columns + 1) * v
        return near * (1 - u) + far * u

    def direction(self, x: float, y: float) -> float:
        """`lane_direction` (rad) at one point (m, m)."""
        i = int(min(max((x - self._x0) / CELL + 0.5, 0.0), self.shape[0] - 1.001))
        j = int(min(max((y - self._y0) / CELL + 0.5, 0.0), self.shape[1] - 1.001))
        return self._directions.item(self._direction.item(i * self.shape[1] + j))

    def _nearest(self, points: Array) -> Array:
        """(N, 2) m, nearest point of the edge to points (N, 2): the best on all its straights."""
        nearest = np.empty_like(points)
        for first in range(0, len(points), POINTS_AT_ONCE):
            part = points[first : first + POINTS_AT_ONCE]
            away_x, away_y = part[:, :1] - self._start_x, part[:, 1:] - self._start_y
            along = (away_x * self._step_x + away_y * self._step_y) * self._inverse_square
            along = np.minimum(np.maximum(along, 0.0), 1.0)
            away_x -= along * self._step_x
            away_y -= along * self._step_y
            best = np.arange(len(part)), (away_x * away_x + away_y * away_y).argmin(axis=1)
            nearest[first : first + len(part), 0] = part[:, 0] - away_x[best]
            nearest[first : first + len(part), 1] = part[:, 1] - away_y[best]
        return nearest

    def _window(self, polygon: Array) -> tuple[Index, Array]:
        """Flat indices and positions (N, 2) m of the raster points in the polygon's bounding box."""
        low = np.floor((polygon.min(axis=0) - self.origin) / CELL).astype(int)
        high = np.ceil((polygon.max(axis=0) - self.origin) / CELL).astype(int) + 1
        i, j = np.meshgrid(np.arange(low[0], high[0]), np.arange(low[1], high[1]), indexing="ij")
        index = (i * self.shape[1] + j).ravel()
        return index, self.origin + CELL * np.column_stack([i.ravel(), j.ravel()])

    def _build_distance(self) -> Array:
        """(X * Y,) m, signed distance at the raster points."""
        drivable = np.zeros(self.shape[0] * self.shape[1], dtype=bool)
        for polygon in self.polygons:
            index, xy = self._window(polygon)
            drivable[index] |= inside(polygon, xy)
        self._close_seams(drivable)
        outside = np.asarray(distance_transform_edt(~drivable.reshape(self.shape))).ravel() * CELL
        distance = -outside
        near = np.flatnonzero(outside < BAND + 2 * CELL)
        xy = self.origin + CELL * np.column_stack(np.divmod(near, self.shape[1]))
        gap = np.hypot(*(self._nearest(xy) - xy).T)
        distance[near] = np.where(drivable[near], gap, -gap)
        return distance

    def _close_seams(self, drivable: Flags) -> None:
        """Marks raster points in a seam between lanes as drivable (files state corners to the centimetre).

        A seam is what has the area on both sides within GAP, as for `union_boundary`.
        """
        grid = drivable.reshape(self.shape)
        beside = np.flatnonzero(np.asarray(binary_dilation(grid, iterations=2), dtype=bool) & ~grid)
        xy = self.origin + CELL * np.column_stack(np.divmod(beside, self.shape[1]))
        for angle in np.arange(0.0, np.pi, np.pi / 4):
            step = GAP * np.array([np.cos(angle), np.sin(angle)])
            between = in_any(self.polygons, xy + step) & in_any(self.polygons, xy - step)
            drivable[beside[between]] = True

    def _build_direction(self, lanes: Sequence[tuple[Array, Array]]) -> Array:
        """(X * Y,) rad, direction of travel at the raster points."""
        direction = np.full(self.shape[0] * self.shape[1], np.nan)
        for line, polygon in lanes:
            index, xy = self._window(polygon)
            hit = in_any((polygon,), xy)
            index, xy = index[hit], xy[hit]
            length = float(np.sum(np.hypot(*np.diff(line, axis=0).T)))
            dense = resample(line, np.linspace(0.0, length, max(2, round(length / 0.5) + 1)))
            _, nearest = KDTree(dense).query(xy)
            direction[index] = headings(dense)[nearest]
        return direction
