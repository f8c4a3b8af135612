"""Lane names: each means a place on the road where it says, whatever the network and the ego's route."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rudc.data import data_folder
from rudc.errors import NetworkError
from rudc.network.network import Network, load_network, shipped_networks
from rudc.network.stretches import EGO_LANES


def inner_lanes(network: Network) -> dict[str, str]:
    """Scenario names of the lanes inside the junction and on its ring -> SUMO's ids (the first's)."""
    named = network.named_stretches
    return {name: named[name].lane.id for name in named.keys() - network.lane_names.keys()}


@given(st.data())
def test_every_lane_inside_is_on_the_road_and_runs_in_driving_direction(data):
    network = load_network(data.draw(st.sampled_from(sorted(shipped_networks()))))
    inner = inner_lanes(network)
    name = data.draw(st.sampled_from(sorted({*inner, *inner.values()})))
    stretch = network.stretch(name)
    at = data.draw(st.floats(0.0, stretch.reach - 0.5))
    x, y, psi = stretch.place(at)
    u, v, _ = stretch.place(at + 0.5)
    assert network.surface.signed_distance(np.array([[x, y]]))[0] > 0.5
    assert math.hypot(u - x, v - y) == pytest.approx(0.5, abs=0.02)
    assert math.cos(math.atan2(v - y, u - x) - psi) > 0.95
    assert stretch.lane.internal or stretch.lane.edge in network.ring_edges
    with pytest.raises(NetworkError, match="from its beginning is not on lane"):
        stretch.place(stretch.reach + 0.1)


@pytest.mark.parametrize("name", sorted(shipped_networks()))
def test_ways_through_the_junction_lead_from_stop_line_to_exit(name):
    network = load_network(name)
    ways = [name for name in inner_lanes(network) if "_to_" in name]
    assert len(ways) == network.paths.count
    for way in ways:
        origin, _, rest = way.partition("_to_")
        stretch = network.stretch(way)
        begin, end = stretch.place(0.0), stretch.place(stretch.reach)
        starts = [network.place_on_lane(i, 0.0) for i in network.arm(origin).in_lanes]
        exits = [network.place_on_lane(i, 0.0) for i in network.arm(rest.rpartition("_")[0]).out_lanes]
        assert min(math.dist(begin[:2], place[:2]) for place in starts) < 0.05
        assert min(math.dist(end[:2], place[:2]) for place in exits) < 0.05


def test_several_ways_from_arm_to_arm_are_counted_from_the_right():
    network = load_network("four_way")
    right, left = (network.place_on_lane(f"south_to_north_{k}", 5.0) for k in (0, 1))
    assert right[0] > left[0]
    assert network.lane("south_to_west_0").id == ":centre_11_0"


def test_ways_lie_in_the_junction_also_where_an_arm_is_of_several_edges():
    network = load_network(data_folder("results") / "held-out-10" / "hump_bridge" / "hump_bridge.net.xml")
    ways = {name: lane for name, lane in inner_lanes(network).items() if "_to_" in name}
    assert len(network.arm("north").in_edges) == 3
    assert ways["north_to_west_0"] != ways["north_to_east_0"]
    assert all(lane.startswith(":foot_") for lane in ways.values()), "that is the junction's name"


def test_a_ring_runs_from_arm_to_arm():
    network = load_network("roundabout")
    arms = [arm.name for arm in network.arms]
    for arm, following in zip(arms, [*arms[1:], arms[0]], strict=True):
        stretch = network.stretch(f"ring_{arm}_0")
        end, begin = stretch.place(stretch.reach), network.place_on_lane(f"ring_{following}_0", 0.0)
        assert math.dist(end[:2], begin[:2]) < 0.05
        assert stretch.lane.id == f"ring_{arm}_{following}_0"


def test_all_lanes_of_a_ring_have_names_also_those_on_which_nobody_enters():
    network = load_network(data_folder("results") / "held-out-18" / "networks" / "oval" / "oval.net.xml")
    assert len(network.arm("north").in_lanes) == 1
    outer, inner = network.stretch("ring_north_0"), network.stretch("ring_north_1")
    assert inner.reach > 40.0, "to where the next arm's traffic enters"
    assert math.dist(outer.place(5.0)[:2], inner.place(5.0)[:2]) < 5.0
    begin, end = inner.place(inner.reach)[:2], network.place_on_lane("ring_west_1", 0.0)[:2]
    assert math.dist(begin, end) < 0.05


def test_against_the_traffic_a_way_leads_back_to_where_it_comes_from():
    network = load_network("roundabout")
    for name, at in (("ring_south_0", 10.0), ("south_to_west_0", 30.0)):
        way = network.stretch(name).against(at)
        assert way[0] == pytest.approx(network.place_on_lane(name, at)[:2])
        assert way[-1] == pytest.approx(network.lane("south_in_0").xy[0], abs=0.5)
        assert np.hypot(*np.diff(way, axis=0).T).max() < 1.0


def test_lanes_about_the_ego():
    network = load_network("four_way")
    found = {}
    for turn in ("left", "straight", "right"):
        route = network.route("south", turn)
        for name in EGO_LANES:
            try:
                found[turn, name] = network.stretch(name, route).lane.id
            except NetworkError as error:
                found[turn, name] = str(error).rpartition(" has ")[2]
    assert found == {
        ("left", "ego_in"): "south_in_1",
        ("left", "ego_out"): "west_out_1",
        ("left", "left_of_ego"): "south_out_1",
        ("left", "right_of_ego"): "south_in_0",
        ("straight", "ego_in"): "south_in_0",
        ("straight", "ego_out"): "north_out_0",
        ("straight", "left_of_ego"): "south_in_1",
        ("straight", "right_of_ego"): "no lane to its right",
        ("right", "ego_in"): "south_in_0",
        ("right", "ego_out"): "east_out_0",
        ("right", "left_of_ego"): "south_in_1",
        ("right", "right_of_ego"): "no lane to its right",
    }
    route = network.route("south", "left")
    assert [network.arm(name, route).name for name in ("ego_in", "ego_out")] == ["south", "west"]
    x, y, psi = network.place_on_lane("left_of_ego", 20.0, route=route)
    own = network.place_on_lane("ego_in", 20.0, route=route)
    assert math.cos(psi - own[2]) == pytest.approx(-1.0)
    assert (x, y) == pytest.approx((own[0] - 3.5, own[1]), abs=0.1)
    for ask in (network.stretch, network.arm):
        with pytest.raises(NetworkError, match="before the ego's route is known"):
            ask("ego_out")


def test_a_stretch_of_the_ring_past_an_arm_that_only_leads_away_is_found_by_its_name():
    """Of `ring_southwest_0` it was asked whether `ring_south_0` is meant."""
    network = load_network(data_folder("results") / "held-out-18" / "networks" / "oval" / "oval.net.xml")
    assert not network.arm("southwest").in_lanes
    with pytest.raises(NetworkError, match=r"is part of ring_west_0 from `at: (\d+)` on") as caught:
        network.stretch("ring_southwest_0")
    at = float(str(caught.value).rpartition("at: ")[2].removesuffix("` on"))
    x, y, _ = network.place_on_lane("ring_west_0", at)
    assert math.hypot(*(network.lane("southwest_out_0").xy[0] - (x, y))) < 20.0
    assert (x, y) == pytest.approx(network.lane("ring_swexit_0").xy[0], abs=1.0)
