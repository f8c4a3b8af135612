"""Vehicles that stand at their stop lines and reach into the ego's path."""

from dataclasses import replace

import numpy as np
import pytest

from rudc.agents.blocking import AT_LINE, AT_LINE_S, WIDEST, Blocking
from rudc.agents.courses import CLEAR, Courses
from rudc.data import data_folder
from rudc.network.course import gaps_along
from rudc.network.network import load_network
from tests.agents.conftest import Other

RIDGE = str(data_folder("results") / "held-out-16" / "networks" / "ridgefarm.net.xml")
"""a turn at an acute angle with room to go round: the gap found is far from CLEAR, on any processor"""
FIVE = str(data_folder("results") / "held-out-30" / "networks" / "tannery_five" / "tannery_five.net.xml")


@pytest.fixture
def buses_on(scene_on):
    """An ego 10 m before its turn, and one bus on each row of some arms, its front `back` m before its
    stop line, at v m/s.
    """

    def make(network, origin, towards, arms, back=0.2, v=0.0):
        movements, paths = load_network(network).movements, load_network(network).paths
        rows = [m.rows[0] for m in movements if m.origin in arms and m.destination != m.origin]
        buses = tuple(Other(row, float(paths.stop_s[row]) - back - 0.5 * WIDEST[0], v) for row in rows)
        route = load_network(network).route(origin, towards)
        scene = scene_on(origin, towards, route.stop_line_s - 12.5, 6.0, buses, network_name=network)
        return replace(scene, size=np.tile(WIDEST, (len(rows), 1)))

    return make


def watched(scene):
    """Who blocks, once it has stood for AT_LINE_S."""
    blocking = Blocking()
    assert not blocking.look(scene).standing.number
    return blocking.look(replace(scene, time_s=scene.time_s + AT_LINE_S + 0.1)).standing


def test_who_stands_in_the_ego_s_path_at_the_stop_line_is_driven_round(buses_on):
    """A bus waited there for the ego, and the ego before it, for good."""
    scene = buses_on(RIDGE, "west", "southwest", ["southwest"])
    bus = watched(scene)
    assert bus.number
    courses = Courses()
    courses.reset(scene)
    courses.see(scene)
    shown = courses.see(replace(scene, time_s=scene.time_s + AT_LINE_S + 0.1))
    gaps = [
        gaps_along(seen.route.path, seen.ego_s, seen.destination_s, seen.vehicle, bus)[1].min()
        for seen in (scene, shown)
    ]
    assert gaps[0] == 0.0
    assert gaps[1] >= CLEAR


@pytest.mark.parametrize("change", [{"back": AT_LINE + 1.0}, {"v": 3.0}])
def test_who_moves_or_stands_farther_back_does_not_block(buses_on, change):
    assert not watched(buses_on(FIVE, "northwest", "southwest", ["southwest"], **change)).number


@pytest.mark.parametrize("name", ["four_way", "skewed_four_way", "t_junction"])
def test_where_lanes_are_wide_nobody_at_a_stop_line_blocks(buses_on, name):
    assert not watched(buses_on(name, "south", "left", ["north", "east", "west"])).number
