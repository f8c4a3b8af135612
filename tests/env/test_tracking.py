"""Path following: every route of every shipped network is driven on the real plant."""

import math
from dataclasses import replace

import numpy as np
import pytest

from rudc.env.tracking import (
    CALM_S,
    LATERAL,
    RETURN_S,
    acceleration_towards,
    speed_allowed,
    speeds_in_bends,
    steering,
)
from rudc.geometry import Rectangles
from rudc.network.course import CoursePlanner
from rudc.network.network import load_network, shipped_networks
from rudc.vehicle import Actuation, EgoVehicle
from rudc.world.ego import EgoPlant


def _drive(scene_on, network_name, origin, towards, start_offset=0.0, cruise=8.0):
    """Largest |offset| after the first 10 m, and largest lateral acceleration, of a drive along a route."""
    route = load_network(network_name).route(origin, towards)
    profile = speeds_in_bends(route.path)
    plant = EgoPlant(EgoVehicle())
    s = 60.0
    x, y, psi = (float(v) for v in route.path.pose(s))
    plant.reset(x - start_offset * math.sin(psi), y + start_offset * math.cos(psi), psi, cruise)
    worst = lateral = 0.0
    while s < min(route.exit_s + 25.0, route.length - 5.0):
        state = plant.state
        s, offset = route.path.project(state.x, state.y, s)
        scene = scene_on(origin, towards, s, state.v, network_name=network_name, offset=offset, state=state)
        a = acceleration_towards(speed_allowed(scene, profile, cruise), scene, 2.0)
        delta = steering(scene)
        plant.step(a, delta, 0.05)
        plant.step(a, delta, 0.05)
        if s > 70.0 or start_offset == 0.0:
            worst = max(worst, abs(offset))
        lateral = max(lateral, abs(plant.state.v * plant.state.yaw_rate))
    return worst, lateral


@pytest.mark.parametrize("name", shipped_networks())
def test_keeps_to_every_route_of_the_shipped_networks(name, scene_on):
    for movement in load_network(name).movements:
        if movement.turn == "u_turn":
            continue
        worst, lateral = _drive(scene_on, name, movement.origin, movement.destination)
        assert worst < 0.4, (movement, worst)
        assert lateral < 1.6 * LATERAL, (movement, lateral)


@pytest.mark.parametrize("offset", [-1.5, -0.5, 0.7, 1.5])
def test_comes_back_to_the_path_without_swinging(scene_on, offset):
    route = load_network("four_way").route("south", "straight")
    plant = EgoPlant(EgoVehicle())
    s = 20.0
    x, y, psi = (float(v) for v in route.path.pose(s))
    plant.reset(x - offset * math.sin(psi), y + offset * math.cos(psi), psi, 8.0)
    offsets = []
    for _ in range(60):
        state = plant.state
        s, now = route.path.project(state.x, state.y, s)
        offsets.append(now)
        delta = steering(scene_on("south", "straight", s, state.v, offset=now, state=state))
        plant.step(0.0, delta, 0.05)
        plant.step(0.0, delta, 0.05)
    assert abs(offsets[-1]) < 0.02
    assert min(np.array(offsets) * np.sign(offset)) > -0.15 * abs(offset)


@pytest.mark.parametrize(("return_s", "swings"), [(CALM_S, False), (RETURN_S, True)])
def test_a_calm_driver_does_not_swing_with_actuators_that_are_late(scene_on, return_s, swings):
    """At 4 m/s, with 0.3 s of delay and a lag of 0.2 s, as in sluggish_actuators."""
    route = load_network("four_way").route("south", "straight")
    plant, s, offsets = EgoPlant(EgoVehicle()), 20.0, []
    x, y, psi = (float(v) for v in route.path.pose(s))
    plant.reset(x - 0.3, y, psi, 4.0, Actuation(0.3, 0.2))
    for _ in range(120):
        s, now = route.path.project(plant.state.x, plant.state.y, s)
        offsets.append(now)
        scene = scene_on("south", "straight", s, plant.state.v, offset=now, state=plant.state)
        delta = steering(scene, return_s)
        for _ in range(2):
            plant.step(0.0, delta, 0.05)
    assert (max(np.abs(offsets[90:])) > 0.1) == swings


def test_speeds_in_bends_can_be_braked_to_and_respect_lateral_acceleration():
    path = load_network("four_way").route("south", "left").path
    speeds = speeds_in_bends(path)
    assert np.all(speeds**2 * np.abs(path.curvature) <= LATERAL + 1e-9)
    assert np.all(np.diff(speeds**2) >= -2 * 2.0 * 0.5 - 1e-9)
    assert speeds[0] > speeds.min() > 3.0


def test_acceleration_is_limited_both_ways(scene_on):
    scene = scene_on("south", "straight", 50.0, 8.0)
    assert acceleration_towards(20.0, scene, 2.0) == 2.0
    assert acceleration_towards(0.0, scene, 2.0) == scene.vehicle.a_min
    assert acceleration_towards(8.0, scene, 2.0) == 0.0


def test_pulls_out_on_its_course_at_walking_pace(scene_on):
    """Full lock to one side and back within a few metres: the slip changes by much, and at once."""
    network, body = load_network("four_way"), EgoVehicle()
    route = network.route("south", "straight")
    x, y, psi = (float(v) for v in route.path.pose(60.0))
    blocking = Rectangles(*(np.array([v]) for v in ((x, y + 8.0), psi, (body.length, body.width))))
    outs = CoursePlanner(network, route, body).pull_outs(x, y, psi, blocking, 0.25)
    path = next(out for out in outs if out is not None).path
    plant = EgoPlant(body)
    plant.reset(x, y, psi, 0.0)
    offsets = []
    for _ in range(100):
        s, now = path.project(plant.state.x, plant.state.y)
        offsets.append(now)
        scene = scene_on("south", "straight", s, plant.state.v, offset=now, state=plant.state)
        delta = steering(replace(scene, route=replace(route, path=path)))
        for _ in range(2):
            plant.step(min(2.0, (1.5 - plant.state.v) / 0.4), delta, 0.05)
    assert max(np.abs(offsets)) < 0.1
