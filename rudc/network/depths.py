"""How deep inside a carriageway a point is, for points beside a path."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial import KDTree

from rudc.arrays import Array
from rudc.network.polyline import in_any
from rudc.network.route import ReferencePath

FARTHEST = 4.0
"""m, larger depths count as this"""
REACH = 12.0
"""m to each side of the path"""
ALONG, ACROSS = 1.0, 0.25
"""m between the places whose depths are stored"""


class Depths:
    """Depths (m) at arc length s and offset l from a path: negative outside, bilinear between the stored
    places."""

    def __init__(self, path: ReferencePath, carriageway: Sequence[Array], boundary: Array) -> None:
        """`carriageway`: polygons (K, 2) m; `boundary` (B, 2, 2) m: of their union."""
        x, y, psi = path.pose(np.arange(0.0, path.length, ALONG))
        offsets = np.arange(-REACH, REACH + ACROSS / 2, ACROSS)
        points = np.stack(
            [x[:, None] - offsets * np.sin(psi)[:, None], y[:, None] + offsets * np.cos(psi)[:, None]],
            axis=-1,
        )
        flat = points.reshape(-1, 2)
        depth, _ = KDTree(boundary.mean(axis=1)).query(flat, distance_upper_bound=FARTHEST)
        depth = np.minimum(depth, FARTHEST)
        self._depth: Array = np.where(in_any(carriageway, flat), depth, -depth).reshape(points.shape[:2])

    def reach(self) -> tuple[float, float]:
        """m, the least and the greatest offset from the path with road anywhere."""
        there = np.flatnonzero((self._depth > 0.0).any(axis=0))
        return ACROSS * float(there[0]) - REACH, ACROSS * float(there[-1]) - REACH

    def at(self, s: Array, offset: Array) -> Array:
        """(...) m at s (...) m and offset (...) m; beyond both ends and REACH, the depth of the nearest
        place."""
        rows, cols = self._depth.shape
        i = np.clip(s / ALONG, 0.0, rows - 1.001)
        j = np.clip((offset + REACH) / ACROSS, 0.0, cols - 1.001)
        i, j = np.broadcast_arrays(i, j)
        low, left = i.astype(np.int64), j.astype(np.int64)
        u, v = i - low, j - left
        flat, at = self._depth.ravel(), low * cols + left
        near = flat[at] + v * (flat[at + 1] - flat[at])
        far = flat[at + cols] + v * (flat[at + cols + 1] - flat[at + cols])
        return near + u * (far - near)
