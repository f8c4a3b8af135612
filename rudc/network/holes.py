"""Holes that netconvert leaves in the road where the outlines of lanes and nodes do not quite meet.

They belong to the road: nobody leaves it, and nothing ends there. A hole is a part of the road's edge that
hangs together, apart from all others, and is no longer than HOLE_M: no kerb is so short.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import ConvexHull, KDTree, QhullError

from rudc.arrays import Array, Index
from rudc.network.polyline import union_boundary

HOLE_M = 3.0
"""m, the longest hole"""
JOINED_M = 0.3
"""m between the middles of neighbouring pieces of an edge, at most; the pieces are 0.25 m long"""


def without_holes(polygons: Sequence[Array]) -> tuple[tuple[Array, ...], Array]:
    """Polygons (K, 2) m, then those that fill the holes of their union; and the boundary (B, 2, 2) m of them
    all, as `union_boundary`."""
    boundary = union_boundary(polygons)
    holes = _holes(boundary)
    if not holes:
        return tuple(polygons), boundary
    filled = (*polygons, *(hull for rows in holes for hull in _hull(boundary[rows].reshape(-1, 2))))
    boundary = union_boundary(filled)
    return filled, np.delete(boundary, np.concatenate([[], *_holes(boundary)]).astype(int), axis=0)


def _holes(boundary: Array) -> list[Index]:
    """The rows of a boundary (B, 2, 2) m that belong to each hole."""
    pairs = KDTree(boundary.mean(axis=1)).query_pairs(JOINED_M, output_type="ndarray")
    side = len(boundary)
    joined = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(side, side))
    _, part = connected_components(joined, directed=False)
    order = np.argsort(part, kind="stable")
    parts = np.split(order, np.flatnonzero(np.diff(part[order])) + 1)
    return [rows for rows in parts if np.hypot(*np.ptp(boundary[rows].reshape(-1, 2), axis=0)) < HOLE_M]


def _hull(points: Array) -> list[Array]:
    """The convex hull (K, 2) m of points (N, 2) m; none if they lie on one line."""
    try:
        return [points[ConvexHull(points).vertices]]
    except QhullError:
        return []
