"""The ego's sensors, in cases that can be drawn on paper: the ego at the origin, looking east."""

from dataclasses import replace

import numpy as np
import pytest

from rudc.world.perception import Sensors, visible
from rudc.world.scene import EgoState


@pytest.fixture
def scene_with(make_scene):
    def make(*places):
        scene = make_scene(*({"at": (x, y, psi), "v": 5.0} for x, y, psi in places))
        return replace(scene, ego=EgoState(0.0, 0.0, 0.0, 5.0, 0.0, 0.0, 0.0, 0.0))

    return make


@pytest.mark.parametrize(
    ("place", "seen"),
    [
        ((20.0, 0.0, 0.0), False),  # right behind the box
        ((20.0, 0.0, np.pi / 2), True),  # across: its ends, 2.5 m to the sides, stick out of the 4 m shadow
        ((20.0, 6.0, 0.0), True),  # beside its shadow
        ((5.0, 0.0, 0.0), True),  # before it
        ((-20.0, 0.0, 0.0), True),  # behind the ego
        ((20.0, 2.4, 0.0), True),  # its far corner looks out
    ],
)
def test_a_box_hides_what_is_behind_it(scene_with, place, seen):
    box = np.array([[10.0, 0.0, 0.0, 2.0, 2.0]])
    assert visible(scene_with(place), box).tolist() == [seen]


def test_a_turned_box_casts_a_turned_shadow(scene_with):
    behind, beside = (20.0, 0.0, 0.0), (20.0, 7.0, 0.0)
    scene = scene_with(behind, beside)
    lengthwise, across = (
        np.array([[10.0, 0.0, 0.0, 10.0, 0.5]]),
        np.array([[10.0, 0.0, np.pi / 2, 10.0, 0.5]]),
    )
    assert visible(scene, lengthwise).tolist() == [True, True], "a thin wall seen end on hides no car"
    assert visible(scene, across).tolist() == [False, False]


def test_two_boxes_hide_what_neither_hides_alone(scene_with):
    scene = scene_with((20.0, 0.0, np.pi / 2))
    left, right = [10.0, 1.0, 0.0, 2.0, 2.0], [10.0, -1.0, 0.0, 2.0, 2.0]
    assert visible(scene, np.array([left])).all()
    assert visible(scene, np.array([right])).all()
    assert not visible(scene, np.array([left, right])).any()


def test_perfect_sensors_give_the_very_scene(scene_with):
    scene = scene_with((20.0, 0.0, 0.0))
    assert Sensors().perceive(scene, np.random.default_rng(0)) is scene


def test_what_is_hidden_is_left_out_of_every_array(scene_with):
    scene = scene_with((5.0, 3.0, 0.0), (20.0, 0.0, 0.0), (30.0, 20.0, 1.0))
    sensors = Sensors(np.array([[10.0, 0.0, 0.0, 2.0, 2.0]]))
    seen = sensors.perceive(scene, np.random.default_rng(0))
    assert seen.ids == (scene.ids[0], scene.ids[2])
    for name in ("position", "heading", "velocity", "acceleration", "size", "kind", "path", "path_s"):
        assert np.array_equal(getattr(seen, name), getattr(scene, name)[[0, 2]]), name


def test_nothing_is_seen_beyond_the_range(scene_with):
    scene = scene_with((12.2, 0.0, 0.0), (0.0, 12.3, 0.0))
    assert scene.size[0, 0] > 4.5
    seen = Sensors(range_m=10.0).perceive(scene, np.random.default_rng(0))
    assert seen.ids == scene.ids[:1], "its near end is 9.9 m away; the other, seen from its side, 11.4"


def test_each_is_missed_as_often_as_asked(scene_with):
    scene, rng = scene_with((10.0, 0.0, 0.0), (20.0, 5.0, 0.0)), np.random.default_rng(1)
    sensors = Sensors(miss=0.3)
    found = [sensors.perceive(scene, rng).ids for _ in range(2000)]
    for name in scene.ids:
        assert sum(name in ids for ids in found) / 2000 == pytest.approx(0.7, abs=0.04)


def test_noise_has_the_standard_deviations_asked_for(scene_with):
    scene, rng = scene_with((10.0, 0.0, 0.5)), np.random.default_rng(1)
    sensors = Sensors(position_std=0.5, speed_std=0.8, heading_std=0.1)
    seen = [sensors.perceive(scene, rng) for _ in range(3000)]
    position = np.array([s.position[0] for s in seen]) - scene.position[0]
    heading = np.array([s.heading[0] for s in seen]) - 0.5
    speed = np.array([s.velocity[0] @ (np.cos(0.5), np.sin(0.5)) for s in seen]) - 5.0
    assert position.std(axis=0) == pytest.approx([0.5, 0.5], rel=0.06)
    assert heading.std() == pytest.approx(0.1, rel=0.06)
    assert speed.std() == pytest.approx(0.8, rel=0.06)
    along = np.array([s.path_s[0] for s in seen]) - scene.path_s[0]
    assert along == pytest.approx(position @ (np.cos(0.5), np.sin(0.5))), (
        "place on the path and on the plane agree"
    )
    assert all(s.size is scene.size for s in seen)


def test_who_seems_nearest_comes_first(scene_with):
    scene, rng = scene_with((10.0, 1.0, 0.0), (10.1, -2.0, 1.0)), np.random.default_rng(1)
    orders = set()
    for _ in range(20):
        seen = Sensors(position_std=0.5).perceive(scene, rng)
        assert (np.diff(np.linalg.norm(seen.position, axis=1)) >= 0).all()
        rows = [scene.ids.index(name) for name in seen.ids]
        assert np.array_equal(seen.heading, scene.heading[rows])
        orders.add(seen.ids)
    assert orders == {scene.ids, scene.ids[::-1]}


def test_the_egos_own_accelerometer_may_be_noisy(scene_with):
    scene = scene_with((20.0, 5.0, 0.0))
    sensors = Sensors(own_acceleration_std=0.15)
    rng = np.random.default_rng(0)
    read = [sensors.perceive(scene, rng).ego.acceleration - scene.ego.acceleration for _ in range(400)]
    assert np.std(read) == pytest.approx(0.15, rel=0.15)
    seen = sensors.perceive(scene, rng)
    assert np.array_equal(seen.position, scene.position)
    assert seen.ego.v == scene.ego.v
