"""Kernels that predict where a vehicle will be that goes on along a line: the one prediction that the filter,
the last resort and the yielding of surrounding vehicles share.

Lines are poses (P * M, 3): x m, y m and heading rad at P * M stations, SPACING m apart, M for each line.
"""

from __future__ import annotations

import cmath
import math

import numpy as np

from rudc.kernels import NewPlaces, Table, Vector, kernel
from rudc.network.paths import SPACING


@kernel
def on_line(poses: Table, stations: int, row: int, s: float) -> tuple[complex, float]:
    """Place m and heading rad at s m on a line; straight on beyond its ends."""
    at = s * (1.0 / SPACING)
    i = int(min(max(at, 0.0), stations - 2.0))
    t, k = at - i, row * stations + i
    x = poses[k, 0] + t * (poses[k + 1, 0] - poses[k, 0])
    y = poses[k, 1] + t * (poses[k + 1, 1] - poses[k, 1])
    return complex(x, y), poses[k, 2] + min(max(t, 0.0), 1.0) * (poses[k + 1, 2] - poses[k, 2])


@kernel
def body_on_line(poses: Table, stations: int, row: int, s: float, length: float) -> tuple[complex, complex]:
    """Place m and direction of a body of that length (m) whose ends are on a line, its centre s m along it.

    SUMO moves its vehicles in this way: in a bend, a long one cuts across it.
    """
    front, _ = on_line(poses, stations, row, s + 0.5 * length)
    rear, heading = on_line(poses, stations, row, s - 0.5 * length)
    along = front - rear
    along = along / abs(along) if abs(along) > 0.0 else cmath.exp(1j * heading)
    return front - 0.5 * length * along, along


@kernel
def body_along_line(
    poses: Table, stations: int, row: int, s: float, length: float, beside: complex, turned: complex,
    way: Vector,
) -> tuple[NewPlaces, NewPlaces]:  # fmt: skip
    """(T,) m and (T,): place and direction, as complex numbers, of a body that has gone `way` (T,) m on from
    s m. It keeps an offset `beside` m from the place that `body_on_line` gives, and is `turned` from that
    direction; both are complex numbers in the frame of a driver on the line.
    """
    place, facing = np.empty(len(way), np.complex128), np.empty(len(way), np.complex128)
    for t in range(len(way)):
        here, along = body_on_line(poses, stations, row, s + way[t], length)
        place[t], facing[t] = here + beside * along, turned * along
    return place, facing


@kernel
def along_line(
    poses: Table, stations: int, row: int, s: float, beside: complex, turned: complex, way: Vector
) -> tuple[NewPlaces, NewPlaces]:
    """(T,) m and (T,): as `body_along_line`, of a point that keeps an offset `beside` m from the line and is
    `turned` from its direction.
    """
    place, facing = np.empty(len(way), np.complex128), np.empty(len(way), np.complex128)
    for t in range(len(way)):
        here, heading = on_line(poses, stations, row, s + way[t])
        along = cmath.exp(1j * heading)
        place[t], facing[t] = here + beside * along, turned * along
    return place, facing


@kernel
def between(values: Vector, s: float) -> float:
    """The value at s m of a line, interpolated between the `values` (M,) at its stations; beyond an end, the
    value there."""
    at = min(max(s / SPACING, 0.0), len(values) - 1.0)
    i = min(int(at), len(values) - 2)
    return values[i] + (at - i) * (values[i + 1] - values[i])


@kernel
def projected(poses: Table, x: float, y: float, i: int) -> tuple[float, float]:
    """Arc length m of the nearest place to (x, y) m on a line (M, 3), found downhill from station i, and the
    offset m to the line's left; see `ReferencePath.project`.
    """
    last = len(poses) - 2
    i, came_from = min(max(i, 0), last), -1
    while True:
        x0, y0 = poses[i, 0], poses[i, 1]
        dx, dy = poses[i + 1, 0] - x0, poses[i + 1, 1] - y0
        squared = dx * dx + dy * dy
        t = ((x - x0) * dx + (y - y0) * dy) / squared
        following = i + 1 if t > 1.0 and i < last else i - 1 if t < 0.0 and i > 0 else i
        if following in (i, came_from):
            break
        came_from, i = i, following
    offset = (dx * (y - y0) - dy * (x - x0)) / math.sqrt(squared)
    if following != i:  # outside of a bend, beyond this piece's end and before the next one's start
        t = min(max(t, 0.0), 1.0)
        gap = math.sqrt((x - x0 - t * dx) ** 2 + (y - y0 - t * dy) ** 2)
        offset = gap if offset > 0.0 else -gap
    return (i + t) * SPACING, offset
