"""The edges of the ego's carriageway as seen from its path: a road barrier keeps the ego between them.

The carriageway is what the movement's own edges and the junction cover. So on the arms the left edge is the
divider to oncoming lanes, and in the junction the edges are its kerbs and the mouths of the other arms. Edges
are found by rays square to the path, and then made into lines: distances above REACH count as REACH; on the
inner side of a bend the edge stays short of the bend's centre; widths change by at most SLOPE, and are
averaged over SMOOTHING m, which never makes them larger. The strip that a car on the path covers, and BESIDE
m on each side of it, always lies between the edges, so that a line may swing out of a narrow lane before a
sharp turn.
"""

from __future__ import annotations

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.spatial import KDTree

from rudc.arrays import Array
from rudc.geometry import rectangle_corners
from rudc.network.paths import SPACING
from rudc.network.route import ReferencePath
from rudc.vehicle import EgoVehicle

BESIDE = 0.3
"""m, more than a road barrier's usual buffer (rudc/safety/road_edges.py)"""
REACH = 6.0
"""m, farthest that an edge is from the path"""
SLOPE = 0.5
"""m of width per m of path that an edge may come or go"""
SMOOTHING = 3.0
"""m of path over which widths are averaged"""
BEND = 0.8
"""largest width on the inner side of a bend, as a share of the bend's radius"""


def edge_widths(boundary: Array, path: ReferencePath, body: EgoVehicle) -> tuple[Array, Array]:
    """(M,), (M,) m from the stations of the path to the left and right edge for a car that follows it.

    `boundary` (B, 2, 2) m: the carriageway's, as of `union_boundary`.
    """
    least_left, least_right = _taken(path, body)
    normal = np.column_stack([-np.sin(path.heading), np.cos(path.heading)])
    to_left, to_right = _cast(path.xy, normal, boundary)
    left, right = _lines(to_left, path.curvature), _lines(to_right, -path.curvature)
    return np.maximum(left, least_left + BESIDE), np.maximum(right, least_right + BESIDE)


def _taken(path: ReferencePath, body: EgoVehicle) -> tuple[Array, Array]:
    """(M,), (M,) m that a car on the path covers to the left and right of each station."""
    xy, psi = path.body_pose(path.s, body)
    corners = rectangle_corners(xy, psi, np.broadcast_to([body.length, body.width], xy.shape)).reshape(-1, 2)
    _, station = KDTree(path.xy).query(corners)
    away, heading = corners - path.xy[station], path.heading[station]
    aside = away[:, 1] * np.cos(heading) - away[:, 0] * np.sin(heading)
    left, right = np.full(len(path.s), 0.5 * body.width), np.full(len(path.s), 0.5 * body.width)
    np.maximum.at(left, station, aside)
    np.maximum.at(right, station, -aside)
    return _windows(left, 5).max(axis=1), _windows(right, 5).max(axis=1)


def _lines(width: Array, bend: Array) -> Array:
    """Widths (M,) m as cast, made continuous; `bend` (M,) 1/m is positive where the path bends to this
    side."""
    wide = np.minimum(width, BEND / np.maximum(bend, BEND / REACH)).tolist()
    for k in range(1, len(wide)):
        wide[k] = min(wide[k], wide[k - 1] + SLOPE * SPACING)
    for k in range(len(wide) - 2, -1, -1):
        wide[k] = min(wide[k], wide[k + 1] + SLOPE * SPACING)
    window = 2 * round(SMOOTHING / SPACING / 2) + 1
    least = _windows(np.array(wide), window).min(axis=1)
    return _windows(least, window).mean(axis=1)


def _windows(values: Array, size: int) -> Array:
    """(M, size) the `size` values around each of the values (M,), an odd number; beyond the ends, the ends
    go on. (scipy.ndimage has filters of this kind, but to import it takes half a second.)
    """
    return sliding_window_view(np.pad(values, size // 2, mode="edge"), size)


def _cast(start: Array, direction: Array, pieces: Array) -> tuple[Array, Array]:
    """(M,), (M,) m from start (M, 2) along unit rays (M, 2), and the other way, to the first boundary piece
    (B, 2, 2) m; REACH if none is nearer.

    With w the piece's start seen from the ray's start and d the piece: hit at distance (w x d) / (u x d), at
    the share (w x u) / (u x d) of the piece.
    """
    ahead, back = np.full(len(start), REACH), np.full(len(start), REACH)
    d = pieces[:, 1] - pieces[:, 0]
    middle = pieces.mean(axis=1)
    reach = REACH + 0.5 * float(np.hypot(*d.T).max())
    for first in range(0, len(start), 32):
        p, u = start[first : first + 32], direction[first : first + 32]
        low, high = p.min(axis=0) - reach, p.max(axis=0) + reach
        near = np.flatnonzero(np.all((middle > low) & (middle < high), axis=1))
        if not len(near):
            continue
        w = pieces[None, near, 0] - p[:, None]
        across = u[:, None, 0] * d[near, 1] - u[:, None, 1] * d[near, 0]
        across = np.where(np.abs(across) < 1e-12, np.nan, across)
        along = (w[..., 0] * d[near, 1] - w[..., 1] * d[near, 0]) / across
        share = (w[..., 0] * u[:, None, 1] - w[..., 1] * u[:, None, 0]) / across
        along[~((share >= -1e-6) & (share <= 1.0 + 1e-6))] = np.nan
        for result, way in ((ahead, along), (back, -along)):
            nearest = np.where(way >= 0.0, way, np.inf).min(axis=1)
            result[first : first + 32] = np.minimum(nearest, REACH)
    return ahead, back
