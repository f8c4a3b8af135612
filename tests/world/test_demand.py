"""By which arms traffic comes, and where it turns."""

from collections import Counter

import numpy as np
import pytest

from rudc.data import data_folder
from rudc.errors import NetworkError, ScenarioError
from rudc.network.network import load_network
from rudc.scenario.loader import load_scenario
from rudc.world.demand import Demand
from rudc.world.fitting import misfits
from tests.plans import PlanSource

DRAWS = 4000


def shares(demand: Demand, closed=frozenset()) -> dict[tuple[str, str], float]:
    """(origin, destination) -> share of DRAWS draws."""
    rng = np.random.default_rng(0)
    drawn = Counter((m.origin, m.destination) for m in (demand.draw(closed, rng) for _ in range(DRAWS)))
    return {way: count / DRAWS for way, count in drawn.items()}


def test_without_shares_arms_count_by_their_lanes_and_ways_on_are_alike():
    network = load_network("t_junction")
    found = shares(Demand(network))
    assert len(found) == len(network.onward)
    assert found == pytest.approx(dict.fromkeys(found, 1 / 6), abs=0.03)


def test_shares_of_arms_and_turns_hold():
    network = load_network("four_way")
    found = shares(Demand(network, {"north": 3.0, "east": 1.0}, {"straight": 0.8, "left": 0.2}))
    wanted = {
        ("north", "south"): 0.6, ("north", "east"): 0.15, ("east", "west"): 0.2, ("east", "south"): 0.05
    }  # fmt: skip
    assert found == pytest.approx(wanted, abs=0.03)


def test_ways_with_the_same_turn_have_its_share_in_equal_parts():
    network = load_network(data_folder("results") / "held-out-21" / "networks" / "star_bend.net.xml")
    arm, turn = "west", "left"
    assert [m.turn for m in network.onward if m.origin == arm].count(turn) == 2
    found = shares(Demand(network, {arm: 1.0}, {turn: 2.0}))
    assert found == pytest.approx(dict.fromkeys(found, 0.5), abs=0.03)


def test_an_arm_without_such_a_turn_sends_nobody():
    network = load_network("t_junction")
    assert {origin for origin, _ in shares(Demand(network, None, {"straight": 1.0}))} == {"east", "west"}
    with pytest.raises(NetworkError, match="no way leads straight from south"):
        Demand(network, {"south": 1.0}, {"straight": 1.0})


def test_closed_ways_are_left_out_while_others_have_a_share():
    network = load_network("four_way")
    demand = Demand(network, {"north": 1.0}, {"straight": 1.0, "left": 1.0})
    assert {*shares(demand, {("north", "south")})} == {("north", "east")}
    assert {*shares(demand, {("north", "south"), ("north", "east")})} == {
        ("north", "south"),
        ("north", "east"),
    }


def test_traffic_comes_as_the_scenario_says(world):
    """From the first scene on, and among those who enter later."""
    source = PlanSource(
        density=25.0, origin="west", origins={"north": 2.0, "south": 1.0}, turns={"straight": 1.0}
    )
    seen: dict[tuple[int, str], tuple[str, str]] = {}
    for seed in range(3):
        world.reset(source.plan(seed), ego_driver="sumo")
        for _ in range(200):
            world.advance(np.zeros(2))
            seen |= {(seed, name): (d.origin, d.destination) for name, d in world.traffic.drivers.items()}
    ways = Counter(seen.values())
    assert {*ways} == {("north", "south"), ("south", "north")}
    assert ways["north", "south"] / len(seen) == pytest.approx(2 / 3, abs=0.15)
    assert len(seen) > 40


@pytest.mark.parametrize(
    ("traffic", "where", "said"),
    [
        ("from: {nord: 1}", "traffic.from.nord", "did you mean 'north'"),
        ("from: {north: 1, north_in: 1}", "traffic.from.north_in", "is the arm of 'north', too"),
        ("from: {}", "traffic.from", "one share at least must be above 0"),
        ("from: {north: 0}", "traffic.from", "one share at least must be above 0"),
        ("turns: {left: {choice: [0, 1]}}", "traffic.turns", "can be drawn as 0"),
        ("turns: {back: 1}", "traffic.turns.back", "unknown key"),
        ("from: {north: -1}", "traffic.from.north", "not between 0 and 1e+06"),
    ],
)
def test_what_does_not_fit_is_told_with_its_place(tmp_path, traffic, where, said):
    path = tmp_path / "case.yaml"
    path.write_text(f"name: case\ntraffic:\n  {traffic}\n")
    with pytest.raises(ScenarioError) as error:
        load_scenario(path, fit=misfits)
    assert where in str(error.value)
    assert said in str(error.value)


@pytest.mark.parametrize("drawn", ["{choice: [0, 1]}", "{choice: {values: [0, 1], weights: [1, 40]}}"])
@pytest.mark.parametrize(
    "traffic",
    [
        "from: {south: 1}, turns: {left: DRAWN, straight: 1}",
        "from: {west: DRAWN, south: 1}, turns: {straight: 1}",
        "from: {west: DRAWN, south: 1}, turns: {straight: 1, left: DRAWN}",
    ],
)
def test_shares_that_may_be_drawn_as_0_must_leave_somebody(tmp_path, traffic, drawn):
    path = tmp_path / "case.yaml"
    path.write_text(f"name: case\nnetwork: t_junction\ntraffic: {{{traffic.replace('DRAWN', drawn)}}}\n")
    with pytest.raises(ScenarioError, match="no way leads straight from"):
        load_scenario(path, fit=misfits)


def test_of_a_one_way_arm_it_is_said_that_nothing_enters_by_it(tmp_path):
    network = data_folder("results") / "held-out-11" / "one_way_grid" / "one_way_grid.net.xml"
    path = tmp_path / "case.yaml"
    path.write_text(
        f"name: case\nnetwork: {network}\ntraffic: {{from: {{north: 1, east: 1}}, turns: {{left: 1}}}}\n"
        "events:\n  - {kind: hard_brake, vehicle: {from: west, turn: left}}\n"
        "  - {kind: wrong_way, lane: south_out_0, at: 20}\n"
    )
    with pytest.raises(ScenarioError) as error:
        load_scenario(path, fit=misfits)
    first, east, third, fourth = str(error.value).splitlines()
    assert first.endswith(
        "traffic.from.north: network one_way_grid: nothing enters by north, which is one-way"
    )
    assert east.endswith("traffic.from.east: network one_way_grid: no way leads left from east")
    assert third.endswith(
        "events.0.vehicle.from: network one_way_grid: nothing enters by west, which is one-way"
    )
    assert fourth.endswith("arm 'south' is one-way, nothing leaves by it")


def test_a_swept_arm_is_checked_at_its_own_place(tmp_path):
    path = tmp_path / "case.yaml"
    path.write_text(
        "name: case\nnetwork: t_junction\ntraffic: {from: {west: 1}, turns: {straight: 1}}\n"
        "sweep: {traffic.from.south: [0, 2], traffic.density: [10, 20]}\n"
    )
    with pytest.raises(
        ScenarioError, match=r"traffic\.from\.south: network t_junction: no way leads straight"
    ):
        load_scenario(path, fit=misfits)


def test_without_the_keys_a_file_says_what_it_said_before():
    data = load_scenario("random_destination").data()["traffic"]
    assert not {"from", "turns"} & data.keys()
