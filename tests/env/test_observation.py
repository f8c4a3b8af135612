"""The paper's observation: against a plain restatement, its frames, padding, spaces."""

import dataclasses
import math

import numpy as np
import pytest

from rudc.env.distances import measure
from rudc.env.observation import (
    LIMIT,
    PARTS,
    observation_size,
    observation_space,
    observe_flat,
    unflatten,
)
from rudc.errors import InputError
from rudc.geometry import rectangle_corners
from rudc.world.scene import EgoState


def observe(scene, kind, distances=None):
    """The observation's parts by name."""
    return unflatten(observe_flat(scene, kind, distances), kind)


def flatten(parts):
    """One array from the parts."""
    return np.concatenate([parts[name].ravel() for name in PARTS if name in parts])


def restated(scene):
    """The paper's observation, number by number."""
    ego, centre, turn = scene.ego, scene.network.center, -scene.route.canonical_angle

    def rotated(x, y, angle):
        return x * math.cos(angle) - y * math.sin(angle), x * math.sin(angle) + y * math.cos(angle)

    def wrapped(angle, most):
        while angle > most:
            angle -= 2 * math.pi
        while angle <= most - 2 * math.pi:
            angle += 2 * math.pi
        return angle

    x, y = rotated(ego.x - centre[0], ego.y - centre[1], turn)
    d = measure(scene)
    numbers = [1, x / 50, y / 50, ego.v * math.cos(ego.slip) / 10, ego.v * math.sin(ego.slip) / 10]
    numbers += [wrapped(ego.psi + turn, 1.5 * math.pi) / math.pi, ego.yaw_rate]
    numbers += [d.vehicle_m / 20, d.road_m / 5, d.destination_m / 50]
    vx, vy = ego.v * math.cos(ego.psi + ego.slip), ego.v * math.sin(ego.psi + ego.slip)
    for k in range(12):
        if k >= scene.count:
            numbers += [0] * 6
            continue
        dx, dy = rotated(scene.position[k, 0] - ego.x, scene.position[k, 1] - ego.y, -ego.psi)
        dvx, dvy = rotated(scene.velocity[k, 0] - vx, scene.velocity[k, 1] - vy, -ego.psi)
        numbers += [
            1,
            dx / 50,
            dy / 50,
            dvx / 10,
            dvy / 10,
            wrapped(scene.heading[k] - ego.psi, 1.25 * math.pi) / math.pi,
        ]
    for k in range(1, 11):
        px, py, _ = scene.route.path.pose(scene.ego_s + 3 * k)
        dx, dy = rotated(float(px) - ego.x, float(py) - ego.y, -ego.psi)
        numbers += [dx / 30, dy / 30]
    return np.array(numbers + [float(scene.route.task == k) for k in range(3)])


@pytest.mark.parametrize("seed", range(30))
def test_paper_observation_is_what_it_says(make_scene, random_others, seed):
    rng = np.random.default_rng(seed)
    scene = make_scene(
        origin=str(rng.choice(["south", "east", "north", "west"])),
        turn=str(rng.choice(["left", "straight", "right"])),
        s=float(rng.uniform(5, 170)),
        offset=float(rng.uniform(-2, 2)),
        turned=float(rng.uniform(-7, 7)),
        others=random_others(rng, int(rng.integers(0, 25))),
    )
    ego = dataclasses.replace(scene.ego, slip=0.05, yaw_rate=float(rng.uniform(-1, 1)))
    scene = dataclasses.replace(scene, ego=ego)
    expected = np.clip(restated(scene), -LIMIT, LIMIT)
    np.testing.assert_allclose(observe_flat(scene, "paper"), expected, atol=2e-5)
    np.testing.assert_array_equal(observe_flat(scene, "conflict")[:105], observe_flat(scene, "paper"))


@pytest.mark.parametrize("turn", ["left", "straight", "right"])
def test_the_same_situation_looks_the_same_from_the_opposite_arm(make_scene, network, row_of, turn):
    opposite = {"south": "north", "north": "south", "east": "west", "west": "east"}
    ways = [("west", "east", 110.0), ("north", "south", 95.0), ("east", "south", 118.0)]
    south = make_scene("south", turn, s=100.0, others=[(row_of(a, b), s, 7.0, -1.0) for a, b, s in ways])
    north = make_scene(
        "north", turn, s=100.0, others=[(row_of(opposite[a], opposite[b]), s, 7.0, -1.0) for a, b, s in ways]
    )
    np.testing.assert_allclose(observe_flat(south, "conflict"), observe_flat(north, "conflict"), atol=0.02)


@pytest.mark.parametrize("kind", ["paper", "conflict"])
def test_spaces_and_parts(make_scene, random_others, kind):
    scene = make_scene(others=random_others(np.random.default_rng(0), 20))
    flat, parts = observe_flat(scene, kind), observe(scene, kind)
    assert flat.dtype == np.float32
    assert flat.shape == (observation_size(kind),) == ({"paper": 105, "conflict": 146}[kind],)
    assert flat in observation_space(kind)
    assert parts in observation_space(kind, as_dict=True)
    assert {name: part.shape for name, part in parts.items()} == {name: PARTS[name] for name in parts}
    np.testing.assert_array_equal(flatten(parts), flat)
    np.testing.assert_array_equal(flatten(unflatten(flat, kind)), flat)


def test_absent_vehicles_are_zero_and_alone_is_far(make_scene, random_others):
    few = observe(make_scene(others=random_others(np.random.default_rng(1), 3)), "paper")
    assert few["others"][:3, 0].tolist() == [1, 1, 1]
    assert not few["others"][3:].any()
    alone = observe(make_scene(), "paper")
    assert not alone["others"].any()
    assert alone["ego"][7] == LIMIT


def test_stays_within_its_space_far_away_and_at_the_ends_of_the_path(make_scene, random_others):
    for s in (-3.0, 0.0, 260.0, 400.0):
        scene = make_scene(s=s, others=random_others(np.random.default_rng(2), 5))
        far = dataclasses.replace(scene, ego=EgoState(5e3, -5e3, 1.0, 90.0, 0.3, 9.0, 0.0, 0.0))
        for shown in (scene, far):
            assert observe_flat(shown, "conflict") in observation_space("conflict")


def test_distances(make_scene, network, row_of):
    scene = make_scene("south", "straight", s=100.0, others=[(13, 88.0, 5.0, 0.0)])
    d = measure(scene)
    assert d.vehicle_m == pytest.approx(12.0 - 5.0, abs=0.05)  # same lane, 12 m between centres
    assert d.road_m == pytest.approx(1.75, abs=0.05)  # the middle of the outer lane
    assert d.destination_m == pytest.approx(scene.route.exit_s + 20.0 - 100.0)
    beyond = dataclasses.replace(scene, destination_s=math.inf)
    assert measure(beyond).destination_m == pytest.approx(scene.route.length - 100.0)
    corners = rectangle_corners(scene.position, scene.heading, scene.size)
    assert corners.shape == (1, 4, 2)
    off = make_scene("south", "straight", s=60.0, offset=-4.0)
    assert measure(off).road_m < 0


def test_unknown_kind_is_refused():
    with pytest.raises(InputError, match="paper, conflict"):
        observation_space("papers")


def test_distances_given_are_used(make_scene):
    scene = make_scene()
    given = measure(scene)._replace(road_m=4.0)
    assert observe(scene, "paper", given)["ego"][8] == pytest.approx(0.8)
