"""Plane geometry of polylines and polygons, on numpy arrays: lengths in m, angles in rad."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rudc.arrays import Array, Flags

GAP = 0.04
"""m, polygons closer than this touch"""
REPEAT = 1e-3
"""m, a point closer than this to the one before repeats it"""
PIECE = 0.25
"""m, longest piece of a boundary"""


def wrap(angle: Array | float) -> Array:
    """Angle(s) in rad brought to [-pi, pi)."""
    return (np.asarray(angle) + np.pi) % (2 * np.pi) - np.pi


def arc_length(xy: Array) -> Array:
    """(K,) m, distance along the polyline xy (K, 2) to each of its points."""
    return np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(xy, axis=0).T))])


def without_repeats(xy: Array) -> Array:
    """The polyline xy (K, 2) without points that lie within REPEAT m of the one before."""
    keep = np.concatenate([[True], np.hypot(*np.diff(xy, axis=0).T) > REPEAT])
    return xy[keep]


def resample(xy: Array, s: Array) -> Array:
    """(M, 2) m, points of the polyline xy (K, 2) at arc lengths s (M,), straight on beyond both ends."""
    at = arc_length(xy)
    i = np.clip(np.searchsorted(at, s, side="right") - 1, 0, len(xy) - 2)
    t = (s - at[i]) / (at[i + 1] - at[i])
    return xy[i] + t[:, None] * (xy[i + 1] - xy[i])


def beside(xy: Array, points: Array) -> tuple[Array, Array]:
    """(M,) m along the polyline xy (K, 2), and (M,) m to its left, of points (M, 2) m, each seen from the leg
    that is nearest; beyond both ends the polyline goes straight on.
    """
    leg = np.diff(xy, axis=0)
    length = np.hypot(*leg.T)
    along = leg / length[:, None]
    away = points[:, None] - xy[:-1]
    first, last = np.zeros(len(leg)), length.copy()
    first[0], last[-1] = -np.inf, np.inf
    s = np.clip((away * along).sum(axis=-1), first, last)
    gap = np.hypot(*np.moveaxis(away - s[..., None] * along, -1, 0))
    left = along[:, 0] * away[..., 1] - along[:, 1] * away[..., 0]
    each, i = np.arange(len(points)), gap.argmin(axis=1)
    return arc_length(xy)[i] + s[each, i], np.copysign(gap[each, i], left[each, i])


def crossing_cosines(xy: Array, other: Array) -> Array:
    """(K,) cosine of the angle between two polylines (n, 2) and (m, 2) m at each place where they cross."""
    (start, along), (its_start, its) = ((line[:-1], np.diff(line, axis=0)) for line in (xy, other))
    away = its_start[None] - start[:, None]
    turn = np.multiply.outer(along[:, 0], its[:, 1]) - np.multiply.outer(along[:, 1], its[:, 0])
    with np.errstate(divide="ignore", invalid="ignore"):  # parallel pieces do not cross
        on_one = (away[..., 0] * its[:, 1] - away[..., 1] * its[:, 0]) / turn
        on_other = (away[..., 0] * along[:, None, 1] - away[..., 1] * along[:, None, 0]) / turn
    i, j = np.nonzero((on_one >= 0.0) & (on_one <= 1.0) & (on_other >= 0.0) & (on_other <= 1.0))
    return (along[i] * its[j]).sum(axis=-1) / (np.hypot(*along[i].T) * np.hypot(*its[j].T))


def headings(xy: Array) -> Array:
    """(K,) rad, unwrapped, direction of the polyline xy (K, 2) at its points, by central differences."""
    d = np.gradient(xy, axis=0)
    return np.unwrap(np.arctan2(d[:, 1], d[:, 0]))


def smooth(xy: Array, step: float, window: float) -> Array:
    """Moving average over `window` m of xy (K, 2), sampled every `step` m.

    An arc of curvature k moves inwards by k window^2 / 24; jumps of curvature become ramps `window` m long.
    Ends stay where they are if they are straight for half a window.
    """
    n = max(1, round(window / step / 2))
    steps = np.arange(n, 0, -1)[:, None]
    before = xy[0] - steps * (xy[1] - xy[0])
    after = xy[-1] + steps[::-1] * (xy[-1] - xy[-2])
    padded = np.vstack([before, xy, after])
    total = np.cumsum(np.vstack([np.zeros((1, 2)), padded]), axis=0)
    return (total[2 * n + 1 :] - total[: -2 * n - 1]) / (2 * n + 1)


def offset_polyline(xy: Array, distance: float) -> Array:
    """(K, 2) m, the polyline xy (K, 2) moved `distance` m to its left, corners mitred (at most threefold)."""
    d = np.diff(xy, axis=0)
    d /= np.hypot(*d.T)[:, None]
    normal = np.column_stack([-d[:, 1], d[:, 0]])
    first, last = np.vstack([normal[:1], normal]), np.vstack([normal, normal[-1:]])
    bisector = first + last
    scale = np.maximum(np.sum(bisector * first, axis=1), 1.0 / 3.0)
    return xy + distance * bisector / scale[:, None]


def strip(xy: Array, width: float) -> Array:
    """(2K, 2) m, the polygon (counter-clockwise) that a band of `width` m along xy (K, 2) covers."""
    return np.vstack([offset_polyline(xy, -width / 2), offset_polyline(xy, width / 2)[::-1]])


def inside(polygon: Array, xy: Array) -> Flags:
    """(N,) whether points xy (N, 2) lie in the polygon (K, 2), by the even-odd rule."""
    result = np.zeros(len(xy), dtype=bool)
    (left, low), (right, high) = polygon.min(axis=0), polygon.max(axis=0)
    x, y = xy[:, 0], xy[:, 1]
    near = np.flatnonzero((x >= left) & (x <= right) & (y >= low) & (y <= high))
    if not len(near):
        return result
    near = near[y[near].argsort()]  # so that those beside an edge are neighbours
    x, y = x[near], y[near]
    ends = np.roll(polygon, -1, axis=0)
    first = y.searchsorted(np.minimum(polygon[:, 1], ends[:, 1])).tolist()
    last = y.searchsorted(np.maximum(polygon[:, 1], ends[:, 1])).tolist()
    odd = np.zeros(len(near), dtype=bool)
    for (x0, y0), (x1, y1), i, j in zip(polygon.tolist(), ends.tolist(), first, last, strict=True):
        if i < j:
            odd[i:j] ^= x[i:j] < x0 + (y[i:j] - y0) * (x1 - x0) / (y1 - y0)
    result[near] = odd
    return result


def in_any(polygons: Sequence[Array], xy: Array) -> Flags:
    """(N,) whether points xy (N, 2) lie in at least one of the polygons."""
    result = np.zeros(len(xy), dtype=bool)
    for polygon in polygons:
        result |= inside(polygon, xy)
    return result


def signed_area(polygon: Array) -> float:
    """m2, positive when the polygon (K, 2) runs counter-clockwise."""
    x, y = polygon.T
    return 0.5 * float(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))


def union_boundary(polygons: Sequence[Array]) -> Array:
    """(B, 2, 2) m, boundary of the polygons' union in straight pieces of at most PIECE m.

    A piece of some polygon's edge is on the boundary when a point GAP outside of its middle is in no
    polygon: lanes that share an edge (to the centimetre that SUMO writes) so count as one surface.
    """
    pieces = []
    for polygon in polygons:
        ring = polygon if signed_area(polygon) > 0 else polygon[::-1]
        start, end = ring, np.roll(ring, -1, axis=0)
        count = np.maximum(np.ceil(np.hypot(*(end - start).T) / PIECE).astype(int), 1)
        edge = np.repeat(np.arange(len(ring)), count)
        part = np.arange(len(edge)) - np.repeat(np.cumsum(count) - count, count)
        step = ((end - start) / count[:, None])[edge]
        a = start[edge] + part[:, None] * step
        pieces.append(np.stack([a, a + step], axis=1))
    segments = np.concatenate(pieces)
    d = segments[:, 1] - segments[:, 0]
    length = np.hypot(*d.T)
    segments, d, length = segments[length > 1e-6], d[length > 1e-6], length[length > 1e-6]
    outwards = np.column_stack([d[:, 1], -d[:, 0]]) / length[:, None]
    return segments[~in_any(polygons, segments.mean(axis=1) + GAP * outwards)]


def straightened(pieces: Array) -> Array:
    """(E, 2, 2) m, the same lines as pieces (B, 2, 2); a piece that goes straight on from the one before is
    joined to it."""
    step = pieces[:, 1] - pieces[:, 0]
    ahead = step / np.hypot(*step.T)[:, None]
    meets = np.abs(pieces[1:, 0] - pieces[:-1, 1]).max(axis=1) < 1e-9
    goes_on = meets & (np.abs(ahead[1:] - ahead[:-1]).max(axis=1) < 1e-9)
    first = np.flatnonzero(np.concatenate([[True], ~goes_on]))
    last = np.append(first[1:], len(pieces)) - 1
    return np.stack([pieces[first, 0], pieces[last, 1]], axis=1)
