"""Rectangle gaps against independent methods: a quadratic programme, a sampled boundary, rigid motions."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import lsq_linear

from rudc.geometry import (
    gaps_between,
    rectangle_corners,
    rectangle_gaps,
    separation,
)

coordinate = st.floats(-12, 12)
angle = st.floats(-7, 7)
length = st.floats(0.3, 12)
rectangle = st.tuples(coordinate, coordinate, angle, length, length)


def gap(a, b):
    """Gap between two rectangles (x, y, psi, length, width)."""
    other = {"position": np.array([b[:2]]), "heading": np.array([b[2]]), "size": np.array([b[3:]])}
    return float(rectangle_gaps(*a, **other)[0])


def gap_by_programme(a, b):
    """min |p - q| over p in A, q in B, as bounded least squares in both rectangles' own coordinates."""
    frames = [np.array([[np.cos(r[2]), -np.sin(r[2])], [np.sin(r[2]), np.cos(r[2])]]) for r in (a, b)]
    matrix = np.hstack([frames[0], -frames[1]])
    bounds = np.array([a[3] / 2, a[4] / 2, b[3] / 2, b[4] / 2])
    found = lsq_linear(
        matrix, np.array(b[:2]) - np.array(a[:2]), bounds=(-bounds, bounds), tol=1e-14, method="bvls"
    )
    return float(np.sqrt(2 * max(found.cost, 0.0)))


@settings(max_examples=300)
@given(rectangle, rectangle)
def test_gap_equals_quadratic_programme(a, b):
    assert gap(a, b) == pytest.approx(gap_by_programme(a, b), abs=1e-6)


@settings(max_examples=200)
@given(rectangle, rectangle)
def test_separation_is_positive_where_the_gap_is_and_within_a_corner_of_it(a, b):
    away = np.array([[complex(b[0] - a[0], b[1] - a[1])]])
    half, half_other = 0.5 * np.array(a[3:]), 0.5 * np.array([b[3:]])
    found = separation(away, np.exp([1j * a[2]]), np.exp([[1j * b[2]]]), half, half_other).item()
    assert (found > 0) == (gap(a, b) > 0) or abs(found) < 1e-6
    assert gap(a, b) / np.sqrt(2) - 1e-6 <= max(found, 0.0) <= gap(a, b) + 1e-6


def test_separation_by_hand_broadcast():
    away = np.array([4.9, 5.1, 3.0j, 3.5j])
    other = np.array([1.0, 1.0, 1.0j, 1.0j])
    half = np.array([2.5, 0.9])
    expected = [-0.1, 0.1, -0.4, 0.1]
    np.testing.assert_allclose(separation(away, np.ones(1, complex), other, half, half), expected, atol=1e-12)
    many = separation(
        away[:, None, None], np.ones((2, 3), complex), other[:, None, None], half, np.tile(half, (4, 1, 1, 1))
    )
    assert many.shape == (4, 2, 3)
    np.testing.assert_allclose(many[:, 1, 2], expected, atol=1e-12)


@settings(max_examples=200)
@given(rectangle, rectangle, coordinate, coordinate, angle)
def test_gap_is_symmetric_and_survives_rigid_motion(a, b, dx, dy, turn):
    def moved(r):
        c, s = np.cos(turn), np.sin(turn)
        return (c * r[0] - s * r[1] + dx, s * r[0] + c * r[1] + dy, r[2] + turn, r[3], r[4])

    assert gap(b, a) == pytest.approx(gap(a, b), abs=1e-9)
    assert gap(moved(a), moved(b)) == pytest.approx(gap(a, b), abs=1e-9)


@pytest.mark.parametrize("seed", range(20))
def test_gap_equals_brute_force_over_boundaries(seed):
    rng = np.random.default_rng(seed)
    a, b = (
        np.concatenate([rng.uniform(-8, 8, 2), rng.uniform(-4, 4, 1), rng.uniform(0.5, 8, 2)])
        for _ in range(2)
    )

    def boundary(r):
        corners = rectangle_corners(r[:2], r[2], r[3:])
        t = np.linspace(0, 1, 400)[:, None]
        return np.concatenate(
            [c + t * (d - c) for c, d in zip(corners, np.roll(corners, -1, axis=0), strict=True)]
        )

    sampled = np.linalg.norm(boundary(a)[:, None] - boundary(b), axis=-1).min()
    measured = gap(a, b)
    if measured > 0:
        assert measured <= sampled + 1e-12
        assert sampled - measured < 0.05
    else:
        inside = rectangle_corners(a[:2], a[2], a[3:]).mean(axis=0)
        assert sampled < 0.05 or gap_by_programme(a, b) < 1e-6, inside


def test_known_cases():
    a = (0.0, 0.0, 0.0, 4.0, 2.0)
    assert gap(a, (5.0, 0.0, 0.0, 4.0, 2.0)) == pytest.approx(1.0)
    assert gap(a, (7.0, 6.0, 0.0, 4.0, 2.0)) == pytest.approx(5.0)  # corner to corner, 3-4-5
    assert gap(a, (0.0, 0.0, np.pi / 2, 9.0, 0.5)) == 0.0  # a cross: no corner inside the other
    assert gap(a, (0.0, 1.0 + np.sqrt(2), np.pi / 4, 2.0, 2.0)) == pytest.approx(
        0.0, abs=1e-12
    )  # corner on edge
    assert gap(a, (0.0, 2.0 + np.sqrt(2), np.pi / 4, 2.0, 2.0)) == pytest.approx(1.0)
    assert gap(a, (0.1, 0.1, 0.3, 0.4, 0.2)) == 0.0  # one inside the other


def test_many_at_once_and_none():
    rng = np.random.default_rng(0)
    position, heading, size = (
        rng.uniform(-10, 10, (30, 2)),
        rng.uniform(-4, 4, 30),
        rng.uniform(1, 6, (30, 2)),
    )
    ego = (1.0, 2.0, 0.4, 5.0, 1.8)
    gaps = rectangle_gaps(*ego, position, heading, size)
    assert gaps.shape == (30,)
    single = [gap(ego, (*p, h, *s)) for p, h, s in zip(position, heading, size, strict=True)]
    np.testing.assert_allclose(gaps, single, atol=1e-12)
    assert rectangle_gaps(*ego, np.empty((0, 2)), np.empty(0), np.empty((0, 2))).shape == (0,)


def test_corners():
    corners = rectangle_corners(np.array([[1.0, 2.0]]), np.array([np.pi / 2]), np.array([[4.0, 2.0]]))
    np.testing.assert_allclose(corners[0], [[0, 4], [0, 0], [2, 0], [2, 4]], atol=1e-12)


def test_gaps_between_pairs_equal_one_against_many():
    rng = np.random.default_rng(2)
    position, heading, size = (
        rng.uniform(-6, 6, (2, 50, 2)),
        rng.uniform(-4, 4, (2, 50)),
        rng.uniform(1, 6, (2, 50, 2)),
    )
    pairs = gaps_between(position[0], heading[0], size[0], position[1], heading[1], size[1])
    single = [
        gap((*p, h, *s), (*q, g, *t))
        for p, h, s, q, g, t in zip(
            position[0], heading[0], size[0], position[1], heading[1], size[1], strict=True
        )
    ]
    np.testing.assert_allclose(pairs, single, atol=1e-12)
    assert 0 < np.count_nonzero(pairs) < 50
    alike = gaps_between(position[0], heading[0], size[0, 0], position[1], heading[1], size[1, 0])
    assert alike[7] == gap(
        (*position[0, 7], heading[0, 7], *size[0, 0]), (*position[1, 7], heading[1, 7], *size[1, 0])
    )
