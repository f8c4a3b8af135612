"""A scene sent to another process is small, and there has that process's own network and route."""

import pickle
import subprocess
import sys

import numpy as np
import pytest

from rudc.vehicle import EgoVehicle
from rudc.world.perception import Sensors
from rudc.world.scene import OF_OTHERS, Scene
from tests.plans import PlanSource

CHECK = """
import pickle, sys
from rudc.network.network import load_network
scene = pickle.load(sys.stdin.buffer)
network = load_network("four_way", vehicle=scene.vehicle)
assert scene.network is network
assert scene.route is network.route(scene.route.origin, scene.route.destination)
sys.stdout.buffer.write(pickle.dumps(scene))
"""


def test_a_scene_crosses_small_and_comes_back_the_same(world_on):
    world = world_on(vehicle=EgoVehicle(width=1.7))
    scene = world.reset(PlanSource(density=30.0).plan(0))
    data = pickle.dumps(scene)
    assert len(data) < 1_500 + 100 * scene.count
    there = subprocess.run([sys.executable, "-c", CHECK], input=data, capture_output=True, check=False)
    assert there.returncode == 0, there.stderr.decode()
    again: Scene = pickle.loads(there.stdout)
    assert again == scene
    assert again.route is scene.route
    assert again.network is world.network
    assert again.vehicle == EgoVehicle(width=1.7)


def test_nobody_writes_into_what_the_world_goes_on_with(world):
    scene = world.reset(PlanSource(origin="south", turn="left", density=15.0).plan(0))
    assert scene.count
    boxes = np.array([[5.0, 5.0, 0.0, 4.0, 2.0]])
    hidden = Sensors(occluders=boxes).perceive(scene, np.random.default_rng(0))
    arrays = [getattr(scene, name) for name in (*OF_OTHERS, "last_u")] + [hidden.hidden_by, hidden.last_u]
    for array in arrays:
        with pytest.raises(ValueError, match="read-only"):
            array[:] = 0
