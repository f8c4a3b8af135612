"""Kernels for planning courses: gaps to bodies, and the cheapest way through a lattice. The formulas stand at
the heads of the modules that call them."""

from __future__ import annotations

import math

import numpy as np

from rudc.kernels import Cube, NewRows, NewTable, Table, Vector, kernel, rectangle_gap


@kernel
def gaps_at(
    place: Table, heading: Vector, length: float, width: float,
    others: Table, their_heading: Vector, their_size: Table, near: float,
) -> NewTable:  # fmt: skip
    """(K, M) m, gaps of a rectangle at places (K, 2) m, (K,) rad to M others with centres (M, 2) m, headings
    (M,) rad and sizes (M, 2) m; inf where the circles round both are `near` m apart or farther.
    """
    half, its_half = (0.5 * length, 0.5 * width), 0.5 * their_size
    facing = np.empty(len(heading), np.complex128)
    for i in range(len(heading)):
        facing[i] = complex(math.cos(heading[i]), math.sin(heading[i]))
    found = np.full((len(heading), len(their_heading)), math.inf)
    for j in range(len(their_heading)):
        other = complex(math.cos(their_heading[j]), math.sin(their_heading[j]))
        reach = near + math.hypot(*half) + math.hypot(its_half[j, 0], its_half[j, 1])
        for i in range(len(heading)):
            r = complex(others[j, 0] - place[i, 0], others[j, 1] - place[i, 1])
            if r.real * r.real + r.imag * r.imag < reach * reach:
                found[i, j] = rectangle_gap(
                    r,
                    facing[i],
                    other,
                    0.5 * length,
                    0.5 * width,
                    0.5 * their_size[j, 0],
                    0.5 * their_size[j, 1],
                )
    return found


@kernel
def any_beside(line: Table, first: int, last: int, reach: float, position: Table, size: Table) -> bool:
    """Whether a circle round any of M rectangles with centres (M, 2) m and sizes (M, 2) m comes within
    `reach` m of one of the stations `first` to `last` of a line (K, 2) m."""
    for j in range(len(position)):
        near = reach + 0.5 * math.hypot(size[j, 0], size[j, 1])
        for i in range(max(first, 0), min(last + 1, len(line))):
            away_x, away_y = position[j, 0] - line[i, 0], position[j, 1] - line[i, 1]
            if away_x * away_x + away_y * away_y < near * near:
                return True
    return False


@kernel
def cheapest_way(
    price: Cube, resting: Table, bend: Vector, offset: Vector, start: int, turned: int, tightest: float,
    change_bend: Vector, change_price: Vector, straightest: float,
) -> NewRows:  # fmt: skip
    """(T,) rows of the offsets of the cheapest profile; empty if there is none.

    `price` (T, L, K): what a node costs by what is near it, inf where the car may not be; `resting` (L, K):
    what it costs by where it is. The profile begins at row `start`, column `turned`. `bend` (T,) 1/m: the
    path's curvature; `offset` (L,) m; `tightest` 1/m: largest curvature; `straightest`: least 1 - k l.
    Slopes change by -C // 2 to C // 2 columns, with second derivatives `change_bend` (C,) 1/m that cost
    `change_price` (C,).
    """
    stations, rows, slopes = price.shape
    none, half = len(change_bend) // 2, slopes // 2
    cost = np.full((rows, slopes), math.inf)
    cost[start, turned] = 0.0
    came = np.zeros((stations, rows, slopes), np.int64)
    for t in range(1, stations):
        following = np.full((rows, slopes), math.inf)
        reached = False
        for i in range(rows):
            stretch = max(1.0 - bend[t] * offset[i], straightest)
            for c in range(len(change_bend)):
                curvature = abs(bend[t] / stretch + change_bend[c] / (stretch * stretch))
                if curvature > max(tightest, abs(bend[t])):
                    continue
                for k in range(slopes):
                    old = k - (c - none)
                    row = i - (2 * (k - half) - (c - none))
                    if 0 <= old < slopes and 0 <= row < rows:
                        value = cost[row, old] + change_price[c]
                        if value < following[i, k]:
                            following[i, k], came[t, i, k] = value, c
            for k in range(slopes):
                following[i, k] = following[i, k] + resting[i, k] + price[t, i, k]
                reached = reached or following[i, k] < math.inf
        if not reached:
            return np.zeros(0, np.int64)
        cost = following
    best = int(np.argmin(cost))
    row, col = best // slopes, best % slopes
    found = np.zeros(stations, np.int64)
    for t in range(stations - 1, 0, -1):
        found[t] = row
        change = came[t, row, col] - none
        row, col = row - (2 * (col - half) - change), col - change
    found[0] = row
    return found
