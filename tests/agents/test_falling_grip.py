"""A dry road may become poor within a bend: how far off its line a car then comes, step by step."""

# ruff: noqa: F811 -- fixtures come by import
from dataclasses import replace

import numpy as np
import pytest

from rudc.agents.adaptation import FASTEST, LOST_M, POOREST, WIDE, Adaptation, _if_grip_falls
from rudc.env.tracking import steering
from rudc.network.network import load_network
from rudc.network.paths import SPACING
from rudc.vehicle import Actuation, EgoVehicle
from rudc.world.ego import DRY, GRAVITY, EgoPlant
from tests.world.conftest import four_way, make_scene  # noqa: F401 -- fixtures


def off_line(path, s, v, poorest=POOREST):
    """m that a car comes off the path within LOST_M from s on, if it turns as the path does, but with
    `poorest` m/s2 at most."""
    turned = beside = farthest = 0.0
    for x in np.arange(0.0, LOST_M, 0.05):
        bend = float(path.curvature_at(min(s + x, path.length)))
        turned += 0.05 * (bend - min(max(bend, -poorest / v**2), poorest / v**2))
        beside += 0.05 * turned
        farthest = max(farthest, abs(beside))
    return farthest


@pytest.mark.parametrize(
    ("network", "turn"), [("four_way", "left"), ("four_way", "right"), ("roundabout", "left")]
)
def test_the_speed_is_the_highest_with_which_it_stays_near_its_line(network, turn):
    network = load_network(network)
    path = network.route("south", turn).path
    fastest, bound = _if_grip_falls(path, POOREST), 0
    for i in range(0, len(fastest), 6):
        v = float(fastest[i])
        assert off_line(path, i * SPACING, v) < WIDE * 1.15
        if v < EgoVehicle().v_max:
            bound += 1
            assert off_line(path, i * SPACING, 1.1 * v) > WIDE
    assert bound > 2


def test_on_a_straight_road_nothing_is_lost(make_scene):
    assert _if_grip_falls(make_scene(turn="straight").route.path, POOREST).min() > 0.99 * FASTEST


@pytest.mark.parametrize(("friction", "least"), [(0.6, POOREST), (0.3, 1.75), (0.03, 0.25)])
def test_a_road_that_has_been_slippery_may_be_so_again(make_scene, friction, least):
    """held-out-45: foam on the approach, then more of it on the ring; on the dry stretch between the agents
    sped up to 8 m/s."""
    scene, adaptation = make_scene(turn="left"), Adaptation("known", probe=False)
    adaptation.reset(scene)
    fresh = adaptation._speeds(scene, DRY * GRAVITY, 0.0)
    for time_s, now in ((0.1, friction), (0.2, DRY)):
        adaptation.see(replace(scene, time_s=time_s, actuation=Actuation(friction=now)))
    speeds = adaptation._speeds(scene, DRY * GRAVITY, 0.0)
    tightest = int(np.argmax(np.abs(scene.route.path.curvature)))
    assert off_line(scene.route.path, tightest * SPACING, float(speeds[tightest]), least) < WIDE * 1.15
    assert (speeds <= fresh).all()
    assert (speeds.min() < 0.9 * fresh.min()) == (least < POOREST)
    assert speeds[0] > 25.0, "far from a bend it may do what it did"
    unfeared = adaptation._speeds(scene, DRY * GRAVITY, 0.0, feared=False)
    assert (unfeared >= fresh).all(), "who must go on looks at the grip that is known"
    assert unfeared.min() > 1.05 * fresh.min()
    adaptation.reset(scene)
    assert (adaptation._speeds(scene, DRY * GRAVITY, 0.0) == fresh).all(), "the next episode begins anew"


def test_it_is_never_faster_on_a_poorer_road(make_scene):
    scene = make_scene(turn="left")
    before = np.inf
    for friction in (DRY, 0.85, 0.8, 0.75, 0.7, 0.6, 0.45, 0.3):
        adaptation = Adaptation("known", probe=False)
        adaptation.reset(scene)
        adaptation.see(replace(scene, actuation=Actuation(friction=friction)))
        least = adaptation._speeds(scene, friction * GRAVITY, 0.0).min()
        assert least <= before, friction
        before = least


def driven(scene, expects):
    """m, the farthest that a car comes off its line where the friction falls to 0.45 one metre into its bend,
    and its least speed before that, m/s. `expects`: whether the outlook governs it.
    """
    adaptation, plant = Adaptation("known", probe=False), EgoPlant(scene.vehicle)
    adaptation.reset(scene)
    path, s, farthest, slowest = scene.route.path, scene.ego_s, 0.0, scene.ego.v
    begins = s + float(np.argmax(np.abs(path.curvature[int(s / SPACING) :]) > 0.05)) * SPACING + 1.0
    plant.resume(scene.ego, Actuation())
    for k in range(60):
        if s > begins:
            plant.resume(plant.state, Actuation(friction=0.45))
        else:
            slowest = min(slowest, plant.state.v)
        s, offset = path.project(plant.state.x, plant.state.y, s)
        now = replace(
            scene, ego=plant.state, ego_s=s, ego_offset=offset, time_s=0.1 * k, actuation=Actuation()
        )
        u = np.array([1.0, steering(now)])
        u = adaptation.govern(adaptation.see(now), u) if expects else u
        farthest = max(farthest, abs(offset))
        s += 0.1 * plant.step(float(u[0]), float(u[1]), 0.1).v
        if s > path.length - 10.0:
            break
    return farthest, slowest


def test_a_bend_whose_grip_vanishes_is_survived_by_who_expects_it(make_scene):
    scene = make_scene(turn="left", front=-25.0, v=9.0)
    off_line_expected, careful = driven(scene, expects=True)
    off_line_surprised, careless = driven(scene, expects=False)
    assert careful < careless
    assert off_line_expected < 2.0 < off_line_surprised
