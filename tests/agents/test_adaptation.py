"""What a command is bounded to: speed in bends, steering beside braking, and when brakes are asked for
all."""

# ruff: noqa: F811 -- fixtures come by import
import math
from dataclasses import replace

import numpy as np
import pytest

from rudc.agents.adaptation import BRAKING, FIRM, FULL, POOREST, USABLE, WARY, Adaptation, _if_grip_falls
from rudc.env.tracking import steering
from rudc.network.network import load_network
from rudc.network.paths import SPACING
from rudc.safety.plant import PlantEstimate, PlantMonitor
from rudc.vehicle import Actuation, EgoVehicle
from rudc.world.ego import DRY, GRAVITY, EgoPlant, widest_steering
from tests.world.conftest import four_way, make_scene  # noqa: F401 -- fixtures


def adapted(scene, friction=None, lag_s=0.0):
    """An adaptation that knows road and car, its probe done."""
    found = Adaptation("known", probe=False)
    found.reset(scene)
    actuation = Actuation(friction=friction, lag_s=lag_s)
    found.estimate = PlantEstimate(actuation, unusual=actuation != Actuation())
    return found


def most_in_bends(scene):
    """m/s2, across: the most that bends ask for of an ego that is driven along its path by the plant."""
    adaptation, plant = adapted(scene), EgoPlant(scene.vehicle)
    plant.reset(scene.ego.x, scene.ego.y, scene.ego.psi, scene.ego.v)
    path, s, most = scene.route.path, scene.ego_s, 0.0
    for _ in range(60):
        now = replace(scene, ego=plant.state, ego_s=s)
        u = adaptation.govern(now, np.array([1.0, 0.0]))
        most = max(most, plant.state.v**2 * abs(float(path.curvature[int(s / SPACING)])))
        before = plant.state
        plant.step(float(u[0]), 0.0, 0.1)
        s += 0.05 * (before.v + plant.state.v)
    return most


def test_a_dry_bend_is_entered_no_faster_than_its_grip_allows(make_scene):
    """Uncontrolled it would ask for 1.8 times mu g."""
    most = most_in_bends(make_scene(turn="left", front=-30.0, v=13.0))
    assert 0.6 < most / (DRY * GRAVITY) < USABLE, "less than it grips, as it may grip less within the bend"


def test_a_car_with_weak_brakes_is_slow_enough_for_its_bend(make_scene):
    """Braking of BRAKING mu g was assumed, 5.3 m/s2, of which this car has 3: it met the bend too fast."""
    network = load_network("four_way", vehicle=EgoVehicle(a_min=-3.0))
    scene = make_scene(turn="left", front=-40.0, v=14.0, network=network, vehicle=network.vehicle)
    assert most_in_bends(scene) / (DRY * GRAVITY) < 1.05


@pytest.mark.parametrize("friction", [None, 0.3])
def test_steering_leaves_the_brakes_their_share(make_scene, friction):
    scene = make_scene(turn="left", front=-40.0, v=11.0)
    grip = (friction or DRY) * GRAVITY
    a, delta = adapted(scene, friction).govern(scene, np.array([-6.0, scene.vehicle.delta_max]))
    left = math.sqrt(1.0 - BRAKING**2) * grip * (FIRM if friction else 1.0)
    assert delta == pytest.approx(widest_steering(scene.vehicle, 11.0, left))
    plant = EgoPlant(scene.vehicle)
    plant.reset(0.0, 0.0, 0.0, 11.0, Actuation(friction=friction))
    slowed = 11.0 - plant.step(float(a), float(delta), 0.1).v
    plant.reset(0.0, 0.0, 0.0, 11.0, Actuation(friction=friction))
    unbounded = 11.0 - plant.step(float(a), scene.vehicle.delta_max, 0.1).v
    assert slowed > 0.9 * BRAKING * grip * 0.1 > unbounded


def test_a_car_that_brakes_harder_than_a_dry_road_lets_it_is_known_to(make_scene, monkeypatch):
    """Without a coefficient of friction the plant took that of a dry road, and the estimate no limit."""
    scene = make_scene(turn="left", front=-40.0, v=11.0)
    body = replace(scene.vehicle, a_min=-12.0)
    late = PlantEstimate(Actuation(lag_s=0.1), unusual=True)
    adaptation = adapted(scene, lag_s=0.1)
    monkeypatch.setattr(PlantMonitor, "update", lambda *_: late)
    seen = adaptation.see(replace(scene, vehicle=body, actuation=late.actuation))
    plant = EgoPlant(body)
    plant.reset(0.0, 0.0, 0.0, 11.0)
    assert late.grip == pytest.approx(-plant.step(-12.0, 0.0, 0.1).acceleration)
    assert seen.vehicle.a_min == pytest.approx(-USABLE * late.grip)


def test_brakes_that_are_asked_for_all_that_is_thought_to_be_there_are_asked_for_more(make_scene):
    """Else an estimate that is too low would never be found out."""
    scene = make_scene(turn="left", front=-30.0, v=8.0)
    adaptation = adapted(scene, 0.1)
    thought = -USABLE * 0.1 * GRAVITY
    assert adaptation.govern(scene, np.array([thought, 0.0]))[0] == scene.network.vehicle.a_min
    gentle, scene = 0.5 * FULL * thought, make_scene(turn="left", front=-60.0, v=3.0)
    assert adaptation.govern(scene, np.array([gentle, 0.0]))[0] == pytest.approx(gentle)


@pytest.mark.parametrize("lag_s", [0.05, 0.2, 0.4])
@pytest.mark.parametrize("now", [0.0, 0.08])
@pytest.mark.parametrize("decision_s", [0.1, 0.3])
def test_lagging_wheels_are_where_they_were_wanted_after_a_decision(make_scene, lag_s, now, decision_s):
    """However long a decision is: it was taken to last 0.1 s, so that wheels went far beyond."""
    scene = make_scene(turn="left", front=-40.0, v=5.0)
    adaptation = adapted(scene, lag_s=lag_s)
    known = adaptation.estimate
    for k in range(2):
        scene = replace(scene, time_s=k * decision_s, ego=replace(scene.ego, steering=now))
        adaptation.see(scene)
    adaptation.estimate = known
    u = adaptation.govern(scene, np.array([0.0, 0.05]))
    plant = EgoPlant(scene.vehicle)
    plant.resume(scene.ego, Actuation(lag_s=lag_s))
    assert plant.step(*u.tolist(), decision_s).steering == pytest.approx(0.05)


def test_a_bend_is_followed_with_late_wheels_as_with_prompt_ones(make_scene):
    """Left at 6.3 m/s with a lag of 0.3 s: without haste the car gets off its path."""
    farthest = {}
    for name, lag_s, haste in ("prompt", 0.0, True), ("late", 0.3, False), ("hastened", 0.3, True):
        scene = make_scene(turn="left", front=-12.0, v=6.3)
        adaptation, plant = adapted(scene, lag_s=lag_s), EgoPlant(scene.vehicle)
        plant.resume(scene.ego, Actuation(lag_s=lag_s))
        path, s, most = scene.route.path, scene.ego_s, 0.0
        for _ in range(45):
            s, offset = path.project(plant.state.x, plant.state.y, s)
            now = replace(scene, ego=plant.state, ego_s=s, ego_offset=offset)
            wanted = np.array([0.0, steering(now)])
            u = adaptation.govern(now, wanted) if haste else wanted
            most = max(most, abs(offset))
            s += 0.1 * plant.step(0.0, float(u[1]), 0.1).v
        farthest[name] = most
    assert farthest["hastened"] < farthest["prompt"] + 0.05 < 0.5 * farthest["late"]


@pytest.mark.parametrize("lag_s", [0.0, 0.5, 1.0, 2.0, 3.0])
@pytest.mark.parametrize("turn", ["south", "west"])
def test_wheels_however_late_can_follow_the_path_at_the_speed_of_the_bends(scene_on, lag_s, turn):
    """In and out of a roundabout: at the speed of prompt wheels, a lag of 1 s takes the car off the road."""
    scene = scene_on("north", turn, 90.0, 5.0, network_name="roundabout")
    adaptation, plant = adapted(scene, lag_s=lag_s), EgoPlant(scene.vehicle)
    path, s, farthest = scene.route.path, scene.ego_s, 0.0
    profile = adaptation._speeds(scene, DRY * GRAVITY, lag_s)
    plant.resume(scene.ego, Actuation(lag_s=lag_s))
    while s < scene.route.exit_s + 15.0:
        v = min(profile[int(s / SPACING)], plant.state.v + 0.2)
        plant.resume(replace(plant.state, v=float(v)), plant.actuation)
        s, offset = path.project(plant.state.x, plant.state.y, s)
        now = replace(scene, ego=plant.state, ego_s=s, ego_offset=offset)
        u = adaptation.govern(now, np.array([0.0, steering(now)]))
        farthest = max(farthest, abs(offset))
        s += 0.1 * plant.step(0.0, float(u[1]), 0.1).v
    assert farthest < 0.6


@pytest.mark.parametrize(
    ("late_s", "lag_s", "share"), [(2.0, 0.6, WARY), (0.3, 0.6, USABLE), (2.0, 0.1, USABLE)]
)
def test_a_car_that_was_late_for_long_is_not_trusted_in_bends_any_more(make_scene, late_s, lag_s, share):
    scene = make_scene(turn="left", front=-2.0, v=0.0)
    adaptation = Adaptation("known", probe=False)
    adaptation.reset(scene)
    for k in range(30):
        lag = Actuation(lag_s=lag_s) if 5 <= k < 5 + round(10 * late_s) else Actuation()
        adaptation.see(replace(scene, time_s=0.1 * k, actuation=lag))
    tightest = float(np.abs(scene.route.path.curvature).max())
    profile = adaptation._speeds(scene, DRY * GRAVITY, 0.0)
    falls = _if_grip_falls(scene.route.path, POOREST).min()
    assert profile.min() == pytest.approx(min(math.sqrt(share * DRY * GRAVITY / tightest), falls))
    assert (profile.min() < falls - 0.1) == (share == WARY)
