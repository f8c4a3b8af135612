"""Of those who cross its way on no path, the ego lets pass all that it is not well ahead of."""

# ruff: noqa: F811 -- fixtures come by import
import math
from dataclasses import replace

import numpy as np
import pytest

from rudc.agents.crossers import ready_for_crossers
from rudc.geometry import rectangle_gaps
from rudc.world.scene import Kind
from tests.world.conftest import four_way, make_scene  # noqa: F401 -- fixtures

FASTER = np.array([2.0, 0.01])
WALKER = {"kind": Kind.PEDESTRIAN, "size": (0.5, 0.5)}


def meeting(make_scene, ahead, beside, speed, v=10.0, angle=0.5 * math.pi, **other):
    """Somebody `ahead` m before the ego's front and `beside` m to its right, who goes to its left."""
    alone = make_scene(turn="straight", front=-60.0, v=v)
    x, y, psi = (float(value) for value in alone.route.path.pose(alone.front_s + ahead))
    place = x + beside * math.sin(psi), y - beside * math.cos(psi), psi + angle
    return make_scene({"at": place, "v": speed, **WALKER, **other}, turn="straight", front=-60.0, v=v)


def slows(scene):
    u = ready_for_crossers(scene, FASTER)
    assert u[1] == FASTER[1]
    return u[0] < FASTER[0]


def test_it_slows_down_for_who_comes_at_the_same_time(make_scene):
    assert slows(meeting(make_scene, ahead=15.0, beside=4.0, speed=1.5))
    assert slows(meeting(make_scene, ahead=15.0, beside=-4.0, speed=1.5, angle=-0.5 * math.pi))
    assert slows(
        meeting(make_scene, ahead=15.0, beside=6.0, speed=4.0, kind=Kind.MOTORCYCLE, size=(2.2, 0.9))
    )


@pytest.mark.parametrize(
    ("why", "where"),
    [
        ("it is well ahead", {"ahead": 8.0, "beside": 12.0}),
        ("the other is past", {"ahead": 15.0, "beside": -4.0}),
        ("the other will be past", {"ahead": 50.0, "beside": 1.5}),
        ("it cannot stop any more", {"ahead": 6.0, "beside": 1.5}),
        ("the other goes the same way", {"ahead": 15.0, "beside": 0.0, "angle": 0.0}),
    ],
)
def test_it_does_not_slow_down_where(make_scene, why, where):
    assert not slows(meeting(make_scene, speed=1.5, **where)), why


def test_who_stands_or_is_on_a_path_is_left_to_others(make_scene):
    assert not slows(meeting(make_scene, ahead=15.0, beside=4.0, speed=0.0))
    scene = meeting(make_scene, ahead=15.0, beside=4.0, speed=1.5)
    assert not slows(replace(scene, path=np.zeros(1, dtype=np.int64)))


def test_whoever_comes_and_whenever_it_stops_or_is_past(make_scene):
    """Driven to the end, with each command held for a decision. The other never looks."""
    rng = np.random.default_rng(0)
    stopped = passed = 0
    for _ in range(60):
        v, ahead = float(rng.uniform(4.0, 13.0)), float(rng.uniform(16.0, 45.0))
        speed = float(rng.uniform(0.8, 5.0))
        beside = float(min(rng.uniform(0.0, 1.5) * speed * ahead / v, 25.0))
        scene = meeting(make_scene, ahead, beside, speed, v=v)
        if v**2 / 12.0 + 0.4 * v > ahead:
            continue
        slowest = v
        for _ in range(150):
            a = float(ready_for_crossers(scene, np.zeros(2))[0])
            after = max(scene.ego.v + 0.1 * a, 0.0)
            s = scene.ego_s + 0.05 * (scene.ego.v + after)
            x, y, psi = (float(value) for value in scene.route.path.pose(s))
            ego = replace(scene.ego, x=x, y=y, psi=psi, v=after)
            scene = replace(scene, ego=ego, ego_s=s, position=scene.position + 0.1 * scene.velocity)
            gap = rectangle_gaps(x, y, psi, 5.0, 1.8, scene.position, scene.heading, scene.size)
            assert gap.min() > 0.0, (v, ahead, beside, speed)
            slowest = min(slowest, after)
        stopped, passed = stopped + (slowest < 1.0), passed + (slowest == v)
    assert stopped > 5
    assert passed > 5
