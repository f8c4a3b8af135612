"""Oriented rectangles: their corners, the gap between two of them, and whether they overlap. Vectorised.

Points of the plane are complex numbers: a rectangle is a centre c, a direction e^(i psi) and half sizes
(l, w). Seen from rectangle A, rectangle B lies at z = (c_B - c_A) e^(-i psi_A), turned by
r = e^(i (psi_B - psi_A)).

Overlap (separating axes): two rectangles are apart if and only if one of their four side directions separates
them. Along A's length that is |Re z| > l_A + l_B |Re r| + w_B |Im r|; the other three inequalities have the
same form. The separation is the largest difference, over the four, of left side and right side. It is at most
the gap; where the rectangles overlap it is negative, by the depth of the overlap.

Gap: the shortest line between two convex polygons that are apart ends at a corner of one of them, and the
distance of a point (x, y) from a rectangle that is seen from its own frame is
hypot(max(|x| - l, 0), max(|y| - w, 0)). So the gap is the least of eight such distances: of the four corners
of B from A, and of the four of A from B. It is exact, and 0 where they overlap.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rudc.arrays import Array, Complex


class Rectangles(NamedTuple):
    """N rectangles, such as the outlines of standing vehicles."""

    position: Array
    """(N, 2) m, centres"""
    heading: Array
    """(N,) rad"""
    size: Array
    """(N, 2) m, lengths and widths"""

    @property
    def number(self) -> int:
        """The number N of rectangles."""
        return len(self.heading)


NO_RECTANGLES = Rectangles(np.zeros((0, 2)), np.zeros(0), np.zeros((0, 2)))


_ALONG = np.array([1.0, -1.0, -1.0, 1.0])
"""positions of the corners along the length, in half lengths, counter-clockwise from the front left"""
_ACROSS = 1j * np.array([1.0, 1.0, -1.0, -1.0])
"""positions of the corners across it, in half widths, in the same order"""


def rectangle_corners(position: Array, heading: Array, size: Array) -> Array:
    """Corners (..., 4, 2) m of rectangles with centres (..., 2) m, headings (...) rad and sizes (..., 2) m.

    Counter-clockwise from the front left. Sizes are lengths and widths.
    """
    position, heading, size = np.asarray(position), np.asarray(heading), np.asarray(size)
    centre = position[..., 0] + 1j * position[..., 1]
    offsets = _offsets(size / 2)
    corners = centre[..., None] + np.exp(1j * heading)[..., None] * offsets
    return np.stack([corners.real, corners.imag], axis=-1)


def rectangle_gaps(
    x: float,
    y: float,
    psi: float,
    length: float,
    width: float,
    position: Array,
    heading: Array,
    size: Array,
) -> Array:
    """Gaps (N,) m between one rectangle (m, m, rad, m, m) and N others, 0 where they overlap or touch.

    The others have centres `position` (N, 2) m, headings (N,) rad and `size` (N, 2) m, length and width.
    """
    z, r = _seen_from(x, y, psi, position, heading)
    return _gaps(z, r, np.array([0.5 * length, 0.5 * width]), 0.5 * np.asarray(size))


def gaps_between(
    position_a: Array, heading_a: Array, size_a: Array, position_b: Array, heading_b: Array, size_b: Array
) -> Array:
    """Gaps (N,) m of N pairs of rectangles: centres (N, 2) m, headings (N,) rad, sizes (N, 2) or (2,) m."""
    turned = np.exp(-1j * heading_a)
    away = position_b - position_a
    z = (away[:, 0] + 1j * away[:, 1]) * turned
    half_b = np.broadcast_to(0.5 * np.asarray(size_b), (len(z), 2))
    return _gaps(z, np.exp(1j * heading_b) * turned, 0.5 * np.asarray(size_a), half_b)


def separation(r: Complex, facing: Complex, other: Complex, half: Array, half_other: Array) -> Array:
    """(...) m, largest separation of pairs of rectangles along their side directions; negative where they
    overlap.

    `r`: (...) m, from the first one's centre to the second one's; `facing`, `other`: (...), direction of the
    first and of the second; `half`, `half_other`: (..., 2) m, their half sizes. Everything is broadcast.
    """
    back = facing.conj()
    return _separation(r * back, r * other.conj(), other * back, half, half_other)


def _seen_from(x: float, y: float, psi: float, position: Array, heading: Array) -> tuple[Complex, Complex]:
    """Centres z (N,) m and directions r (N,) of rectangles seen from one at (x, y) m turned by psi rad."""
    turned = np.exp(-1j * psi)
    z = ((position[:, 0] - x) + 1j * (position[:, 1] - y)) * turned
    return z, np.exp(1j * heading) * turned


def _gaps(z: Complex, r: Complex, half_a: Array, half_b: Array) -> Array:
    """Gaps (N,) m: z, r (N,) are B seen from A, half sizes (N, 2) or (2,) m of A and (N, 2) m of B."""
    n, r_back = len(z), r.conj()
    z_back = z * r_back
    corners = np.empty((2, n, 4), dtype=np.complex128)
    corners[0] = z[:, None] + r[:, None] * _offsets(half_b)
    corners[1] = r_back[:, None] * _offsets(half_a) - z_back[:, None]
    beyond = np.abs(corners.view(np.float64).reshape(2, n, 4, 2))
    beyond[0] -= half_a[..., None, :]
    beyond[1] -= half_b[:, None, :]
    np.maximum(beyond, 0.0, out=beyond)
    beyond *= beyond
    squares = beyond[..., 0] + beyond[..., 1]
    apart = _separation(z, z_back, r, half_a, half_b) > 0.0
    return np.sqrt(np.minimum(squares[0], squares[1]).min(axis=1)) * apart


def _offsets(half: Array) -> Complex:
    """Corners (..., 4) m of rectangles of half sizes (..., 2) m about their centres, in their frames."""
    return half[..., :1] * _ALONG + half[..., 1:] * _ACROSS


def _separation(z: Complex, z_back: Complex, r: Complex, half_a: Array, half_b: Array) -> Array:
    """(...) m, as `separation`: z is B's centre and r B's direction seen from A, z_back is z in B's frame, up
    to its sign.
    """
    cos, sin = np.abs(r.real), np.abs(r.imag)
    length_a, width_a, length_b, width_b = half_a[..., 0], half_a[..., 1], half_b[..., 0], half_b[..., 1]
    ahead = np.abs(z.real) - (length_a + length_b * cos + width_b * sin)
    beside = np.abs(z.imag) - (width_a + length_b * sin + width_b * cos)
    ahead_back = np.abs(z_back.real) - (length_b + length_a * cos + width_a * sin)
    beside_back = np.abs(z_back.imag) - (width_b + length_a * sin + width_a * cos)
    return np.maximum(np.maximum(ahead, beside), np.maximum(ahead_back, beside_back))
