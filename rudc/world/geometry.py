"""Oriented rectangles: their corners, the gap between two of them, and whether they overlap. Vectorised.

The plane is the complex numbers: a rectangle is a centre c, a direction e^(i psi) and half sizes (l, w). Seen
from rectangle A, rectangle B lies at z = (c_B - c_A) e^(-i psi_A), turned by r = e^(i (psi_B - psi_A)).

Overlap (separating axes): two rectangles are apart if and only if one of their four side directions separates
them. Along A's length that is |Re z| > l_A + l_B |Re r| + w_B |Im r|; the other three read alike.

Gap: the shortest way between two convex polygons that are apart ends at a corner of one of them, and a point
(x, y) seen from a rectangle is hypot(max(|x| - l, 0), max(|y| - w, 0)) away from it. So the gap is the least
of eight such distances: four corners of B from A, four of A from B. It is exact; 0 where they overlap.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

_ALONG = np.array([1.0, -1.0, -1.0, 1.0])
"""corners' places along the length in half lengths, counter-clockwise from the front left"""
_ACROSS = 1j * np.array([1.0, 1.0, -1.0, -1.0])
"""and across it, in half widths"""


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
    half = 0.5 * np.asarray(size)
    l_a, w_a = 0.5 * length, 0.5 * width
    r_back = r.conj()
    z_back = z * r_back
    apart = _separated(z, z_back, r, l_a, w_a, half[:, 0], half[:, 1])

    corners = np.empty((2, len(z), 4), dtype=np.complex128)
    corners[0] = z[:, None] + r[:, None] * _offsets(half)
    corners[1] = r_back[:, None] * (l_a * _ALONG + w_a * _ACROSS) - z_back[:, None]
    beyond = np.abs(corners.view(np.float64).reshape(2, len(z), 4, 2))
    beyond[0] -= (l_a, w_a)
    beyond[1] -= half[:, None, :]
    np.maximum(beyond, 0.0, out=beyond)
    squares = np.einsum("ijkl,ijkl->jik", beyond, beyond).reshape(len(z), 8)
    return np.sqrt(squares.min(axis=1, initial=np.inf)) * apart


def rectangles_overlap(
    x: float,
    y: float,
    psi: float,
    length: float,
    width: float,
    position: Array,
    heading: Array,
    size: Array,
) -> NDArray[np.bool_]:
    """Which (N,) of N rectangles overlap or touch the one given first; arguments as in `rectangle_gaps`."""
    z, r = _seen_from(x, y, psi, position, heading)
    half = 0.5 * np.asarray(size)
    return ~_separated(z, z * r.conj(), r, 0.5 * length, 0.5 * width, half[:, 0], half[:, 1])


def overlapping_pairs(position: Array, heading: Array, size: Array) -> NDArray[np.int64]:
    """Index pairs (K, 2), lower index first, of the rectangles among N that overlap or touch each other.

    Centres (N, 2) m, headings (N,) rad, sizes (N, 2) m. Only pairs whose circumscribed circles
    meet are looked at.
    """
    centre = position[:, 0] + 1j * position[:, 1]
    half = 0.5 * np.asarray(size)
    radius = np.hypot(half[:, 0], half[:, 1])
    near = np.abs(centre[:, None] - centre) <= radius[:, None] + radius
    first, second = np.nonzero(np.triu(near, 1))
    if not len(first):
        return np.empty((0, 2), dtype=np.int64)
    turn = np.exp(1j * heading)
    z = (centre[second] - centre[first]) * turn[first].conj()
    r = turn[second] * turn[first].conj()
    a, b = half[first], half[second]
    hit = ~_separated(z, z * r.conj(), r, a[:, 0], a[:, 1], b[:, 0], b[:, 1])
    return np.stack([first[hit], second[hit]], axis=1)


def _seen_from(x: float, y: float, psi: float, position: Array, heading: Array) -> tuple[Complex, Complex]:
    """Centres z (N,) m and directions r (N,) of rectangles seen from one at (x, y) m turned by psi rad."""
    turned = np.exp(-1j * psi)
    z = ((position[:, 0] - x) + 1j * (position[:, 1] - y)) * turned
    return z, np.exp(1j * heading) * turned


def _offsets(half: Array) -> Complex:
    """Corners (..., 4) m of rectangles of half sizes (..., 2) m about their centres, in their frames."""
    return half[..., :1] * _ALONG + half[..., 1:] * _ACROSS


def _separated(
    z: Complex,
    z_back: Complex,
    r: Complex,
    l_a: float | Array,
    w_a: float | Array,
    l_b: Array,
    w_b: Array,
) -> NDArray[np.bool_]:
    """Whether a side direction of A or of B separates them; z_back is z in B's frame, up to its sign."""
    cos, sin = np.abs(r.real), np.abs(r.imag)
    return (
        (np.abs(z.real) > l_a + l_b * cos + w_b * sin)
        | (np.abs(z.imag) > w_a + l_b * sin + w_b * cos)
        | (np.abs(z_back.real) > l_b + l_a * cos + w_a * sin)
        | (np.abs(z_back.imag) > w_b + l_a * sin + w_a * cos)
    )
