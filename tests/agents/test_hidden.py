"""Speed before what the ego does not see."""

# ruff: noqa: F811 -- fixtures come by import
import math
from dataclasses import replace

import numpy as np
import pytest

from rudc.agents.hidden import (
    BEFORE,
    CREEP,
    look_ahead,
    ready_for_unseen,
    ready_to_wait_for_unseen,
    speed_by_sight,
)
from rudc.network.network import load_network
from tests.world.conftest import four_way, make_scene  # noqa: F401 -- fixtures
from tests.world.networks import with_limits

CORNERS = np.array([[sx * 16.5, sy * 16.5, 0.0, 13.0, 13.0] for sx in (-1, 1) for sy in (-1, 1)])


@pytest.mark.parametrize("grip", [2.0, 4.6])
@pytest.mark.parametrize("front", [-30.0, -20.0, -12.0, -6.0])
def test_the_ego_can_stop_before_whoever_comes_out_of_hiding(make_scene, front, grip):
    scene = replace(make_scene(turn="left", front=front, v=8.0), hidden_by=CORNERS)
    speed = speed_by_sight(scene, grip)
    room = scene.route.zone_start_s - scene.ego_s
    assert speed <= max(math.sqrt(2 * grip * room), CREEP)
    assert speed >= CREEP


def test_who_sees_all_is_not_slowed_down(make_scene):
    scene = make_scene(turn="left", front=-10.0)
    assert speed_by_sight(scene, 3.0) == math.inf
    far = np.array([[60.0, 60.0, 0.0, 5.0, 5.0]])
    assert speed_by_sight(replace(scene, hidden_by=far), 3.0) == math.inf


def test_short_sight_hides_as_boxes_do(make_scene):
    scene = make_scene(turn="left", front=-10.0)
    assert speed_by_sight(replace(scene, sight_m=20.0), 3.0) < 12.0
    assert speed_by_sight(replace(scene, sight_m=200.0), 3.0) == math.inf


def test_where_traffic_is_fast_it_is_looked_for_farther_away(make_scene, tmp_path):
    """At 25 m/s somebody 100 m away is there in 4 s; from rest the ego needs longer to be past."""
    fast = load_network(str(with_limits(tmp_path, lambda edge: 25.0)))
    scene = replace(make_scene(turn="left", front=-1.0, v=0.0), sight_m=100.0)
    assert speed_by_sight(scene, 3.0) == math.inf
    assert speed_by_sight(replace(scene, network=fast), 3.0) < 12.0


def test_who_merges_has_passed_before_the_end_of_the_road(make_scene):
    """The end of the exit arm counted as the end of the conflict: it crept before every merge."""
    for turn, sight in (("right", 40.0), ("straight", 60.0)):
        scene = make_scene(turn=turn, front=-1.0, v=6.0)
        assert speed_by_sight(replace(scene, sight_m=sight), 1.0) == math.inf
        assert speed_by_sight(replace(scene, sight_m=15.0), 1.0) < 6.0


@pytest.mark.parametrize("hides", [{"sight_m": 15.0}, {"hidden_by": CORNERS}])
def test_who_gives_way_can_stop_for_whom_it_does_not_see(make_scene, hides):
    """In fog an ego that gave way drove into the junction at 9 m/s, and met one who did not brake for it."""
    full = np.array([3.0, 0.0])
    for v in np.arange(0.0, 12.0, 0.5):
        seeing = make_scene(front=-6.0, v=float(v))
        assert ready_to_wait_for_unseen(seeing, full) is full
        scene = replace(seeing, **hides)
        a = float(ready_to_wait_for_unseen(scene, full)[0])
        room, hardest = scene.route.zone_start_s - scene.front_s, -scene.vehicle.a_min
        assert (v + 0.1 * a) ** 2 / (2 * hardest) <= max(room, CREEP**2 / (2 * hardest))
        assert a > 0.0 or v >= CREEP, "it never stands for that"
    assert a < 0.0
    late = replace(make_scene(front=2.0, v=9.0), sight_m=15.0)
    assert ready_to_wait_for_unseen(late, full) is full, "it cannot stop any more"
    with_priority = make_scene(origin="west", front=-6.0, v=9.0)
    assert ready_to_wait_for_unseen(replace(with_priority, **hides), full) is full


@pytest.mark.parametrize("sight", [3.0, 9.0, 20.0])
def test_on_its_path_it_can_stop_within_what_it_sees(make_scene, sight):
    full = np.array([3.0, 0.0])
    for v in np.arange(0.0, 14.0, 0.5):
        scene = replace(make_scene(turn="straight", front=-40.0, v=float(v)), sight_m=sight)
        room = sight - 0.5 * scene.vehicle.length - BEFORE
        a = float(ready_for_unseen(scene, full)[0])
        later = v + 0.1 * a
        hardest = -scene.vehicle.a_min
        assert later**2 / (2 * hardest) <= max(room, 0.0) + CREEP**2 or a == -hardest
        assert a > 0.0 or v >= CREEP, "it never stands for that"
    assert ready_for_unseen(replace(scene, sight_m=60.0), full) is full


@pytest.mark.parametrize(("a_min", "v", "sight"), [(-3.0, 15.0, 45.5), (-6.0, 25.0, 50.0)])
def test_who_needs_more_to_stop_looks_farther(make_scene, a_min, v, sight):
    """It looked 40 m ahead at most, and beyond a sight of 45 m not at all."""
    full = np.array([3.0, 0.0])
    scene = make_scene(turn="straight", front=-75.0, v=v)
    scene = replace(scene, vehicle=replace(scene.vehicle, a_min=a_min, v_max=25.0))
    assert ready_for_unseen(replace(scene, sight_m=sight), full)[0] < 0.0
    assert ready_for_unseen(replace(scene, sight_m=150.0), full) is full
    box = np.array([[scene.ego.x, scene.ego.y + sight + 0.5, 0.0, 1.0, 1.0]])
    assert ready_for_unseen(replace(scene, hidden_by=box), full)[0] < 0.0
    nothing = replace(scene, sight_m=sight, vehicle=replace(scene.vehicle, a_min=0.0))
    assert ready_for_unseen(nothing, full)[0] == 0.0, "where the road gives nothing"


def test_a_usual_car_at_usual_speeds_looks_as_far_as_ever(make_scene):
    for v, least in ((10.0, 20.0), (15.0, 40.0)):
        scene = make_scene(turn="straight", front=-75.0, v=v)
        assert look_ahead(scene, least, 0.8 * 6.0) == least


def test_conflicts_count_from_where_the_ego_needs_to_stop(make_scene):
    scene = replace(make_scene(turn="left", front=-60.0, v=12.0), sight_m=30.0)
    assert speed_by_sight(scene, 5.0) == math.inf
    assert speed_by_sight(scene, 1.0) < 12.0


def test_a_wall_beside_a_bend_hides_the_path_behind_it(make_scene):
    full = np.array([3.0, 0.0])
    scene = make_scene(turn="right", front=-5.0, v=8.0)
    x, y, _ = scene.route.path.pose(scene.ego_s + 12.0)
    wall = np.array([[0.5 * (scene.ego.x + x), 0.5 * (scene.ego.y + y), 0.0, 1.0, 1.0]])
    assert ready_for_unseen(scene, full) is full
    assert ready_for_unseen(replace(scene, hidden_by=wall), full)[0] < 0.0
    away = np.array([[scene.ego.x - 30.0, scene.ego.y, 0.0, 5.0, 5.0]])
    assert ready_for_unseen(replace(scene, hidden_by=away), full) is full
