import pickle
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rudc.errors import NetworkError
from rudc.network.assembly import decide_major
from rudc.network.build import build_network
from rudc.network.network import Network, load_network, shipped_networks

NETWORKS = sorted(shipped_networks())
FOUR_ARMS = ("east", "north", "west", "south")


def test_all_networks_are_shipped():
    assert NETWORKS == ["four_way", "four_way_equal", "roundabout", "skewed_four_way", "t_junction"]


@pytest.mark.parametrize("name", NETWORKS)
def test_arms_are_named_by_compass_and_120_m_long(name):
    network = load_network(name)
    assert tuple(arm.name for arm in network.arms) == (
        ("east", "west", "south") if name[0] == "t" else FOUR_ARMS
    )
    for arm in network.arms:
        assert arm.length == pytest.approx(120.0, abs=0.1)
    assert network.road_km == pytest.approx(0.12 * len(network.arms), abs=0.001)
    np.testing.assert_allclose(network.center, 0.0, atol=1e-9)


@pytest.mark.parametrize("name", NETWORKS)
def test_all_road_users_may_use_all_lanes(name):
    network = load_network(name)
    lanes = 1 if name == "roundabout" else 2
    for arm in network.arms:
        assert len(arm.in_lanes) == len(arm.out_lanes) == lanes
        for lane_id in (*arm.in_lanes, *arm.out_lanes):
            lane = network.lanes[lane_id]
            assert (lane.width, lane.speed, lane.refuses) == (3.5, 10.0, ())


def test_density_counts_vehicles_per_km_of_two_way_road():
    road_km = load_network("four_way").road_km
    assert round(20 * road_km) == 10
    assert round(30 * road_km) == 14


def test_the_east_west_road_is_major_on_priority_junctions_and_none_is_on_the_equal_one():
    for name in ("four_way", "t_junction", "skewed_four_way"):
        assert {arm.name for arm in load_network(name).arms if arm.major} == {"east", "west"}
    assert not any(arm.major for arm in load_network("four_way_equal").arms)


def majors(arms, turns, waits_for, node_type="priority"):
    """Which arms are major, of ways [(from, to)] by number of arm; {row: rows that it must yield to}."""
    ways = [SimpleNamespace(source=SimpleNamespace(origin=o, destination=d)) for o, d in turns]
    yields = np.array([[j in waits_for.get(i, ()) for j in range(len(turns))] for i in range(len(turns))])
    return [arm.name for arm in decide_major(arms, ways, yields, node_type) if arm.major]


def test_no_arm_is_major_where_who_comes_from_the_right_goes_first():
    arms = load_network("four_way").arms
    turns = [(k, (k + 2) % 4) for k in range(4)]
    assert majors(arms, turns, {3: [0]}) == [arm.name for arm in arms[:3]]
    assert not majors(arms, turns, {3: [0]}, "right_before_left")


def test_a_right_turn_into_a_lane_of_its_own_makes_no_arm_major():
    """The left turn (row 1) from the first arm yields to both others' ways; its right turn meets nobody."""
    arms = load_network("t_junction").arms
    assert majors(arms, [(0, 1), (0, 2), (1, 2), (2, 1)], {1: [2, 3]}) == [arm.name for arm in arms[1:]]


def test_a_free_right_turn_makes_an_arm_major_where_it_follows_a_main_road_that_bends():
    """West and north are the ends of the main road. East's right turn has a lane of its own in the north, and
    south yields to it; nobody whose way is free does.
    """
    arms = load_network("four_way").arms
    east, north, west, south = (
        next(k for k, arm in enumerate(arms) if arm.name == name)
        for name in ("east", "north", "west", "south")
    )
    turns = [(west, north), (north, west), (north, south), (east, north), (east, west), (south, north)]
    waits = {2: [4], 4: [0, 1, 2], 5: [0, 3, 4]}
    assert set(majors(arms, turns, waits)) == {"north", "west"}


@pytest.mark.parametrize("name", ["four_way", "four_way_equal", "skewed_four_way"])
def test_lanes_permit_what_they_should(name):
    network = load_network(name)
    assert len(network.movements) == 12
    for movement in network.movements:
        lanes = sorted(network.inbound_lane(row).index for row in movement.rows)
        assert lanes == {"left": [1], "straight": [0, 1], "right": [0]}[movement.turn]


def test_movements_of_the_t_junction_and_the_roundabout():
    turns = {(m.origin, m.destination): m.turn for m in load_network("t_junction").movements}
    assert turns == {
        ("east", "west"): "straight",
        ("east", "south"): "left",
        ("west", "east"): "straight",
        ("west", "south"): "right",
        ("south", "east"): "right",
        ("south", "west"): "left",
    }
    network = load_network("roundabout")
    turns = {m.destination: m.turn for m in network.movements if m.origin == "south"}
    assert turns == {"east": "right", "north": "straight", "west": "left", "south": "u_turn"}
    assert network.is_roundabout
    assert network.movement("south", "north").edges == (
        "south_in",
        "ring_south_east",
        "ring_east_north",
        "north_out",
    )


@pytest.mark.parametrize("y", [50, 50.01, 51])
def test_of_a_fork_that_is_alike_to_both_sides_no_way_is_straight(tmp_path, y):
    """One centimetre made the other way `straight`."""
    nodes = "".join(
        f'<node id="{name}" x="{x}" y="{y}" type="priority"/>'
        for name, x, y in (("c", 0, 0), ("trunk", -120, 0), ("one", 100, y), ("other", 100, -50))
    )
    ways = [(arm, "c") for arm in ("trunk", "one", "other")]
    edges = "".join(
        f'<edge id="{a}_{b}" from="{a}" to="{b}" numLanes="1" speed="10" priority="1"/>'
        for pair in ways
        for a, b in (pair, pair[::-1])
    )
    (tmp_path / "fork.nod.xml").write_text(f"<nodes>{nodes}</nodes>", encoding="utf-8")
    (tmp_path / "fork.edg.xml").write_text(f"<edges>{edges}</edges>", encoding="utf-8")
    network = load_network(build_network(tmp_path))
    turns = {m.destination: m.turn for m in network.movements if m.origin == "west" and m.turn != "u_turn"}
    assert turns == {"northeast": "left", "southeast": "right"}


def test_a_movement_is_major_only_if_it_yields_to_nobody():
    network = load_network("four_way")
    major = {(m.origin, m.turn) for m in network.movements if m.major}
    assert major == {(arm, turn) for arm in ("east", "west") for turn in ("straight", "right")}


@pytest.mark.parametrize("name", NETWORKS)
@settings(max_examples=80)
@given(data=st.data())
def test_a_place_on_a_lane_is_where_it_was_put(name, data):
    network = load_network(name)
    lane_name = data.draw(st.sampled_from(sorted(network.lane_names)))
    at = data.draw(st.floats(0.0, 119.0))
    lateral = data.draw(st.floats(-1.5, 1.5))
    x, y, psi = network.place_on_lane(lane_name, at, lateral, 0.3)
    middle = np.array(network.place_on_lane(lane_name, at)[:2])
    assert np.hypot(*(np.array([x, y]) - middle)) == pytest.approx(abs(lateral), abs=1e-9)
    to_the_left = np.cos(psi - 0.3) * (y - middle[1]) - np.sin(psi - 0.3) * (x - middle[0])
    assert to_the_left == pytest.approx(lateral, abs=1e-6)
    lane = network.lane(lane_name)
    end = lane.xy[-1] if "_in_" in lane_name else lane.xy[0]
    assert np.hypot(*(middle - end)) == pytest.approx(at, abs=1.0 if name == "roundabout" else 0.02)
    direction = network.surface.direction(*middle)
    if at > 1.0:
        assert np.cos(direction - psi + 0.3) > 0.99


def test_lanes_go_by_scenario_name_or_sumo_id():
    network = load_network("four_way")
    assert network.lane("west_in_0").xy[-1] == pytest.approx([-14.25, -5.25])
    assert network.lane("west_out_1").xy[0] == pytest.approx([-14.25, 1.75])
    assert network.lane(":centre_5_0").internal


def test_unknown_names_are_refused_with_a_suggestion():
    network = load_network("four_way")
    with pytest.raises(NetworkError, match=r"no lane 'west_inn_0'.*did you mean 'west_in_0'"):
        network.lane("west_inn_0")
    with pytest.raises(NetworkError, match=r"no arm 'sout'.*did you mean 'south'"):
        network.arm("sout")
    with pytest.raises(NetworkError, match=r"no arm 'northeast'.*did you mean 'north'"):
        network.arm("northeast")
    three = load_network("t_junction")
    with pytest.raises(NetworkError, match=r"no arm 'north' in network t_junction; there are: "):
        three.arm("north")  # not the arm opposite
    with pytest.raises(NetworkError, match=r"no lane 'north_in_0' in network t_junction; there are: "):
        three.lane("north_in_0")
    with pytest.raises(NetworkError, match=r"no network 'fourway'.*did you mean 'four_way'"):
        load_network("fourway")
    with pytest.raises(NetworkError, match=r"arm 'east' does not lead to 'right'.*west \(straight\)"):
        load_network("t_junction").route("east", "right")
    with pytest.raises(NetworkError, match=r"200 m from the junction is not on lane 'west_in_0'"):
        network.place_on_lane("west_in_0", 200.0)
    with pytest.raises(NetworkError, match=r"no junction 'middle'.*centre"):
        load_network("four_way", "middle")


def test_arms_are_found_by_edge_too():
    network = load_network("four_way")
    assert network.arm("west_in").name == network.arm("west_out").name == "west"
    assert (
        network.route("south_in", "west_out")
        is network.route("south", "west")
        is network.route("south", "left")
    )


def test_a_network_is_read_once_and_pickled_by_reference():
    network = load_network("four_way")
    assert load_network(network.path) is network
    assert len(pickle.dumps(network)) < 500
    assert pickle.loads(pickle.dumps(network)) is network


def test_arrays_are_read_only():
    network = load_network("four_way")
    route = network.route("south", "left")
    for array in (network.paths.xy, route.path.xy, network.conflict(route), network.lane("west_in_0").xy):
        with pytest.raises(ValueError, match="read-only"):
            array[...] = 0.0


def test_reading_the_same_file_twice_gives_the_same_network():
    path = load_network("skewed_four_way").path
    one, two = Network(path), Network(path)
    assert one.movements == two.movements
    assert one.paths.lane_ids == two.paths.lane_ids
    np.testing.assert_array_equal(one.paths.xy, two.paths.xy)
