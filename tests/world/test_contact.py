"""Gaps between single rectangles against the vectorised ones, and who counts as near."""

import cmath

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from rudc.geometry import rectangle_gaps
from rudc.world.contact import NOTHING, Body, gap_between, nearer, survey

coordinate = st.floats(-8, 8)
angle = st.floats(-7, 7)
length = st.floats(0.3, 12)
rectangle = st.tuples(coordinate, coordinate, angle, length, length)


def body(x, y, psi, length, width, name="it"):
    return Body(name, complex(x, y), cmath.rect(1.0, psi), length / 2, width / 2)


@settings(max_examples=300, deadline=None)
@given(rectangle, rectangle)
@example((0, 0, 0, 5, 2), (5, 0, 0, 5, 2))  # they touch
@example((0, 0, 0, 5, 2), (0, 0, 1, 0.3, 0.3))  # one lies in the other
def test_gap_is_the_vectorised_one(a, b):
    expected = rectangle_gaps(*a, np.array([b[:2]]), np.array([b[2]]), np.array([b[3:]]))[0]
    assert gap_between(body(*a), body(*b)) == pytest.approx(expected, abs=1e-9)
    assert gap_between(body(*b), body(*a)) == pytest.approx(expected, abs=1e-9)


@settings(max_examples=100, deadline=None)
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
    assert {scene.ids[i] for i in np.flatnonzero(gaps < reach)} <= {near.name for near in close}


def test_nearer_keeps_the_better_of_two():
    ego = body(0, 0, 0, 5, 2)
    near, far, touching = (
        body(7, 0, 0, 2, 2, "near"),
        body(12, 0, 0, 2, 2, "far"),
        body(2, 0, 0, 2, 2, "touching"),
    )
    best = nearer(NOTHING, ego, far)
    assert best.gap == pytest.approx(8.5)
    best = nearer(best, ego, near)
    assert best.gap == pytest.approx(3.5)
    assert nearer(best, ego, far) == best
    assert best.touched is None
    assert nearer(best, ego, touching) == (0.0, "touching")
