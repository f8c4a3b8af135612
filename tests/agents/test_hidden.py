"""Speed before what the ego does not see."""

# ruff: noqa: F811 -- fixtures come by import
import math
from dataclasses import replace

import numpy as np
import pytest

from rudc.agents.hidden import CREEP, speed_by_sight
from tests.world.conftest import four_way, make_scene  # noqa: F401 -- fixtures

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
