import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rudc.network import polyline

SQUARE = np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]])
coordinate = st.floats(-50.0, 50.0)


@given(st.floats(-100.0, 100.0))
def test_wrap_stays_in_its_interval_and_keeps_the_direction(angle):
    wrapped = float(polyline.wrap(angle))
    assert -np.pi <= wrapped < np.pi
    assert np.cos(wrapped) == pytest.approx(np.cos(angle), abs=1e-9)
    assert np.sin(wrapped) == pytest.approx(np.sin(angle), abs=1e-9)


def test_resample_goes_straight_on_beyond_both_ends():
    line = np.array([[0.0, 0.0], [10.0, 0.0], [10.0, 5.0]])
    at = polyline.resample(line, np.array([-2.0, 5.0, 12.0, 17.0]))
    np.testing.assert_allclose(at, [[-2, 0], [5, 0], [10, 2], [10, 7]])


@given(st.floats(5.0, 40.0), st.floats(1.0, 5.0))
def test_smoothing_moves_an_arc_inwards_by_its_stated_amount(radius, window):
    angles = np.arange(0.0, np.pi, 0.05 / radius)
    arc = radius * np.column_stack([np.cos(angles), np.sin(angles)])
    middle = polyline.smooth(arc, 0.05, window)[len(arc) // 2]
    averaged = 2 * round(window / 0.1) + 1  # points
    stated = 0.05**2 * (averaged**2 - 1) / 24 / radius
    assert radius - np.hypot(*middle) == pytest.approx(stated, rel=0.02)


@given(st.floats(-2.5, 2.5), st.floats(5.0, 30.0), st.floats(5.0, 30.0))
def test_smoothing_keeps_ends_that_are_straight_for_half_a_window(bend, before, after):
    knee = np.array([before, 0.0])
    line = np.array([[0.0, 0.0], knee, knee + after * np.array([np.cos(bend), np.sin(bend)])])
    fine = polyline.resample(line, np.arange(0.0, before + after, 0.05))
    smoothed = polyline.smooth(fine, 0.05, 4.0)
    assert smoothed.shape == fine.shape
    np.testing.assert_allclose(smoothed[[0, -1]], fine[[0, -1]], atol=1e-9)


def test_offset_polyline_keeps_its_distance_on_both_legs():
    line = np.array([[0.0, 0.0], [10.0, 0.0], [10.0, 10.0]])
    left = polyline.offset_polyline(line, 2.0)
    np.testing.assert_allclose(left, [[0, 2], [8, 2], [8, 10]], atol=1e-12)


def test_a_strip_runs_counter_clockwise_and_has_the_bands_area():
    line = np.array([[0.0, 0.0], [10.0, 0.0]])
    assert polyline.signed_area(polyline.strip(line, 3.0)) == pytest.approx(30.0)


@given(coordinate, coordinate)
def test_inside_a_square_is_between_its_sides(x, y):
    if min(abs(x), abs(x - 4), abs(y), abs(y - 4)) < 1e-9:
        return
    assert polyline.inside(SQUARE, np.array([[x, y]]))[0] == (0 < x < 4 and 0 < y < 4)


def test_the_boundary_of_a_union_leaves_out_shared_and_covered_edges():
    squares = [SQUARE, SQUARE + np.array([4.0, 0.0]), SQUARE + np.array([2.0, 1.0])]
    pieces = polyline.union_boundary(squares)
    length = np.hypot(*(pieces[:, 1] - pieces[:, 0]).T).sum()
    assert length == pytest.approx(8 + 4 + 4 + 8 + 2, abs=0.6)
    assert not np.any(
        polyline.inside(np.array([[0.1, 0.1], [7.9, 0.1], [7.9, 3.9], [0.1, 3.9]]), pieces.mean(axis=1))
    )


def test_straightening_joins_what_goes_straight_on_and_nothing_else():
    pieces = polyline.union_boundary([SQUARE])
    straights = polyline.straightened(pieces)
    assert len(pieces) == 64
    np.testing.assert_allclose(straights[:, 0], SQUARE)
    np.testing.assert_allclose(straights[:, 1], np.roll(SQUARE, -1, axis=0))
    gap = np.delete(pieces, 5, axis=0)
    assert len(polyline.straightened(gap)) == 5


@given(st.lists(st.tuples(st.integers(0, 6), st.integers(0, 6)), min_size=3, max_size=9))
def test_inside_is_the_even_odd_rule_for_all_points_at_once(corners):
    """As edge by edge and point by point, on corners and edges, too."""
    polygon = np.array(corners, dtype=float)
    points = np.stack(np.meshgrid(np.arange(-1.0, 8.0, 0.5), np.arange(-1.0, 8.0, 0.5)), axis=-1).reshape(
        -1, 2
    )
    found = polyline.inside(polygon, points)
    for (x, y), hit in zip(points.tolist(), found, strict=True):
        odd = False
        for (x0, y0), (x1, y1) in zip(corners, [*corners[1:], corners[0]], strict=True):
            if (y0 > y) != (y1 > y):
                odd ^= x < x0 + (y - y0) * (x1 - x0) / (y1 - y0)
        assert hit == odd


@given(st.floats(-30.0, 60.0), st.floats(-20.0, 20.0))
def test_beside_is_the_nearest_legs_and_goes_straight_on(x, y):
    bent = np.array([[0.0, 0.0], [20.0, 0.0], [35.0, 10.0]])
    far = np.array([bent[0] - (200.0, 0.0), *bent[:2], bent[1] + 20.0 * (bent[2] - bent[1])])
    stations = np.arange(0.0, 400.0, 0.01)
    distance = np.hypot(*(polyline.resample(far, stations) - (x, y)).T)
    (s,), (left,) = polyline.beside(bent, np.array([[x, y]]))
    assert abs(left) == pytest.approx(distance.min(), abs=0.01)
    assert np.interp(s + 200.0, stations, distance) == pytest.approx(distance.min(), abs=0.01)
    if abs(left) > 0.1 and x < 15.0:
        assert bool(left > 0) is (y > 0)
