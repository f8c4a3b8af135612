"""Square pieces of the drivable area as raster points: signed distance to the edge, direction of travel."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial import KDTree

from rudc.arrays import Array, Flags
from rudc.network.polyline import GAP, arc_length, headings, in_any, inside, resample

CELL = 0.25
"""m, spacing of the raster points"""
CELLS = 64
"""cells along each side of a tile"""
SIDE = CELL * CELLS
"""m, side of a tile"""
POINTS_AT_ONCE = 512
"""points handled at a time, so that their distances to the whole edge stay in the processor's cache"""
SEAM = 0.25
"""m: places nearer than this to the edges of both of two lanes lie between the lanes, not on both"""
HALO = 2
"""raster points around a tile that are looked at too, so that seams at its border are closed"""
_ROW = CELLS + 1


class Edge:
    """The edge of the drivable area, in straight pieces ("straights")."""

    def __init__(self, straights: Array) -> None:
        """`straights` (E, 2, 2) m, from and to."""
        self._straights = straights
        self._start_x, self._start_y = straights[:, 0].T.copy()
        self._step_x, self._step_y = (straights[:, 1] - straights[:, 0]).T.copy()
        self._inverse_square = 1.0 / (self._step_x**2 + self._step_y**2)

    def nearest(self, points: Array) -> Array:
        """(N, 2) m, nearest point of the edge to points (N, 2): the best on all its straights."""
        nearest = np.empty_like(points)
        for first in range(0, len(points), POINTS_AT_ONCE):
            part = points[first : first + POINTS_AT_ONCE]
            away_x, away_y = self._away(part)
            best = np.arange(len(part)), (away_x * away_x + away_y * away_y).argmin(axis=1)
            nearest[first : first + len(part), 0] = part[:, 0] - away_x[best]
            nearest[first : first + len(part), 1] = part[:, 1] - away_y[best]
        return nearest

    def around(self, point: Array, radius: float) -> Edge:
        """The straights of which one is the nearest to any place within `radius` m of a point (2,)."""
        gap = np.hypot(*self._away(point[None]))[0]
        return Edge(self._straights[gap <= gap.min() + 2 * radius])

    def _away(self, points: Array) -> tuple[Array, Array]:
        """(N, E) m each, x and y of the ways from the nearest point of each straight to points (N, 2)."""
        away_x, away_y = points[:, :1] - self._start_x, points[:, 1:] - self._start_y
        along = (away_x * self._step_x + away_y * self._step_y) * self._inverse_square
        along = np.minimum(np.maximum(along, 0.0), 1.0)
        away_x -= along * self._step_x
        away_y -= along * self._step_y
        return away_x, away_y


class Tile:
    """A square of raster points. Immutable."""

    __slots__ = ("_distance", "_value", "_way", "_x", "_y")

    def __init__(self, x: float, y: float, distance: Array, direction: Array) -> None:
        """Corner (m, m); signed distance (m) and direction (rad) of its (CELLS + 1)^2 raster points, flat,
        along y first."""
        self._x, self._y, self._distance = x, y, distance
        self._value, self._way = distance.item, direction.item

    def depths(self, xy: Array) -> Array:
        """(N,) m, signed distance of xy (N, 2)."""
        u, v = (xy[:, 0] - self._x) * (1.0 / CELL), (xy[:, 1] - self._y) * (1.0 / CELL)
        i, j = np.minimum(u.astype(np.int64), CELLS - 1), np.minimum(v.astype(np.int64), CELLS - 1)
        u, v, at, flat = u - i, v - j, i * _ROW + j, self._distance
        near = flat[at] + v * (flat[at + 1] - flat[at])
        far = flat[at + _ROW]
        far = far + v * (flat[at + _ROW + 1] - far)
        return near + u * (far - near)

    def depth(self, x: float, y: float) -> float:
        """Signed distance (m) of one point (m, m)."""
        u, v = (x - self._x) / CELL, (y - self._y) / CELL
        i, j, value = min(int(u), CELLS - 1), min(int(v), CELLS - 1), self._value
        u, v, at = u - i, v - j, i * _ROW + j
        near = value(at) * (1 - v) + value(at + 1) * v
        far = value(at + _ROW) * (1 - v) + value(at + _ROW + 1) * v
        return near * (1 - u) + far * u

    def direction(self, x: float, y: float) -> float:
        """Direction of travel (rad) at one point (m, m); nan where none is given."""
        return self._way(int((x - self._x) / CELL + 0.5) * _ROW + int((y - self._y) / CELL + 0.5))


class TileMaker:
    """Makes tiles of an area."""

    def __init__(self, polygons: Sequence[Array], lanes: Sequence[tuple[Array, Array]], edge: Edge) -> None:
        """As for `Surface`, with the edge of the polygons' union."""
        self._polygons, self._lanes, self._edge = polygons, lanes, edge
        self._extents = _extents(polygons)
        self._lane_extents = _extents([polygon for _, polygon in lanes])

    def make(self, column: int, row: int) -> Tile:
        """The tile whose corner lies at (column SIDE, row SIDE) m."""
        corner = SIDE * np.array([column, row])
        points = _raster(corner, _ROW)
        edge = self._edge.around(corner + SIDE / 2, SIDE / np.sqrt(2))
        gap = np.hypot(*(edge.nearest(points) - points).T)
        distance = np.where(self._drivable(corner), gap, -gap)
        direction = self._directions(points)
        distance.flags.writeable = direction.flags.writeable = False
        return Tile(float(corner[0]), float(corner[1]), distance, direction)

    def _drivable(self, corner: Array) -> Flags:
        """Whether the area holds each raster point, seams between lanes included.

        A seam (files state corners to the centimetre) is a place with the area within GAP on both sides, as
        for `union_boundary`.
        """
        side = _ROW + 2 * HALO
        points = _raster(corner - HALO * CELL, side)
        polygons = [self._polygons[k] for k in _reaching(self._extents, points)]
        drivable = in_any(polygons, points)
        grid = drivable.reshape(side, side)
        beside = np.flatnonzero(_dilated(grid).ravel() & ~drivable)
        angles = np.arange(0.0, np.pi, np.pi / 4)
        steps = GAP * np.column_stack([np.cos(angles), np.sin(angles)])
        sides = points[beside] + np.array([steps, -steps])[:, :, None]  # (2, 4, n, 2)
        held = in_any(polygons, sides.reshape(-1, 2)).reshape(sides.shape[:-1])
        drivable[beside[held.all(axis=0).any(axis=0)]] = True
        return grid[HALO:-HALO, HALO:-HALO].ravel()

    def _directions(self, points: Array) -> Array:
        """rad, direction of travel at the raster points; nan where lanes of opposite directions overlap."""
        direction, room = np.full(len(points), np.nan), np.zeros(len(points))
        both = np.zeros(len(points), dtype=np.bool_)
        for k in _reaching(self._lane_extents, points):
            line, polygon = self._lanes[k]
            hit = np.flatnonzero(inside(polygon, points))
            if not len(hit):
                continue
            length = float(arc_length(line)[-1])
            dense = resample(line, np.linspace(0.0, length, max(2, round(length / 0.5) + 1)))
            away, nearest = KDTree(dense).query(points[hit])
            way, to_edge = headings(dense)[nearest], np.hypot(*(polygon[0] - line[0])) - away
            against = np.cos(way - direction[hit]) < 0.0  # False where there was no lane
            both[hit] |= against & (np.maximum(to_edge, room[hit]) > SEAM)
            direction[hit], room[hit] = way, to_edge
        direction[both] = np.nan
        return direction


def _extents(polygons: Sequence[Array]) -> Array:
    """(2, K, 2) m, the least and the greatest coordinates of each polygon."""
    return np.array([[p.min(axis=0) for p in polygons], [p.max(axis=0) for p in polygons]]).reshape(2, -1, 2)


def _reaching(extents: Array, points: Array) -> list[int]:
    """Indices of those of the `extents` (2, K, 2) m that come within GAP of a raster of points (N, 2)."""
    low, high = extents
    return np.flatnonzero(np.all((low <= points[-1] + GAP) & (high >= points[0] - GAP), axis=1)).tolist()


def _dilated(grid: Flags) -> Flags:
    """(n, n) True also at points from which HALO steps to points beside lead to a True one of the grid
    (n, n).
    """
    for _ in range(HALO):
        wide = np.pad(grid, 1)
        grid = wide[1:-1, 1:-1] | wide[:-2, 1:-1] | wide[2:, 1:-1] | wide[1:-1, :-2] | wide[1:-1, 2:]
    return grid


def _raster(corner: Array, side: int) -> Array:
    """(side^2, 2) m, raster points from a corner on, along y first."""
    i, j = np.meshgrid(np.arange(side), np.arange(side), indexing="ij")
    return corner + CELL * np.column_stack([i.ravel(), j.ravel()])
