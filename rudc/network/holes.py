"""Holes that netconvert leaves in the road where the outlines of lanes and nodes do not quite meet.

They belong to the road: who drives over one does not leave it. Round a hole runs a closed piece of the road's
edge that touches no other piece and is no longer than HOLE_M; no kerb is so short.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import ConvexHull, KDTree, QhullError

from rudc.arrays import Array
from rudc.network.polyline import union_boundary

HOLE_M = 3.0
"""m, the longest hole"""
JOINED_M = 0.3
"""m between the middles of neighbouring pieces of an edge, at most; the pieces are 0.25 m long"""
LEAST = 3
"""pieces round a hole, at least; fewer are a seam, without room between its sides"""


def without_holes(polygons: Sequence[Array]) -> tuple[tuple[Array, ...], Array]:
    """Polygons (K, 2) m, then those that fill the holes of their union; and the boundary (B, 2, 2) m of them
    all, as `union_boundary`."""
    boundary = union_boundary(polygons)
    fillings = list(_fillings(boundary))
    if not fillings:
        return tuple(polygons), boundary
    filled = (*polygons, *fillings)
    return filled, union_boundary(filled)


def _fillings(boundary: Array) -> Iterator[Array]:
    """The convex hull (K, 2) m of each hole that a boundary (B, 2, 2) m has."""
    pairs = KDTree(boundary.mean(axis=1)).query_pairs(JOINED_M, output_type="ndarray")
    side = len(boundary)
    joined = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(side, side))
    _, part = connected_components(joined, directed=False)
    order = np.argsort(part, kind="stable")
    for rows in np.split(order, np.flatnonzero(np.diff(part[order])) + 1):
        ends = boundary[rows].reshape(-1, 2)
        if len(rows) >= LEAST and np.hypot(*np.ptp(ends, axis=0)) < HOLE_M:
            with contextlib.suppress(QhullError):  # on one line: nothing to fill
                yield ends[ConvexHull(ends).vertices]
