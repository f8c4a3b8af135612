"""Vehicles that SUMO drives slow down for bends as the road's grip asks."""

from dataclasses import replace

import numpy as np
import pytest

from rudc.network.network import load_network
from rudc.world.bends import SHARE, Bends, curvatures
from rudc.world.ego import DRY, GRAVITY
from rudc.world.world import World
from tests.plans import PlanSource, event
from tests.world.networks import bent

WATCHES = PlanSource(density=25.0, speed=(0.0, 0.0))
"""the ego stands on its arm"""


class Lanes:
    """Takes the limits down."""

    def __init__(self):
        self.limits = {}

    def limit_lane(self, name, speed):
        self.limits[name] = speed


@pytest.mark.parametrize("name", ["four_way", "roundabout", "skewed_four_way"])
def test_nobody_takes_a_bend_faster_than_the_road_allows(name):
    """Measured at front bumpers: SUMO lets a vehicle accelerate as soon as its front has left a bend."""
    network = load_network(name)
    paths, most = network.paths, {}
    for friction in (None, 0.2):
        ice = (event("low_friction", friction=friction),) if friction else ()
        plan = replace(WATCHES, density=25.0, origin=network.arms[0].name, events=ice)
        with World(network) as world:
            scenes = [world.reset(plan.plan(0))]
            for _ in range(200):
                world.advance(np.array([-6.0, 0.0]))
                scenes.append(world.scene())
        sideways = []
        for scene in scenes[50:]:
            rows = np.flatnonzero(scene.path >= 0)
            front = scene.path_s[rows] + 0.5 * scene.size[rows, 0]
            ends = (paths.pose(scene.path[rows], front + off)[2] for off in (2.0, -2.0))
            bend = np.abs(np.subtract(*ends)) / 4.0
            sideways += (bend * (scene.velocity[rows] ** 2).sum(axis=1)).tolist()
        most[friction] = max(sideways)
    assert 4.0 < most[None] < DRY * GRAVITY
    assert 0.5 < most[0.2] < 0.2 * GRAVITY


def test_only_bends_have_a_lower_limit_and_the_more_slippery_the_lower(tmp_path):
    network, lanes = load_network(bent(tmp_path)), Lanes()
    bends = Bends(lanes, network)
    bends.slow(0.1 * GRAVITY)
    limits = dict(lanes.limits)
    assert {"north_in_0", "north_out_0"} < limits.keys(), "this arm bends 30 m out"
    assert not {"south_in_0", "east_out_0"} & limits.keys()
    for name, limit in limits.items():
        assert limit**2 * curvatures(network)[name] == pytest.approx(SHARE * 0.1 * GRAVITY)
    assert bends.edge_limit("north_in") == limits["north_in_0"]
    assert bends.edge_limit("south_in") == network.lanes["south_in_0"].speed
    bends.slow(100.0)
    for name, limit in lanes.limits.items():
        tight = SHARE * DRY * GRAVITY / curvatures(network)[name]
        assert limit == pytest.approx(min(network.lanes[name].speed, tight**0.5))
    assert lanes.limits["north_in_0"] < network.lanes["north_in_0"].speed, "this bend is tight"


def test_an_ego_starts_on_an_icy_bend(tmp_path):
    """SUMO refuses whoever would begin faster than a lane's limit."""
    ice = event("low_friction", friction=0.1)
    plan = PlanSource(density=20.0, speed=(12.0, 12.0), distance=(40.0, 40.0), origin="north", events=(ice,))
    for driver in ("agent", "sumo"):
        with World(load_network(bent(tmp_path))) as world:
            scene = world.reset(plan.plan(0), ego_driver=driver)
            assert scene.ego.v > 0.0


def test_who_is_about_to_enter_does_so_before_its_road_becomes_slow(tmp_path):
    """SUMO ends the simulation over a vehicle that was asked for with more than its lane's limit."""
    network = load_network(bent(tmp_path))
    plan = replace(WATCHES, density=40.0, origin="south")
    with World(network) as world:
        for seed in range(3):
            world.reset(plan.plan(seed))
            while not world.traffic.waiting:
                world.advance(np.array([-6.0, 0.0]))
            world.stage.set_friction(0.1)
            world.stage.set_friction(0.08)
            for _ in range(30):
                world.advance(np.array([-6.0, 0.0]))
            assert not world.traffic.waiting
            tight = (SHARE * 0.08 * GRAVITY / curvatures(network)["north_in_0"]) ** 0.5
            assert world.traffic.bends.limit(network.lanes["north_in_0"]) == pytest.approx(tight)
