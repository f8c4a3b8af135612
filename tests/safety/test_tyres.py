"""A stop that the last resort takes to be possible is one that the tyres give, beside any steering."""

import math

import numpy as np
import pytest

from rudc.geometry import rectangle_gaps
from rudc.safety.filter import FilterConfig
from rudc.safety.last_resort import LastResort
from rudc.safety.tyres import STEERS, USABLE, tyres_of
from rudc.vehicle import Actuation, EgoVehicle
from rudc.world.ego import DRY, GRAVITY, EgoPlant
from rudc.world.kernels import slip_of, within_friction
from tests.safety.scenes import Other, make_scene

DT = 0.1


def least_gap(scene, u, friction):
    """m, least gap of a car that takes the action `u` for a step and then brakes fully, its steering held as
    hard as the last resort holds it."""
    plant, body = EgoPlant(scene.vehicle), scene.vehicle
    plant.reset(scene.ego.x, scene.ego.y, scene.ego.psi, scene.ego.v, Actuation(friction=friction))
    tyres, gaps, command, hardest = tyres_of(scene), [], u, scene.vehicle.a_min
    for k in range(200):
        for _ in range(2):
            plant.step(float(command[0]), float(command[1]), 0.5 * DT)
            ego = plant.state
            gaps.append(
                rectangle_gaps(
                    ego.x, ego.y, ego.psi, body.length, body.width, scene.position, scene.heading, scene.size
                ).min()
            )
        if k == 0:
            command = hardest, tyres.firm(float(u[1]), ego.v)
        if ego.v == 0.0:
            return float(min(gaps))
    raise AssertionError("it never stands")


@pytest.mark.parametrize("a_min", [-6.0, -3.0])
@pytest.mark.parametrize("friction", [None, 0.8, 0.7, 0.5, 0.25])
def test_a_stop_that_is_possible_is_possible(friction, a_min):
    """One steered into a bend at 15 m/s was taken to brake fully, and did not brake at all."""
    rng, judge = np.random.default_rng(5), LastResort(FilterConfig())
    grip = math.inf if friction is None else friction * GRAVITY
    vehicle = EgoVehicle(a_min=max(a_min, -USABLE * grip))
    possible = steered = 0
    for _ in range(600):
        places = rng.uniform(2.0, 30.0), rng.uniform(-6.0, 6.0), rng.uniform(-3.0, 3.0)
        body = Other(*places, 0.0, rng.choice([1.8, 5.0, 12.0]), rng.choice([0.4, 1.8, 2.5]))
        scene = make_scene([body], v=rng.uniform(3.0, 15.0), vehicle=vehicle, grip=grip)
        u = np.array([rng.uniform(vehicle.a_min, 3.0), rng.uniform(-0.3, 0.3)])
        if judge.instead_of(scene, u) is not None:
            continue
        made = judge._tyres.made_of(u, scene.ego.v)
        if judge._room_to_stop(scene, *judge._first(scene, made[0]), made) < 0.0:
            continue  # it is another manoeuvre that has room
        possible += 1
        steered += abs(u[1]) > abs(tyres_of(scene).firm(u[1], scene.ego.v))
        assert least_gap(scene, u, friction) > 0.0
    assert possible > 150
    assert steered > 30, "the tyres do not give the steering that was asked for beside full braking"


def test_a_stop_is_not_taken_to_be_possible_where_steering_leaves_no_brakes():
    """It was taken to leave 1.5 m."""
    others = [Other(14.2, -2.6, -0.65, 0.0, 12.0, 2.5), Other(16.6, 0.7, -2.24, 0.0, 1.8, 2.5)]
    scene, u, judge = make_scene(others, v=15.0), np.array([-3.479, -0.186]), LastResort(FilterConfig())
    judge.instead_of(scene, u)
    made = judge._tyres.made_of(u, 15.0)
    assert made[0] == pytest.approx(0.0)
    assert judge._room_to_stop(scene, *judge._first(scene, made[0]), made) < 0.0
    assert least_gap(scene, u, None) == 0.0


def test_on_a_dry_road_full_braking_is_left_beside_the_hardest_steering_of_a_stop():
    tyres, body = tyres_of(make_scene()), EgoVehicle()
    assert tyres.least == tyres.braking == 6.0
    for v in (5.0, 10.0, 15.0):
        firm, brakes = tyres.stop(0.6, v)
        bend = math.sin(slip_of(firm, body.wheelbase, body.cg_to_rear)) / body.cg_to_rear
        assert brakes == 6.0
        assert firm == 0.6 or v * v * bend == pytest.approx(STEERS * DRY * GRAVITY)


def test_on_a_poor_road_steering_takes_its_share():
    tyres = tyres_of(make_scene(vehicle=EgoVehicle(a_min=-USABLE * 2.0), grip=2.0))
    assert tyres.grip == pytest.approx(2.0)
    assert tyres.beside(0.0, 8.0) == pytest.approx(1.8)
    assert (
        tyres.beside(1.0, 8.0)
        == pytest.approx(2.0 * math.sqrt(1.0 - STEERS**2))
        == pytest.approx(tyres.least)
    )


def test_brakes_that_are_better_than_the_road_stop_as_the_road_lets_them():
    strong = EgoVehicle(a_min=-12.0)
    tyres = tyres_of(make_scene(vehicle=strong))
    assert tyres.braking == pytest.approx(USABLE * DRY * GRAVITY)


def test_nothing_is_cut_that_the_tyres_give():
    rng, tyres, body = np.random.default_rng(2), tyres_of(make_scene()), EgoVehicle()
    cut = 0
    for _ in range(500):
        v, u = rng.uniform(0.0, 15.0), np.array([rng.uniform(-6.0, 3.0), rng.uniform(-0.6, 0.6)])
        wanted = within_friction(*u, v, tyres.grip, body.delta_max, body.wheelbase, body.cg_to_rear)
        assert tyres.made_of(u, v).tolist() == pytest.approx(wanted)
        cut += not np.array_equal(tyres.made_of(u, v), u)
        firm, brakes = tyres.stop(u[1], v)
        assert within_friction(-brakes, firm, v, tyres.grip, body.delta_max, body.wheelbase,
                               body.cg_to_rear) == pytest.approx((-brakes, firm))  # fmt: skip
    assert 100 < cut < 400
