"""A lattice about a reference path, and the cheapest way for a car through it.

Stations every STEP m of arc length s, offsets l to the path's left, slopes dl/ds. From one station to the
next the slope changes by whole steps and the offset by the mean of the two slopes times STEP, so that every
profile l(s) is a chain of arcs. A car at a node stands at the path's pose there, moved by l and turned by
atan(slope), its body turned out of the path's own bend by its slip (`ReferencePath.body_pose`). Dynamic
programming finds the profile with the least

    sum over stations   OFFSET l^2 + SLOPE l'^2 + BEND l''^2 + CLOSE max(0, COMFORTABLE - gap)^2
    and at the last     END l^2, as if that offset were kept for a while: a profile that ends soon after a
                        body is back on the path if it can be

among those that keep to nodes where the car may be, with curvature

    |k / (1 - k l) + l'' / (1 - k l)^2| <= tightest          k: the path's own; tightest: the car's

which is that of an offset line to first order in the slope.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rudc.arrays import Array
from rudc.geometry import Rectangles
from rudc.network.depths import Depths
from rudc.network.kernels import cheapest_way, gaps_at
from rudc.network.route import ReferencePath
from rudc.vehicle import EgoVehicle

Stretch = tuple[Rectangles, float, float]
"""bodies, and the arc lengths (m) between which they count"""
STEP = 2.0
"""m between stations"""
RASTER = 0.1
"""m between offsets"""
SLOPES: Array = np.arange(-7, 8, dtype=np.float64) * 0.1
"""(K,) slopes dl/ds of the nodes"""
CHANGES: Array = np.arange(-4.0, 5.0)
"""(C,) steps by which the slope may change from one station to the next"""
MARGIN = 0.45
"""m, least gap to a body, unless the caller gives another"""
COMFORTABLE = 1.2
"""m, gap that costs nothing"""
OFFSET, SLOPE, BEND, CLOSE = 0.04, 1.0, 40.0, 6.0
"""weights of the cost at each station: 1/m2, 1, m2, 1/m2"""
END = 2.0 * OFFSET
"""1/m2"""
STRAIGHTEST = 0.2
"""least 1 - k l: near 0 the offset line would turn about a point"""
_OUTLINE = [(a, b) for a in (-0.5, 0.0, 0.5) for b in (-0.5, 0.5)]
"""points of the car's rectangle that must be on the road, in lengths and widths"""


class Lattice:
    """The lattice of one path, for one car, on one carriageway."""

    def __init__(self, path: ReferencePath, depths: Depths, body: EgoVehicle) -> None:
        self._body = body
        self.s: Array = np.arange(0.0, path.length, STEP)
        """(S,) m"""
        x, y, self._psi = path.pose(self.s)
        self._xy = np.column_stack([x, y])
        self._normal = np.column_stack([-np.sin(self._psi), np.cos(self._psi)])
        self._bend: Array = np.interp(self.s, path.s, path.curvature)
        right, left = depths.reach()
        rows = np.arange(round(right / RASTER), round(left / RASTER) + 1, dtype=np.float64)
        self._offsets: Array = RASTER * rows
        """(L,) m, as far as there is road"""
        self._slip: Array = np.arcsin(np.clip(body.cg_to_rear * self._bend, -0.9, 0.9))
        self._depths = depths
        self._depth: dict[int, Array] = {}
        self._measured: tuple[list[tuple[float | bytes, ...]], dict[int, Array]] = [], {}

    def search(
        self,
        first: int,
        last: int,
        start: tuple[float, float],
        bodies: Sequence[Stretch],
        road_margin: float,
        least_gap: float = MARGIN,
    ) -> Array | None:
        """(T,) m, offsets at stations first to last of the cheapest profile that starts at (offset m, slope).

        `bodies`: rectangles to keep clear of, and between which arc lengths (m) each group counts.
        `road_margin`: m of carriageway to keep beside the car; `least_gap`: m to any body. None if there is
        no such profile.
        """
        (offset, slope), bends = start, CHANGES * 0.1 / STEP
        gap = self._nodes(first, last, bodies, road_margin)
        price = CLOSE * np.maximum(COMFORTABLE - gap, 0.0) ** 2
        price[gap < least_gap] = np.inf
        price[-1] += END * self._offsets[:, None] ** 2
        rows = cheapest_way(
            price, OFFSET * self._offsets[:, None] ** 2 + SLOPE * SLOPES[None] ** 2,
            self._bend[first : last + 1], self._offsets,
            _nearest(self._offsets, offset), _nearest(SLOPES, slope),
            self._body.tightest, bends, BEND * bends**2, STRAIGHTEST,
        )  # fmt: skip
        return self._offsets[rows] if len(rows) else None

    def _nodes(self, first: int, last: int, bodies: Sequence[Stretch], road_margin: float) -> Array:
        """(T, L, K) m, the car's gap to the nearest body at each node, -inf where the road is too narrow."""
        key = [(*ends, *(array.tobytes() for array in rectangles)) for rectangles, *ends in bodies]
        if key != self._measured[0]:
            self._measured = key, {}
        gap = np.stack([self._gaps_at(i, bodies) for i in range(first, last + 1)])
        depth = np.stack([self._depths_at(i) for i in range(first, last + 1)])
        gap[depth < road_margin] = -np.inf
        return gap

    def _gaps_at(self, i: int, bodies: Sequence[Stretch]) -> Array:
        """(L, K) m of the car's gap to the nearest body at station i; kept until there are others."""
        kept = self._measured[1]
        if i not in kept:
            shape = len(self._offsets), len(SLOPES)
            kept[i] = np.full(shape, COMFORTABLE)
            place = np.repeat(self._xy[i] + self._offsets[:, None] * self._normal[i], len(SLOPES), axis=0)
            heading = np.tile(self._psi[i] + (np.arctan(SLOPES) - self._slip[i]), len(self._offsets))
            body = self._body
            for rectangles, begins, ends in bodies:
                if rectangles.number and begins <= self.s[i] < ends:
                    found = gaps_at(place, heading, body.length, body.width, *rectangles, COMFORTABLE)
                    np.minimum(kept[i], found.min(axis=1).reshape(shape), out=kept[i])
        return kept[i]

    def _depths_at(self, i: int) -> Array:
        """(L, K) m of carriageway beside the car at station i, at least; kept."""
        if i not in self._depth:
            turned, own = np.arctan(SLOPES) - self._slip[i], self._bend[i]
            along, across = (np.array(_OUTLINE) * [self._body.length, self._body.width]).T[..., None, None]
            ahead = along * np.cos(turned) - across * np.sin(turned)
            beside = along * np.sin(turned) + across * np.cos(turned) - 0.5 * own * ahead**2
            stretch = np.maximum(1.0 - own * self._offsets[:, None], STRAIGHTEST)
            depth = self._depths.at(self.s[i] + ahead / stretch, self._offsets[:, None] + beside)
            self._depth[i] = depth.min(axis=0)
        return self._depth[i]


def _nearest(values: Array, value: float) -> int:
    return int(np.abs(values - value).argmin())
