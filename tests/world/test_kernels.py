"""The world's kernels agree with rudc/geometry.py and numpy."""

from __future__ import annotations

import numpy as np
import pytest

from rudc.geometry import rectangle_gaps
from rudc.world import kernels


def rectangles(rng, n, extent):
    """Centres (n, 2) m, headings (n,) rad, sizes (n, 2) m of n rectangles."""
    return rng.uniform(-extent, extent, (n, 2)), rng.uniform(-4, 4, n), rng.uniform(0.5, 9, (n, 2))


@pytest.mark.parametrize("n", [0, 1, 30])
def test_the_nearest_gap_is_the_least_of_all(n):
    rng = np.random.default_rng(n)
    for _ in range(20):
        others = rectangles(rng, n, 30)
        pose = float(rng.uniform(-30, 30)), float(rng.uniform(-30, 30)), 0.4, 5.0, 1.8
        gaps = rectangle_gaps(*pose, *others)
        gap, nearest, close = kernels.around(*pose, *others, 6.0)
        assert gap == pytest.approx(gaps.min(initial=np.inf), abs=1e-9)
        assert nearest == (-1 if n == 0 else gaps[: nearest + 1].argmin())
        assert (gaps[close:] > 6.0).all()


def test_pairs_that_overlap_are_those_without_a_gap():
    rng, met = np.random.default_rng(0), 0
    for n in (0, 1, 2, 12, 25):
        position, heading, size = bodies = rectangles(rng, n, 20)
        gaps = [rectangle_gaps(*position[i], heading[i], *size[i], *bodies) for i in range(n)]
        found = [[i, j] for i in range(n) for j in range(i + 1, n) if gaps[i][j] == 0]
        assert kernels.overlapping(*bodies).tolist() == found
        met += len(found)
    assert met > 10


def test_who_is_near_on_a_path_and_in_the_junction():
    rng = np.random.default_rng(1)
    position, size = rng.uniform(-25, 25, (60, 2)), rng.uniform(1, 9, (60, 2))
    path, path_s = rng.integers(-1, 3, 60), rng.uniform(0, 60, 60)
    stop, leave = np.array([20.0, 25.0, 30.0]), np.array([40.0, 42.0, 55.0])
    near = (np.hypot(*(position - [3.0, -2.0]).T) < 15.0) & (path >= 0)
    half = 0.5 * size[:, 0]
    inside = near & (path_s + half > stop[path]) & (path_s - half < leave[path])
    for only, wanted in ((False, near), (True, inside)):
        rows = kernels.near_on_paths(3.0, -2.0, 15.0, only, position, size, path, path_s, stop, leave)
        assert rows.tolist() == np.flatnonzero(wanted).tolist()
    assert 0 < inside.sum() < near.sum()


@pytest.mark.parametrize("n", [0, 1, 30])
def test_a_scene_has_the_nearest_first(n):
    rng = np.random.default_rng(n)
    position, course, size = rng.normal(size=(3, n, 2))
    heading, speed, acceleration, half, start, scale, lane_pos = rng.normal(size=(7, n))
    kind, path = rng.integers(0, 9, (2, n))
    order, *others = kernels.nearest_first(
        0.3,
        -0.2,
        position,
        heading,
        speed,
        course,
        acceleration,
        size,
        kind,
        path,
        half,
        start,
        scale,
        lane_pos,
    )
    position, path_s = position - half[:, None] * course, start + scale * lane_pos - half
    wanted = np.hypot(*(position - [0.3, -0.2]).T).argsort(kind="stable")
    assert order.tolist() == wanted.tolist()
    given = position, heading, speed[:, None] * course, acceleration, size, kind, path, path_s
    for got, of in zip(others, given, strict=True):
        assert got.tolist() == of[wanted].tolist()
    assert kernels.largest(position) == abs(position).max(initial=0.0)
