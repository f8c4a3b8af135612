"""Whom an EV hinders that stands with a corner in the next lane, or beside a long vehicle that turns; scenes
from `held-out-41`, whose lanes are 2.75 m wide and bend.
"""

import math
from dataclasses import replace

import numpy as np
import pytest

from rudc.data import data_folder
from rudc.network.network import load_network
from rudc.world.scene import EgoState, Kind
from rudc.world.yielding import must_yield


@pytest.fixture(scope="module")
def bend():
    return load_network(data_folder("results") / "held-out-41" / "networks" / "bend.net.xml")


@pytest.fixture
def beside(make_scene, bend):
    """Scene of an EV that stands `offset` m left of its way from the west to the southeast, `s` m along it,
    turned by `turned` rad to the left, and of a bus that comes from the southeast, `bus_s` m along its way.
    """

    def make(s, offset, turned, bus_s, v, to="west"):
        row = bend.movement("southeast", to).rows[0]
        bus = {"row": row, "s": bus_s, "v": v, "size": (12.0, 2.5), "kind": Kind.BUS}
        scene = make_scene(bus, origin="west", turn="southeast", network=bend)
        x, y, psi = (float(value) for value in scene.route.path.pose(s))
        x, y = x - offset * math.sin(psi), y + offset * math.cos(psi)
        ego = EgoState(x, y, psi + turned, 0.0, 0.0, 0.0, 0.0, 0.0)
        place, heading = bend.paths.body_pose(np.array([row]), np.array([bus_s]), 12.0)
        return replace(
            scene, ego=ego, ego_s=s, ego_offset=offset, position=place, heading=heading, waited_s=9.0
        )

    return make


def test_a_bus_brakes_for_an_ego_whose_corner_is_in_its_lane(beside):
    """It drove into an EV that had stood for seven seconds."""
    found = must_yield(beside(166.6, 0.58, 0.12, 138.0, 7.2))
    assert found.rows == found.for_ego == [0]
    assert found.deceleration[0] > 1.5


def test_it_drives_on_beside_an_ego_that_keeps_to_its_lane(beside):
    assert must_yield(beside(168.0, 0.0, 0.0, 140.0, 7.2)).rows == []


def test_one_that_stands_beside_the_ego_drives_on_since_its_tail_only_follows(beside):
    """Its tail was 0.7 m beside the EV, and it stood until the episode's end."""
    scene = beside(155.713, -0.148, 0.061, 165.635, 0.0, to="east")
    scene = replace(scene, position=np.array([[159.47, 145.259]]), heading=np.array([0.968]))
    assert must_yield(scene).rows == []


@pytest.mark.parametrize(("offset", "brakes"), [(0.8, True), (0.2, False)])
def test_an_ego_that_drives_beside_its_path_is_expected_to_stay_beside_it(beside, offset, brakes):
    """Others reckoned with one that is on its path at once."""
    scene = beside(168.0, offset, 0.0, 134.0, 7.2)
    driving = replace(scene.ego, v=3.0)
    assert must_yield(replace(scene, ego=driving, waited_s=0.0)).rows == [0] * brakes
