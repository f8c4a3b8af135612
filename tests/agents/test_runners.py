"""The ego is ready for whoever may run out from behind a box."""

# ruff: noqa: F811 -- fixtures come by import
from dataclasses import replace

import numpy as np
import pytest

from rudc.agents.hidden import CREEP
from rudc.agents.runners import (
    RUNS,
    TRAIL_S,
    ready_for_next_runners,
    ready_for_runners,
    ready_for_setting_off,
)
from rudc.vehicle import Actuation
from rudc.world.ego import EgoPlant
from rudc.world.scene import Kind
from tests.world.conftest import four_way, make_scene  # noqa: F401 -- fixtures

FULL = np.array([3.0, 0.0])
END, LONG = 20.0, 20.0
"""m, distance from the ego's centre to the wall's end, in the beginning, and length of the wall"""


def beside_a_wall(scene, aside, end=END):
    """The scene with a wall to the right of the ego's way, `aside` m from the ego's side."""
    ego = scene.ego
    wall = [ego.x + 0.5 * scene.vehicle.width + aside + 0.5, ego.y + end - 0.5 * LONG, np.pi / 2, LONG, 1.0]
    return replace(scene, hidden_by=np.array([wall]))


def drive(scene, ready=ready_for_runners):
    """Speeds (m/s) and ways (m) of an ego that accelerates as it may, for 5 s."""
    plant, path = EgoPlant(scene.vehicle), scene.route.path
    plant.resume(scene.ego, Actuation())
    speeds, ways = [], []
    for _ in range(50):
        u = ready(scene, FULL)
        ego = plant.step(float(u[0]), 0.0, 0.1)
        s, offset = path.project(ego.x, ego.y, scene.ego_s)
        scene = replace(scene, ego=ego, ego_s=s, ego_offset=offset)
        speeds.append(ego.v)
        ways.append(s)
    return np.array(speeds), np.array(ways)


@pytest.mark.parametrize("aside", [0.8, 1.3, 1.8])
def test_it_stops_for_whoever_runs_out_or_is_past_before(make_scene, aside):
    scene = beside_a_wall(make_scene(front=-40.0, v=9.0), aside)
    speeds, ways = drive(scene)
    end = scene.ego_s + END - 0.5 * scene.vehicle.length
    room = end - ways
    for v, way in zip(speeds[room > 0.0], room[room > 0.0], strict=True):
        passes = way / v <= (aside + 0.5) / RUNS
        assert passes or v <= CREEP or v * v / (2 * 6.0) <= way
    assert CREEP <= speeds.min() < 8.0
    assert speeds[-1] > speeds.min() + 2.0, "past the wall it goes on"


@pytest.mark.parametrize("a_min", [-6.0, -3.0])
def test_who_needs_more_to_stop_looks_farther(make_scene, a_min):
    """It looked 20 m ahead only: a car that brakes with 3 m/s2 could not stop from 15 m/s any more."""
    scene = make_scene(front=-75.0, v=15.0)
    scene = replace(scene, vehicle=replace(scene.vehicle, a_min=a_min))
    scene = beside_a_wall(scene, 0.8, end=65.0)
    scene = replace(scene, hidden_by=scene.hidden_by * [1, 1, 1, 0.1, 1] + [0, 9, 0, 0, 0])
    speeds, ways = drive(scene)
    room = scene.ego_s + 65.0 - 0.5 * scene.vehicle.length - ways
    for v, way in zip(speeds[room > 0.0], room[room > 0.0], strict=True):
        assert way / v <= 1.3 / RUNS or v <= CREEP or v * v / (2 * -a_min) <= way


def test_only_what_hides_near_the_way_slows_it_down(make_scene):
    scene = make_scene(front=-40.0, v=9.0)
    assert ready_for_runners(scene, FULL) is FULL
    assert ready_for_runners(beside_a_wall(scene, 3.5, end=10.0), FULL) is FULL
    assert ready_for_runners(beside_a_wall(scene, 1.0, end=10.0), FULL)[0] < 0.0
    slow = replace(scene, ego=replace(scene.ego, v=1.0))
    assert ready_for_runners(beside_a_wall(slow, 1.0, end=10.0), FULL) is FULL


def test_nobody_runs_through_the_wall_itself(make_scene):
    scene = beside_a_wall(make_scene(front=-40.0, v=9.0), 1.0, end=10.0)
    endless = scene.hidden_by.copy()
    endless[0, 3] = 400.0
    assert ready_for_runners(replace(scene, hidden_by=endless), FULL) is FULL


def one_stands(make_scene, aside, ahead=20.0, heading=np.pi, **changes):
    """Somebody stands to the right of the ego's way, `aside` m from its side."""
    them = {"at": (0.0, 0.0, 0.0), "v": 0.0, "kind": Kind.PEDESTRIAN, "size": (0.5, 0.5), **changes}
    scene = make_scene(them, front=-40.0, v=9.0)
    ego = scene.ego
    place = ego.x + 0.5 * scene.vehicle.width + aside + 0.25, ego.y + 0.5 * scene.vehicle.length + ahead
    return replace(scene, position=np.array([place]), heading=np.array([heading]))


@pytest.mark.parametrize("aside", [0.3, 1.0, 2.0, 2.9])
def test_it_can_stop_for_who_stands_half_way_over_the_road_or_is_past_before_they_set_off(make_scene, aside):
    """At 9 m/s it drove past somebody who stood 2 m beside its way, and set off as it came."""
    scene = one_stands(make_scene, aside)
    speeds, ways = drive(scene, ready_for_setting_off)
    room = scene.ego_s + 20.0 - ways
    for v, way in zip(speeds[room > 0.0], room[room > 0.0], strict=True):
        passes = way / v <= aside / RUNS + 1e-6
        least = 6.0 if way > 18.0 else 3.4  # m/s2: after its first decisions it could stop also on ice
        assert passes or v <= CREEP + 0.2 or v * v / (2 * least) <= way + 0.1
    assert CREEP - 0.1 <= speeds.min() < 8.0
    assert speeds[-1] > speeds.min() + 2.0, "then it goes on"


@pytest.mark.parametrize(
    ("why", "changes"),
    [
        ("far from its way", {"aside": 3.4}),
        ("facing away from it", {"aside": 1.0, "heading": 0.0}),
        ("facing along it", {"aside": 1.0, "heading": 0.5 * np.pi}),
        ("no pedestrian", {"aside": 1.0, "kind": Kind.OBSTACLE}),
        ("behind its front", {"aside": 1.0, "ahead": -1.0}),
        ("walking, and looked at by others", {"aside": 1.0, "v": 1.0}),
    ],
)
def test_it_does_not_slow_down_for_who_stands(make_scene, why, changes):
    for ahead in (4.0, 9.0):
        scene = one_stands(make_scene, **{"ahead": ahead, **changes})
        assert ready_for_setting_off(scene, FULL) is FULL, why
        if why == "far from its way":
            assert ready_for_setting_off(one_stands(make_scene, 1.0, ahead), FULL)[0] < 0.0


CROSSING = 12.0
"""m before the ego's front, way of the one who runs across"""


def one_runs(make_scene, passed_s, v=6.0, speed=3.5, heading=np.pi):
    """Somebody crosses the ego's way who came from behind a wall 2 m beside it `passed_s` s ago."""
    scene = make_scene(front=-40.0, v=v)
    ego, half = scene.ego, 0.5 * scene.vehicle.length
    end = [ego.x + 0.5 * scene.vehicle.width + 2.0, ego.y + half + CROSSING]
    at = end + speed * passed_s * np.array([np.cos(heading), np.sin(heading)])
    runner = {"at": (*at, heading), "v": speed, "kind": Kind.PEDESTRIAN, "size": (0.5, 0.5)}
    wall = [end[0] + 1.0, end[1] - 5.0, np.pi / 2, 8.0, 1.0]
    return replace(make_scene(runner, front=-40.0, v=v), hidden_by=np.array([wall]))


def test_who_ran_out_may_be_followed(make_scene):
    for passed_s in (0.2, 1.0, 2.0):
        scene, came = one_runs(make_scene, passed_s), False
        plant, path = EgoPlant(scene.vehicle), scene.route.path
        plant.resume(scene.ego, Actuation())
        start = scene.ego_s
        for _ in range(int((TRAIL_S - passed_s) * 10)):
            came |= scene.ego_s - start > CROSSING
            ego = plant.step(float(ready_for_next_runners(scene, FULL)[0]), 0.0, 0.1)
            s, offset = path.project(ego.x, ego.y, scene.ego_s)
            there = scene.position + 0.1 * scene.velocity
            scene = replace(scene, ego=ego, ego_s=s, ego_offset=offset, position=there)
        assert not came, "it stops before the way of those who may follow"
        assert ready_for_next_runners(scene, FULL)[0] == FULL[0], "nobody came: it goes on"


def test_those_whom_nobody_can_follow_unseen_are_none(make_scene):
    assert ready_for_next_runners(one_runs(make_scene, 1.0, v=10.0), FULL)[0] < 0.0
    assert ready_for_next_runners(one_runs(make_scene, TRAIL_S + 0.5, v=10.0), FULL) is FULL, "long ago"
    assert ready_for_next_runners(replace(one_runs(make_scene, 1.0, v=10.0), hidden_by=None), FULL) is FULL
    assert ready_for_next_runners(one_runs(make_scene, 1.0, v=10.0, heading=np.pi / 2), FULL) is FULL, (
        "along the road"
    )
    assert ready_for_next_runners(one_runs(make_scene, 1.0, v=15.0), FULL) is FULL, "it can stop no more"
