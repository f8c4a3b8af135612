"""What the reference drivers do in scenes with a known answer."""

import math

import numpy as np
import pytest

from rudc.agents import drivers
from rudc.agents.follower import Follower
from rudc.agents.gap_acceptance import GapAcceptance, Planner
from rudc.agents.sumo import SumoDriver
from rudc.network.network import load_network
from rudc.world.scene import Kind
from tests.agents.conftest import Other
from tests.offering import offer

HALF = 2.5


def act(driver, scene):
    driver.reset(scene, 0)
    decision = driver.act(scene)
    assert decision.corrected is None
    assert math.isnan(decision.sigma)
    np.testing.assert_array_equal(decision.u, decision.u_rl)
    return decision.u


def row_from(origin, towards, lane=None):
    network = load_network("four_way")
    return network.route(origin, towards, lane).row


def before_waiting(origin, towards, metres):
    """Arc length of the ego's centre with its front so far before the waiting point."""
    return load_network("four_way").route(origin, towards).waiting_s - HALF - metres


def test_follower_speeds_up_to_its_speed_and_ignores_who_stands_ahead(scene_on):
    row = row_from("south", "straight")
    stop = load_network("four_way").paths.stop_s[row]
    empty = scene_on("south", "straight", 60.0, 5.0)
    blocked = scene_on("south", "straight", 60.0, 5.0, (Other(row, 68.0, 0.0),))
    assert stop > 60.0
    assert act(Follower(), empty)[0] == 2.0
    np.testing.assert_array_equal(act(Follower(), empty), act(Follower(), blocked))


def test_gap_acceptance_drives_on_when_alone(scene_on):
    for s in (40.0, 80.0, 110.0, 130.0):
        assert act(GapAcceptance(), scene_on("south", "straight", s, 6.0))[0] > 0.5


def test_gap_acceptance_brakes_for_who_stands_in_its_lane(scene_on):
    row = row_from("south", "straight")
    scene = scene_on("south", "straight", 60.0, 8.0, (Other(row, 80.0, 0.0),))
    assert act(GapAcceptance(), scene)[0] < -2.0


def test_gap_acceptance_follows_a_leader_of_its_own_speed(scene_on):
    row = row_from("south", "straight")
    scene = scene_on("south", "straight", 50.0, 8.0, (Other(row, 50.0 + 5.0 + 20.0, 8.0),))
    assert -1.0 < act(GapAcceptance(), scene)[0] < 2.0


def test_gap_acceptance_does_not_mind_the_lane_beside(scene_on):
    other = Other(-1, 0.0, 0.0)
    route = load_network("four_way").route("south", "straight")
    x, y, psi = (float(v) for v in route.path.pose(75.0))
    other = other._replace(place=(x - 3.5 * math.sin(psi), y + 3.5 * math.cos(psi), psi))
    assert act(GapAcceptance(), scene_on("south", "straight", 60.0, 6.0, (other,)))[0] > 0.5


@pytest.mark.parametrize(
    ("gap", "speed", "goes", "turned"),
    [
        (0.2, 0.0, {Planner}, 0.0),
        (0.3, 0.0, {Planner, GapAcceptance}, 0.0),
        (0.05, 0.0, set(), 0.0),
        (0.2, 1.0, set(), 0.0),
        (0.15, 0.0, {Planner}, 45.0),
        (0.05, 0.0, set(), 45.0),
    ],
)
def test_planner_passes_what_stands_as_near_as_its_courses_lead_it(scene_on, gap, speed, goes, turned):
    """It stood for good before a strip of rubber that its course passes with 0.2 m, and beside the corner of
    a lorry that stands across.
    """
    route = load_network("four_way").route("south", "straight")
    turn = math.radians(turned)
    x, y, psi = (float(v) for v in route.path.pose(64.0 if turned else 68.0))
    aside = 0.5 * (route.key.vehicle.width + 5.0 * math.sin(turn) + 1.8 * math.cos(turn)) + gap
    thing = Other(-1, 0.0, speed, (x + aside * math.sin(psi), y - aside * math.cos(psi), psi + turn))
    scene = scene_on("south", "straight", 62.0, 0.0, (thing,))
    assert {driver for driver in (Planner, GapAcceptance) if act(driver(), scene)[0] > 0.5} == goes


@pytest.mark.parametrize("distance", [3.0, 4.0])
def test_gap_acceptance_waits_for_crossing_traffic_with_priority(scene_on, distance):
    network = load_network("four_way")
    ego = network.route("south", "left")
    row = row_from("west", "straight")
    assert network.paths.yields[ego.row, row]
    s_in = network.conflict(ego)[row, 2]
    coming = Other(row, float(s_in) - 18.0, 9.0)
    gone = Other(row, float(network.conflict(ego)[row, 3]) + 6.0, 9.0)
    s = before_waiting("south", "left", distance)
    assert act(GapAcceptance(), scene_on("south", "left", s, 5.0, (coming,)))[0] < -0.5
    assert act(GapAcceptance(), scene_on("south", "left", s, 3.0, (gone,)))[0] > 0.0


def test_gap_acceptance_takes_a_gap_that_is_long_enough(scene_on):
    network = load_network("four_way")
    row = row_from("west", "straight")
    far = Other(row, float(network.conflict(network.route("south", "left"))[row, 2]) - 75.0, 8.0)
    scene = scene_on("south", "left", before_waiting("south", "left", 0.5), 0.5, (far,))
    assert act(GapAcceptance(), scene)[0] > 0.5


def test_gap_acceptance_goes_when_those_who_must_yield_to_it_come(scene_on):
    network = load_network("four_way")
    ego = network.route("west", "straight")
    row = row_from("south", "left")
    assert not network.paths.yields[ego.row, row]
    waiting = Other(row, float(network.paths.stop_s[row]) - HALF - 1.0, 0.0)
    s = before_waiting("west", "straight", 15.0)
    assert act(GapAcceptance(), scene_on("west", "straight", s, 8.0, (waiting,)))[0] > -0.5


def test_gap_acceptance_stops_for_a_pedestrian_about_to_step_on_its_path(scene_on):
    route = load_network("four_way").route("south", "straight")
    x, y, psi = (float(v) for v in route.path.pose(75.0))
    normal = np.array([-math.sin(psi), math.cos(psi)])
    walker = Other(-1, 0.0, 1.5, (*(np.array([x, y]) - 3.0 * normal), psi + math.pi / 2), Kind.PEDESTRIAN)
    away = walker._replace(place=(*walker.place[:2], psi - math.pi / 2))
    assert act(GapAcceptance(), scene_on("south", "straight", 60.0, 7.0, (walker,)))[0] < -1.0
    assert act(GapAcceptance(), scene_on("south", "straight", 60.0, 7.0, (away,)))[0] > 0.0


def test_waiting_makes_gap_acceptance_less_demanding(scene_on):
    network = load_network("four_way")
    row = row_from("west", "straight")
    s_in = float(network.conflict(network.route("south", "straight"))[row, 2])
    s = before_waiting("south", "straight", 0.0)

    def accepts(distance, waited_s):
        scene = scene_on("south", "straight", s, 0.0, (Other(row, s_in - distance, 8.0),), waited_s=waited_s)
        return act(GapAcceptance(), scene)[0] > 0.0

    fresh = next(d for d in np.arange(5.0, 100.0) if accepts(d, 0.0))
    patient = next(d for d in np.arange(5.0, 100.0) if accepts(d, 20.0))
    assert patient < fresh - 3.0


def test_sumo_leaves_the_wheel_to_sumo(scene_on):
    driver = SumoDriver()
    assert driver.ego_driver == "sumo"
    np.testing.assert_array_equal(act(driver, scene_on("south", "left", 60.0, 5.0)), [0.0, 0.0])


def test_settings_change_with_the_file_that_an_entry_point_names(tmp_path, monkeypatch):
    """Also where that file takes the class from another."""
    (tmp_path / "within_it.py").write_text(
        "class Calm:\n    reset = act = lambda *_: None\n", encoding="utf-8"
    )
    offer(tmp_path, "[rudc.agents]\ncalm = outside_it:Calm\n")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(drivers, "_installed", drivers._installed.__wrapped__)
    found = []
    for number in (3, 9):
        (tmp_path / "outside_it.py").write_text(f"from within_it import Calm  # {number}\n", encoding="utf-8")
        found.append(drivers.driver_settings("calm"))
    assert found[0] != found[1]
