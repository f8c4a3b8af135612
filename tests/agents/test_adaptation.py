"""What a command is bounded to: speed in bends, steering beside braking, and when brakes are asked for
all."""

# ruff: noqa: F811 -- fixtures come by import
import math
from dataclasses import replace

import numpy as np
import pytest

from rudc.agents.adaptation import BRAKING, FULL, USABLE, Adaptation
from rudc.network.paths import SPACING
from rudc.safety.plant import PlantEstimate
from rudc.vehicle import Actuation
from rudc.world.ego import DRY, GRAVITY, EgoPlant, widest_steering
from tests.world.conftest import four_way, make_scene  # noqa: F401 -- fixtures


def adapted(scene, friction=None):
    """An adaptation that knows the road, its probe done."""
    found = Adaptation("known", probe=False)
    found.reset(scene)
    actuation = Actuation(friction=friction)
    found.estimate = PlantEstimate(actuation, unusual=friction is not None)
    return found


def test_a_dry_bend_is_entered_no_faster_than_its_grip_allows(make_scene):
    """Driven by the plant along the path; uncontrolled it would ask for 1.8 times mu g."""
    scene = make_scene(turn="left", front=-30.0, v=13.0)
    adaptation, plant = adapted(scene), EgoPlant(scene.vehicle)
    plant.reset(scene.ego.x, scene.ego.y, scene.ego.psi, 13.0)
    path, s, most = scene.route.path, scene.ego_s, 0.0
    for _ in range(60):
        now = replace(scene, ego=plant.state, ego_s=s)
        u = adaptation.govern(now, np.array([1.0, 0.0]))
        most = max(most, plant.state.v**2 * abs(float(path.curvature[int(s / SPACING)])))
        before = plant.state
        plant.step(float(u[0]), 0.0, 0.1)
        s += 0.05 * (before.v + plant.state.v)
    assert 0.8 * USABLE < most / (DRY * GRAVITY) < 1.05


@pytest.mark.parametrize("friction", [None, 0.3])
def test_steering_leaves_the_brakes_their_share(make_scene, friction):
    scene = make_scene(turn="left", front=-40.0, v=11.0)
    grip = (friction or DRY) * GRAVITY
    a, delta = adapted(scene, friction).govern(scene, np.array([-6.0, scene.vehicle.delta_max]))
    left = math.sqrt(1.0 - BRAKING**2) * grip
    assert delta == pytest.approx(widest_steering(scene.vehicle, 11.0, left))
    plant = EgoPlant(scene.vehicle)
    plant.reset(0.0, 0.0, 0.0, 11.0, Actuation(friction=friction))
    slowed = 11.0 - plant.step(float(a), float(delta), 0.1).v
    plant.reset(0.0, 0.0, 0.0, 11.0, Actuation(friction=friction))
    unbounded = 11.0 - plant.step(float(a), scene.vehicle.delta_max, 0.1).v
    assert slowed > 0.9 * BRAKING * grip * 0.1 > unbounded


def test_brakes_that_are_asked_for_all_that_is_thought_to_be_there_are_asked_for_more(make_scene):
    """Else an estimate that is too low would never be found out."""
    scene = make_scene(turn="left", front=-30.0, v=8.0)
    adaptation = adapted(scene, 0.1)
    thought = -USABLE * 0.1 * GRAVITY
    assert adaptation.govern(scene, np.array([thought, 0.0]))[0] == scene.network.vehicle.a_min
    gentle, scene = 0.5 * FULL * thought, make_scene(turn="left", front=-60.0, v=3.0)
    assert adaptation.govern(scene, np.array([gentle, 0.0]))[0] == pytest.approx(gentle)
