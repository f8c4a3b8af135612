"""Reward terms and cost against the paper's formulas, written out by hand."""

import dataclasses
import math

import numpy as np
import pytest

from rudc.env.distances import Distances, measure
from rudc.env.reward import reward_terms, step_cost

TERMS = ("collision", "rule_violation", "arrive_goal", "reference", "action", "progress", "safe")
FAR = Distances(50.0, 5.0, 0.0)
CALM = {"collided": False, "broke_rule": False, "arrived": False}


def terms(scene, distances=FAR, before=None, **ended):
    result = reward_terms(before or scene, scene, distances, **(CALM | ended))
    assert tuple(result) == TERMS
    return result


def test_on_the_line_at_the_limit_with_nothing_near_earns_one(make_scene):
    scene = make_scene("south", "straight", s=60.0, v=10.0)
    result = terms(scene)
    assert result["reference"] == pytest.approx(1.0, abs=1e-4)
    assert sum(result.values()) == pytest.approx(1.0, abs=1e-4)


@pytest.mark.parametrize(("offset", "v", "turned"), [(1.0, 10.0, 0.0), (-0.5, 4.0, 0.2), (0.0, 0.0, -0.4)])
def test_reference_term(make_scene, offset, v, turned):
    scene = make_scene("south", "straight", s=60.0, v=v, offset=offset, turned=turned)
    ego = dataclasses.replace(scene.ego, slip=0.1, yaw_rate=0.3)
    scene = dataclasses.replace(scene, ego=ego, route=dataclasses.replace(scene.route, alternatives=()))
    error = 400 * (offset / 100) ** 2 + 30 * ((10 - v * math.cos(0.1)) / 20) ** 2
    error += 30 * (v * math.sin(0.1) / 20) ** 2 + 2 * turned**2 + 0.5 * 0.3**2
    assert terms(scene)["reference"] == pytest.approx(1 / (1 + error), rel=1e-3)


@pytest.mark.parametrize(("s", "wanted"), [(60.0, 15.0), (180.0, 5.0)])
def test_the_speed_asked_for_is_the_limit_there_or_what_the_car_can_do(make_scene, s, wanted):
    """It was the limit before the junction to the very end, and more than the car's 15 m/s."""
    for v, reached in ((wanted, 1.0), (10.0, 1 / (1 + 30 * ((wanted - 10.0) / 20) ** 2))):
        scene = make_scene("south", "straight", s=s, v=v)
        limits = (-np.inf, 25.0), (scene.route.exit_s, 5.0)
        route = dataclasses.replace(scene.route, limits=limits)
        scene = dataclasses.replace(scene, route=route)
        assert terms(scene)["reference"] == pytest.approx(reached, abs=1e-4)


def test_the_better_reference_line_counts(make_scene):
    scene = make_scene("south", "left", s=170.0, v=10.0)
    route = scene.route
    other = route.alternatives[0]
    x, y, _ = (float(value) for value in route.path.pose(170.0))
    _, beside = other.project(x, y, 170.0)
    assert 3.0 < abs(beside) < 4.0  # the other outbound lane
    there = make_scene("south", "left", s=170.0, v=10.0, offset=-beside)
    assert terms(there)["reference"] == pytest.approx(1.0, abs=1e-2)
    alone = dataclasses.replace(there, route=dataclasses.replace(route, alternatives=()))
    assert terms(alone)["reference"] == pytest.approx(1 / (1 + 0.04 * beside**2), abs=1e-2)


def test_action_term_is_of_the_applied_action_and_its_change(make_scene):
    before = make_scene(last_u=np.array([3.0, 0.0]))
    after = make_scene(last_u=np.array([-6.0, 0.3]))
    a, delta, da, ddelta = -1.0, 0.5, -1.5, 0.5
    effort = 0.05 * a**2 + 0.02 * delta**2 + 0.2 * da**2 + 0.3 * ddelta**2
    assert terms(after, before=before)["action"] == pytest.approx(-effort / 3)
    assert terms(before)["action"] == pytest.approx(-0.05 * 0.25 / 3)
    assert terms(make_scene())["action"] == 0.0


def test_progress_term(make_scene):
    scene = make_scene()
    assert terms(scene, FAR._replace(destination_m=60.0))["progress"] == pytest.approx(-0.02 * 36 / 3)


@pytest.mark.parametrize(
    ("gap", "value"),
    [(math.inf, 0), (2.01, 0), (2.0, 0), (1.5, -0.5), (0.51, -1.49), (0.5, -1.5), (0.0, -3.0)],
)
def test_safe_term(make_scene, gap, value):
    assert terms(make_scene(), FAR._replace(vehicle_m=gap))["safe"] == pytest.approx(value / 3)


def test_ends(make_scene):
    scene = make_scene()
    assert terms(scene, collided=True)["collision"] == -50.0
    assert terms(scene, broke_rule=True)["rule_violation"] == -50.0
    assert terms(scene, arrived=True)["arrive_goal"] == 50.0
    calm = terms(scene)
    assert calm["collision"] == calm["rule_violation"] == calm["arrive_goal"] == 0.0


@pytest.mark.parametrize(
    ("vehicle", "road", "closeness"),
    [(50.0, 5.0, 0.0), (2.0, 5.0, 0.125), (1.0, 3.0, 0.5), (0.0, -1.0, 1.0), (math.inf, 1.75, 0.1953125)],
)
def test_cost(vehicle, road, closeness):
    distances = Distances(vehicle, road, 10.0)
    assert step_cost(distances, collided=False, broke_rule=False) == pytest.approx(closeness)
    assert step_cost(distances, collided=True, broke_rule=False) == pytest.approx(closeness + 5)
    assert step_cost(distances, collided=True, broke_rule=True) == pytest.approx(closeness + 10)


def test_waiting_at_the_line_all_episode_is_better_than_a_collision(make_scene, network):
    route = network.route("south", "left")
    moving, waiting = (make_scene(s=route.stop_line_s - 2.5, v=v) for v in (8.0, 0.0))
    earned = [sum(terms(scene, measure(scene)).values()) for scene in (moving, waiting)]
    assert earned[0] > earned[1] > -50.0 / 400
