"""Gaps between single rectangles agree with the vectorised ones; which bodies count as near."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from rudc.geometry import rectangle_gaps
from rudc.vehicle import EgoVehicle
from rudc.world.contact import nearest_of, survey
from rudc.world.scene import EgoState

coordinate = st.floats(-8, 8)
angle = st.floats(-7, 7)
length = st.floats(0.3, 12)
rectangle = st.tuples(coordinate, coordinate, angle, length, length)


def nearest(ego, *others):
    """Of rectangles (x, y, psi, length, width) named after their places in the list."""
    x, y, psi, length, width = map(float, ego)
    state, body = EgoState(x, y, psi, 0, 0, 0, 0, 0), EgoVehicle(length=length, width=width)
    rows, names = np.array(others, dtype=float), [f"other{i}" for i in range(len(others))]
    return nearest_of(state, body, names, rows[:, :2], rows[:, 2], rows[:, 3:])[0]


@settings(max_examples=300)
@given(rectangle, rectangle)
@example((0, 0, 0, 5, 2), (5, 0, 0, 5, 2))  # they touch
@example((0, 0, 0, 5, 2), (0, 0, 1, 0.3, 0.3))  # one lies in the other
def test_gap_is_the_vectorised_one(a, b):
    expected = rectangle_gaps(*a, np.array([b[:2]]), np.array([b[2]]), np.array([b[3:]]))[0]
    assert nearest(a, b).gap == pytest.approx(expected, abs=1e-9)
    assert nearest(b, a).gap == pytest.approx(expected, abs=1e-9)


@settings(max_examples=100)
@given(
    st.lists(st.tuples(st.floats(-40, 40), st.floats(-40, 40), angle, length, length), max_size=9),
    st.floats(0, 9),
)
def test_survey_finds_the_nearest_and_all_that_are_close(make_scene, four_way, others, reach):
    scene = make_scene(*({"at": other[:3], "size": other[3:]} for other in others))
    ego = scene.ego
    order = np.argsort(np.hypot(*(scene.position - (ego.x, ego.y)).T))
    scene = make_scene(*({"at": others[i][:3], "size": others[i][3:]} for i in order))
    gaps = rectangle_gaps(ego.x, ego.y, ego.psi, 5.0, 1.8, scene.position, scene.heading, scene.size)
    found, close = survey(scene, reach)
    assert found.gap == pytest.approx(gaps.min(initial=np.inf), abs=1e-9)
    assert (found.touched is not None) == bool((gaps == 0).any())
    assert {scene.ids[i] for i in np.flatnonzero(gaps < reach)} <= set(scene.ids[:close])


def test_the_nearest_of_several():
    ego = 0, 0, 0, 5, 2
    near, far, touching = (7, 0, 0, 2, 2), (12, 0, 0, 2, 2), (2, 0, 0, 2, 2)
    assert nearest(ego, far).gap == pytest.approx(8.5)
    assert nearest(ego, far, near).gap == nearest(ego, near, far).gap == pytest.approx(3.5)
    assert nearest(ego, far, near).touched is None
    assert nearest(ego, near, touching, far) == (0.0, "other1")
