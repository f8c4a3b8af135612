"""Who stands, as seen by sensors with flaws."""

# ruff: noqa: F811 -- fixtures come by import
from dataclasses import replace

import numpy as np
import pytest

from rudc.agents.blocking import Blocking
from rudc.agents.standing import MEMORY_S, Standing
from rudc.world.perception import Sensors
from rudc.world.scene import Kind
from tests.world.conftest import four_way, make_scene  # noqa: F401 -- fixtures

POSE = (12.0, 3.0, 0.7)


@pytest.fixture
def wreck(make_scene):
    return make_scene({"at": POSE, "kind": Kind.CAR})


def watched(scene, sensors, seconds, watch):
    """What a watch says at each decision of so many seconds."""
    rng = np.random.default_rng(0)
    return [
        watch.look(sensors.perceive(replace(scene, time_s=0.1 * k), rng)) for k in range(round(10 * seconds))
    ]


def test_who_stands_is_seen_where_it_stands_through_noise_and_gaps(wreck):
    sensors = Sensors(position_std=0.3, speed_std=0.5, heading_std=0.05, miss=0.2)
    last = watched(wreck, sensors, 10.0, Standing())[50:]
    assert all(scene.count == 1 and not scene.velocity.any() for scene in last)
    assert all(np.hypot(*(scene.position[0] - POSE[:2])) < 0.35 for scene in last)
    assert all(abs(scene.heading[0] - POSE[2]) < 0.06 for scene in last)
    blocks = watched(wreck, sensors, 10.0, Blocking())[50:]
    assert all(seen.standing.number == 1 and seen.coming.outside.number == 0 for seen in blocks)


def test_sensors_without_flaws_are_believed(wreck):
    seen = watched(wreck, Sensors(), 3.0, Standing())[-1]
    assert seen.position[0] == pytest.approx(POSE[:2], abs=1e-12)
    assert seen.heading[0] == pytest.approx(POSE[2], abs=1e-12)


def test_who_sets_off_moves_and_who_is_gone_is_forgotten(wreck, make_scene):
    watch = Standing()
    watch.look(wreck)
    for k in range(1, 30):
        moved = make_scene({"at": (POSE[0] + 0.2 * k, *POSE[1:]), "v": 2.0})
        seen = watch.look(replace(moved, time_s=wreck.time_s + 0.1 * k))
    assert seen.velocity.any()
    watch.look(wreck)
    nobody = replace(make_scene(), time_s=wreck.time_s + 0.1)
    assert watch.look(nobody).count == 1
    assert watch.look(replace(nobody, time_s=wreck.time_s + MEMORY_S + 0.2)).count == 0
