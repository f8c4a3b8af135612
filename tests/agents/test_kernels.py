"""The agents' kernels against numpy."""

import math

import numpy as np
import pytest

from rudc.agents.kernels import nearest_hidden, sighted, two_way, unexplained, who_leads
from rudc.world.perception import in_sight


def test_functions_of_two_places_are_added_between_their_knots():
    rng = np.random.default_rng(0)
    knots, other_knots = np.sort(rng.uniform(-40, 40, 9)), np.sort(rng.uniform(0, 80, 5))
    values, other_values = rng.normal(size=(3, 9)), rng.normal(size=(3, 5))
    for x, y in rng.uniform([-60, -20], [60, 100], (200, 2)):
        wanted = [
            np.interp(x, knots, f) + np.interp(y, other_knots, g)
            for f, g in zip(values, other_values, strict=True)
        ]
        assert two_way(x, y, knots, values, other_knots, other_values) == pytest.approx(wanted, abs=1e-12)


def outline(position, heading, size):
    """(K, 2) m, places all along the sides of a rectangle."""
    t = np.linspace(-0.5, 0.5, 4001)
    ends = np.full_like(t, 0.5)
    x, y = (np.concatenate(parts) for parts in ([t, t, ends, -ends], [ends, -ends, t, t]))
    x, y = x * size[0], y * size[1]
    cos, sin = np.cos(heading), np.sin(heading)
    return position + np.stack([cos * x - sin * y, sin * x + cos * y], axis=1)


def test_who_leads_is_the_nearest_rear_of_those_who_move_that_way():
    rng, found = np.random.default_rng(1), 0
    s = np.arange(0.0, 120.0, 0.5)
    straight, course = np.stack([s, np.zeros_like(s)], axis=1), np.zeros_like(s)
    for _ in range(300):
        position = rng.uniform([0, -4], [110, 4], (6, 2))
        heading, speed = rng.normal(0.0, 0.5, 6), rng.uniform(0, 9, 6)
        velocity = speed[:, None] * np.stack([np.cos(heading), np.sin(heading)], axis=1)
        size, ego_s = rng.uniform([2, 0.6], [12, 2.5], (6, 2)), rng.uniform(0, 100)
        along = np.cos(heading)
        places = map(outline, position, heading, size)
        rear = np.array([at[abs(at[:, 1]) < 0.9, 0].min(initial=np.inf) for at in places])
        ahead = np.isfinite(rear) & (rear > ego_s + 2.5) & (speed > 0.5) & (along > 0.7)
        gap, towards = who_leads(
            straight, course, 0.5, position, heading, velocity, size, ego_s, 5.0, 1.8, 0.5, 0.7, 50.0
        )
        assert math.isinf(gap) is not ahead.any()
        if ahead.any():
            first = np.flatnonzero(ahead)[rear[ahead].argmin()]
            assert gap == pytest.approx(rear[first] - ego_s - 2.5, abs=0.01)
            assert towards == pytest.approx(speed[first] * along[first])
            found += 1
    assert found > 100


def test_what_motion_explains_is_not_unexplained():
    rng, dt = np.random.default_rng(2), 0.1
    heading, speed, acceleration = rng.uniform(-3, 3, 5), rng.uniform(-2, 9, 5), rng.normal(size=5)
    turned, later = rng.normal(0.0, 0.1, 5), speed + dt * acceleration
    course, after = (np.stack([np.cos(h), np.sin(h)], axis=1) for h in (heading, heading + turned))
    before, moved = speed[:, None] * course, later[:, None] * after
    position = rng.uniform(-40, 40, (5, 2))
    off = 0.2 * rng.normal(size=(5, 4))
    there = position + 0.5 * dt * (before + moved) + off[:, :2]
    last = sighted(position, before, heading, 9, 1e-4)
    assert last[:, 2] == pytest.approx(speed)
    assert last[:, 3:5] == pytest.approx(course)
    now = sighted(there, moved, heading + turned + off[:, 3], 4, 1e-4)
    rows = np.array([0, -1, 2, 3])
    found = unexplained(now, last, rows, acceleration - off[:, 2] / dt, dt)
    kept = off[:4][rows >= 0]
    assert found[:, :3] == pytest.approx(abs(kept[:, :3]))
    assert found[:, 3] == pytest.approx(kept[:, 3])


def test_what_a_box_hides_and_does_not_bar_is_as_in_sight_has_it():
    rng = np.random.default_rng(3)
    aside, found = np.arange(0.5, 3.25, 0.5), []
    for _ in range(60):
        boxes = np.column_stack([
            rng.uniform(-2, 22, 4), rng.uniform(-8, 8, 4), rng.uniform(-3, 3, 4), rng.uniform(1, 12, (4, 2))
        ])  # fmt: skip
        x, psi = np.arange(3.0, 20.0), rng.uniform(-0.5, 0.5, 17)
        y, eye = np.cumsum(psi), (-2.0, 0.5)
        line, left = np.stack([x, y], axis=-1), np.stack([-np.sin(psi), np.cos(psi)], axis=-1)
        away = np.array([[1.0], [-1.0]]) * (0.9 + aside)
        places = line[:, None, None] + away[:, :, None] * left[:, None, None]
        free = np.stack([in_sight(tuple(p), q, boxes) for p, q in zip(line, places, strict=True)])
        wanted = np.where(~in_sight(eye, places, boxes) & free, aside, np.inf).min(axis=(1, 2))
        got = nearest_hidden(*eye, x, y, psi, 0.9, aside, boxes)
        np.testing.assert_array_equal(got, wanted)
        found += got.tolist()
    assert 0.2 < np.isfinite(found).mean() < 0.9
