"""A lattice about a reference path, and the cheapest way for a car through it.

Stations every STEP m of arc length s, offsets l to the path's left, slopes dl/ds. From one station to the
next the slope changes by whole steps and the offset by the mean of the two slopes times STEP, so that every
profile l(s) is a chain of arcs. A car at a node stands at the path's pose there, moved by l and turned by
atan(slope), its body turned out of the path's own bend by its slip (`ReferencePath.body_pose`). Dynamic
programming finds the profile with the least

    sum over stations   OFFSET l^2 + SLOPE l'^2 + BEND l''^2 + CLOSE max(0, COMFORTABLE - gap)^2

among those that keep to nodes where the car may be, with curvature

    |k / (1 - k l) + l'' / (1 - k l)^2| <= tightest                      k the path's own

which is that of an offset line to first order in the slope.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rudc.arrays import Array, Flags, Index
from rudc.geometry import Rectangles, gaps_between
from rudc.network.depths import Depths
from rudc.network.route import ReferencePath
from rudc.vehicle import EgoVehicle

STEP = 2.0
"""m between stations"""
RASTER = 0.1
"""m between offsets"""
SLOPES: Array = np.arange(-7, 8, dtype=np.float64) * 0.1
"""(K,)"""
CHANGES = range(-4, 5)
"""steps by which the slope may change from one station to the next"""
MARGIN = 0.45
"""m, least gap to a body unless it is said otherwise"""
COMFORTABLE = 1.2
"""m, gap that costs nothing"""
OFFSET, SLOPE, BEND, CLOSE = 0.04, 1.0, 40.0, 6.0
"""weights of the cost at each station: 1/m2, 1, m2, 1/m2"""
STRAIGHTEST = 0.2
"""least 1 - k l: beyond it the offset line turns about a point"""
_OUTLINE = [(a, b) for a in (-0.5, 0.0, 0.5) for b in (-0.5, 0.5)]
"""points of the car's rectangle that must be on the road, in lengths and widths"""


class Lattice:
    """Of one path, for one car, on one carriageway."""

    def __init__(self, path: ReferencePath, depths: Depths, body: EgoVehicle, tightest: float) -> None:
        """`tightest`: 1/m, largest curvature that the car may drive."""
        self._body, self._tightest = body, tightest
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
        self._from = _sources(len(self._offsets))

    def search(
        self,
        first: int,
        last: int,
        start: tuple[float, float],
        bodies: Sequence[tuple[Rectangles, float]],
        road_margin: float,
        least_gap: float = MARGIN,
    ) -> Array | None:
        """(T,) m, offsets at stations first to last of the cheapest profile that starts at (offset m, slope).

        `bodies`: rectangles to keep off, and the arc length (m) from which on each lot counts.
        `road_margin`: m of carriageway to keep beside the car; `least_gap`: m to any body. None if there is
        no such profile.
        """
        offset, slope = start
        allowed, gap = self._nodes(first, last, bodies, road_margin)
        allowed &= gap >= least_gap
        cost = np.full((len(self._offsets), len(SLOPES)), np.inf)
        here = OFFSET * self._offsets[:, None] ** 2 + SLOPE * SLOPES[None] ** 2
        cost[_nearest(self._offsets, offset), _nearest(SLOPES, slope)] = 0.0
        bends = np.array([change * 0.1 / STEP for change in CHANGES])
        came: list[Index] = []
        for t in range(1, last - first + 1):
            own = self._bend[first + t]
            stretch = np.maximum(1.0 - own * self._offsets, STRAIGHTEST)
            curvature = np.abs(own / stretch + bends[:, None] / stretch**2)
            steep = curvature > max(self._tightest, abs(own))
            reached = np.append(cost, np.inf)[self._from] + (BEND * bends**2)[:, None, None]
            reached[steep] = np.inf
            best = reached.argmin(axis=0)
            came.append(best)
            least = np.take_along_axis(reached, best[None], axis=0)[0]
            cost = least + here + CLOSE * np.maximum(COMFORTABLE - gap[t], 0.0) ** 2
            cost[~allowed[t]] = np.inf
            if not np.isfinite(cost).any():
                return None
        return self._offsets[_traced(cost, came)]

    def _nodes(
        self, first: int, last: int, bodies: Sequence[tuple[Rectangles, float]], road_margin: float
    ) -> tuple[Flags, Array]:
        """(T, L, K) whether the road is wide enough at each node, and (T, L, K) m the car's gap to the
        nearest body there."""
        allowed = np.stack([self._depths_at(i) for i in range(first, last + 1)]) >= road_margin
        key = [(begins, *(array.tobytes() for array in rectangles)) for rectangles, begins in bodies]
        if key != self._measured[0]:
            self._measured = key, {}
        return allowed, np.stack([self._gaps_at(i, bodies) for i in range(first, last + 1)])

    def _gaps_at(self, i: int, bodies: Sequence[tuple[Rectangles, float]]) -> Array:
        """(L, K) m of the car's gap to the nearest body at station i; kept until there are others."""
        kept = self._measured[1]
        if i not in kept:
            kept[i] = np.full((len(self._offsets), len(SLOPES)), COMFORTABLE)
            for rectangles, begins in bodies:
                if rectangles.number and self.s[i] >= begins:
                    self._measure(kept[i], i, rectangles)
        return kept[i]

    def _measure(self, gap: Array, i: int, bodies: Rectangles) -> None:
        """Lower `gap` (L, K) m at station i where bodies are nearer."""
        size = np.array([self._body.length, self._body.width])
        turned = np.arctan(SLOPES) - self._slip[i]
        reach = 0.5 * np.hypot(*size) + COMFORTABLE + 0.5 * np.hypot(*bodies.size.T)
        place = self._xy[i] + self._offsets[:, None] * self._normal[i]
        away = place[:, None] - bodies.position
        which, near = np.nonzero((np.hypot(away[..., 0], away[..., 1]) < reach).T)
        if not len(which):
            return
        rows, who = np.repeat(near, len(SLOPES)), np.repeat(which, len(SLOPES))
        cols = np.tile(np.arange(len(SLOPES)), len(near))
        found = gaps_between(
            place[rows], self._psi[i] + turned[cols], size,
            bodies.position[who], bodies.heading[who], bodies.size[who],
        )  # fmt: skip
        np.minimum.at(gap, (rows, cols), found)

    def _depths_at(self, i: int) -> Array:
        """(L, K) m of carriageway beside the car at station i, at least; kept."""
        if i not in self._depth:
            turned, own = np.arctan(SLOPES) - self._slip[i], self._bend[i]
            stretch = np.maximum(1.0 - own * self._offsets[:, None], STRAIGHTEST)
            least = np.full((len(self._offsets), len(SLOPES)), np.inf)
            for a, b in _OUTLINE:
                along, across = a * self._body.length, b * self._body.width
                ahead = along * np.cos(turned) - across * np.sin(turned)
                beside = along * np.sin(turned) + across * np.cos(turned) - 0.5 * own * ahead**2
                depth = self._depths.at(self.s[i] + ahead / stretch, self._offsets[:, None] + beside)
                least = np.minimum(least, depth)
            self._depth[i] = least
        return self._depth[i]


def _nearest(values: Array, value: float) -> int:
    return int(np.abs(values - value).argmin())


def _sources(count: int) -> Index:
    """(C, L, K) flat index of the node from which each is reached with each change, L = `count` offsets; the
    last index for none.
    """
    none = count * len(SLOPES)
    row, col = np.meshgrid(np.arange(count), np.arange(len(SLOPES)), indexing="ij")
    tables = []
    for change in CHANGES:
        from_row, from_col = row - _shift(col, change), col - change
        inside = (
            (from_row >= 0) & (from_row < count) & (from_col >= 0) & (from_col < len(SLOPES))
        )  # fmt: skip
        tables.append(np.where(inside, from_row * len(SLOPES) + from_col, none))
    return np.stack(tables)


def _shift(col: Index, change: int) -> Index:
    """Rows by which the offset grows on the way to a slope (column) after a change: (2 k - change) / 2 *
    0.1 * STEP."""
    return 2 * (col - len(SLOPES) // 2) - change


def _traced(cost: Array, came: Sequence[Index]) -> Index:
    """(T,) rows of the offsets that lead to the cheapest node."""
    row, col = (int(v) for v in np.unravel_index(int(cost.argmin()), cost.shape))
    rows = [row]
    for best in reversed(came):
        change = CHANGES[int(best[row, col])]
        row, col = row - int(_shift(np.array(col), change)), col - change
        rows.append(row)
    return np.array(rows[::-1])
