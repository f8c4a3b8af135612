"""Of those who cross its way on no path, the ego lets pass all that it is not well ahead of."""

# ruff: noqa: F811 -- fixtures come by import
import math
from dataclasses import replace

import numpy as np
import pytest

from rudc.agents.crossers import ready_for_crossers
from rudc.geometry import rectangle_gaps
from rudc.vehicle import EgoVehicle
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


def driven(scene, wanted):
    """Whether the ego touches nobody, and its slowest and last speed. Each command is held for a decision;
    without the rule the ego would be commanded `wanted` m/s2. The other never looks.
    """
    slowest, body = scene.ego.v, scene.vehicle
    for k in range(200):
        waited = scene.waited_s + 0.1 if scene.ego.v < 0.5 else 0.0
        a = float(ready_for_crossers(scene, np.array([wanted(scene.ego.v, k), 0.0]))[0])
        after = min(max(scene.ego.v + 0.1 * a, 0.0), 14.0)
        s = scene.ego_s + 0.05 * (scene.ego.v + after)
        x, y, psi = (float(value) for value in scene.route.path.pose(s))
        ego = replace(scene.ego, x=x, y=y, psi=psi, v=after)
        moved = scene.position + 0.1 * scene.velocity
        scene = replace(scene, ego=ego, ego_s=s, position=moved, waited_s=waited)
        gap = rectangle_gaps(x, y, psi, body.length, body.width, moved, scene.heading, scene.size)
        if gap.min() <= 0.0:
            return False, slowest, after
        slowest = min(slowest, after)
    return True, slowest, after


@pytest.mark.parametrize("degrees", [90.0, 60.0, 40.0])
@pytest.mark.parametrize("body", [EgoVehicle(), EgoVehicle(length=8.0, width=2.5)], ids=["car", "van"])
@pytest.mark.parametrize(
    "wanted", [lambda v, k: 0.0, lambda v, k: 2.0 if v < 8.0 else 0.0], ids=["keeps", "goes"]
)
def test_whoever_comes_and_whenever_it_stops_or_is_past(make_scene, degrees, body, wanted):
    rng = np.random.default_rng(0)
    stopped = passed = 0
    for _ in range(18):
        v, ahead = float(rng.uniform(4.0, 13.0)), float(rng.uniform(16.0, 45.0))
        speed = float(rng.uniform(0.6, 5.0))
        beside = float(min(rng.uniform(0.0, 1.5) * speed * ahead / v, 25.0))
        if v**2 / 12.0 + 0.4 * v > ahead - 4.0:
            continue
        scene = meeting(make_scene, ahead, beside, speed, v=v, angle=math.radians(degrees))
        free, slowest, last = driven(replace(scene, vehicle=body), wanted)
        assert free, (v, ahead, beside, speed)
        assert last >= min(v, 7.9) or wanted(0.0, 0) == 0.0, "in the end it goes on"
        stopped, passed = stopped + (slowest < 1.0), passed + (slowest >= v - 1e-9)
    assert stopped > 0
    assert passed > 0


@pytest.mark.parametrize("ahead", [6.4, 6.7, 7.2])
@pytest.mark.parametrize("speed", [0.7, 1.0])
def test_one_that_has_stopped_close_before_their_way_stays_until_they_are_past(make_scene, ahead, speed):
    scene = meeting(make_scene, ahead, beside=1.0 + 2.0 * speed, speed=speed, v=7.0)
    free, slowest, last = driven(scene, lambda v, k: 2.0 if v < 7.0 else 0.0)
    assert free
    assert slowest < 1.0
    assert last > 6.0


def test_one_that_brakes_for_something_else_does_not_stop_in_their_way(make_scene):
    """It would be past before them if it went on."""
    scene = meeting(make_scene, ahead=17.0, beside=8.5, speed=2.4, v=11.0)
    free, slowest, _ = driven(scene, lambda v, k: 0.0)
    assert free
    assert slowest > 10.0
    free, slowest, _ = driven(scene, lambda v, k: -5.0 if k >= 1 and v > 2.0 else 0.0)
    assert free
