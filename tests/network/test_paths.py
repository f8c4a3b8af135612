import numpy as np
import pytest
import sumolib
from hypothesis import given, settings
from hypothesis import strategies as st

from rudc.network.net_file import read_net
from rudc.network.network import load_network, shipped_networks
from rudc.network.paths import SPACING

NETWORKS = sorted(shipped_networks())


@pytest.mark.parametrize("name", NETWORKS)
def test_a_lane_and_position_become_the_place_that_sumo_means(name):
    network = load_network(name)
    net = read_net(network.path)
    for row, lane_ids in enumerate(network.paths.lane_ids):
        origin = network.arms[network.paths.origin[row]].name
        destination = network.arms[network.paths.destination[row]].name
        for lane_id in lane_ids:
            raw = net.getLane(lane_id)
            for share in (0.0, 0.3, 0.99):
                found, s = network.paths.locate(origin, destination, lane_id, share * raw.getLength())
                at = share * sumolib.geomhelper.polyLength(raw.getShape())
                expected = sumolib.geomhelper.positionAtShapeOffset(raw.getShape(), at)
                x, y, _ = network.paths.pose(np.array(found), np.array(s))
                assert np.hypot(x - expected[0], y - expected[1]) < 0.06


@pytest.mark.parametrize("name", NETWORKS)
def test_paths_are_continuous(name):
    paths = load_network(name).paths
    steps = np.hypot(*np.moveaxis(np.diff(paths.xy, axis=1), -1, 0))
    assert steps.max() < 1.1 * SPACING
    assert steps.min() > 0.9 * SPACING
    assert np.abs(np.diff(paths.heading, axis=1)).max() < 0.25


@pytest.mark.parametrize("name", NETWORKS)
def test_stop_line_and_exit_are_where_the_inner_lanes_begin_and_end(name):
    network = load_network(name)
    rows = np.arange(network.paths.count)
    x, y, _ = network.paths.pose(rows, network.paths.stop_s)
    inner = np.array([network.inbound_lane(row).xy[-1] for row in rows])
    np.testing.assert_allclose(np.column_stack([x, y]), inner, atol=0.05)
    x, y, _ = network.paths.pose(rows, network.paths.exit_s)
    outer = np.array([network.outbound_lane(row).xy[0] for row in rows])
    np.testing.assert_allclose(np.column_stack([x, y]), outer, atol=0.05)
    assert np.all(network.paths.stop_s < network.paths.exit_s)
    assert np.all(network.paths.exit_s < network.paths.length)


def test_a_lane_without_a_way_stands_for_the_nearest_that_has_one():
    network = load_network("four_way")
    row, s = network.paths.locate("south", "west", "south_in_0", 50.0)
    assert (row, s) == network.paths.locate("south", "west", "south_in_1", 50.0)
    assert network.inbound_lane(row).id == "south_in_1"
    assert network.paths.locate("south", "west", "nowhere_0", 3.0) == (-1, 0.0)
    assert network.paths.locate("south", "west", "north_in_0", 3.0) == (-1, 0.0)


@settings(max_examples=60)
@given(st.integers(0, 15), st.floats(-30.0, 300.0))
def test_pose_interpolates_and_goes_straight_on(row, s):
    paths = load_network("four_way").paths
    x, y, psi = (float(v) for v in paths.pose(np.array(row), np.array(s)))
    ahead = [float(v) for v in paths.pose(np.array(row), np.array(s + 0.01))]
    assert np.hypot(ahead[0] - x, ahead[1] - y) == pytest.approx(0.01, rel=0.05)
    assert np.cos(psi - np.arctan2(ahead[1] - y, ahead[0] - x)) > 0.99


def test_pose_takes_any_shape():
    paths = load_network("t_junction").paths
    rows, s = np.arange(6).reshape(2, 3), np.linspace(0, 200, 6).reshape(2, 3)
    x, y, psi = paths.pose(rows, s)
    assert x.shape == y.shape == psi.shape == (2, 3)
    for index in np.ndindex(2, 3):
        assert [float(v[index]) for v in (x, y, psi)] == [float(v) for v in paths.pose(rows[index], s[index])]


def rows_of(network, origin, turn):
    return network.movement(origin, turn).rows


def test_right_of_way_on_the_priority_junction():
    network = load_network("four_way")
    yields = network.paths.yields
    straight = rows_of(network, "west", "straight")
    for minor in ("south", "north"):
        for turn in ("left", "straight"):
            for row in rows_of(network, minor, turn):
                assert yields[row, straight].all()
                assert not yields[straight, row].any()
    oncoming = rows_of(network, "east", "straight")
    left = rows_of(network, "west", "left")[0]
    assert yields[left, oncoming].all()
    assert not yields[oncoming, left].any()
    assert not yields[straight].any()


def test_right_of_way_on_the_equal_junction_is_mutual():
    yields = load_network("four_way_equal").paths.yields
    assert yields.any()
    np.testing.assert_array_equal(yields, yields.T)


def test_whoever_enters_the_roundabout_yields_to_whoever_is_on_it():
    network = load_network("roundabout")
    yields = network.paths.yields
    entering, passing = rows_of(network, "south", "right")[0], rows_of(network, "west", "straight")[0]
    assert yields[entering, passing]
    assert not yields[passing, entering]
