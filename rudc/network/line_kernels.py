"""Where somebody will be that goes on along a line, as kernels: the one prediction that filter, last resort
and the surrounding vehicles' yielding share.

Lines are poses (P * M, 3): x m, y m and heading rad at P * M stations, SPACING m apart, M for each line.
"""

from __future__ import annotations

import cmath

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

    So SUMO moves its vehicles: where the line bends a long one lies across the bend.
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
    """(T,) m and (T,): place and direction after `way` (T,) m from s m on, of a body that keeps an offset
    `beside` m from where `body_on_line` says and is `turned` from there, both as seen by who drives there.
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
    """(T,) m and (T,): place and direction after `way` (T,) m from s m on, of who keeps an offset `beside` m
    from the line and is `turned` from it, both as seen by who drives on the line.
    """
    place, facing = np.empty(len(way), np.complex128), np.empty(len(way), np.complex128)
    for t in range(len(way)):
        here, heading = on_line(poses, stations, row, s + way[t])
        along = cmath.exp(1j * heading)
        place[t], facing[t] = here + beside * along, turned * along
    return place, facing
