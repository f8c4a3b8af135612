import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from rudc.network import polyline
from rudc.network.network import load_network, shipped_networks
from rudc.network.surface import MARGIN, Surface
from rudc.network.tiles import CELL, SIDE

NETWORKS = sorted(shipped_networks())
AROUND = CELL * np.array([[0.5, 0.5], [0.5, -0.5], [-0.5, 0.5], [-0.5, -0.5]])
"""m, from the middle of a cell to its corners"""


def brute_force_distance(polygons, boundary, xy):
    """Signed distance to the union's boundary, piece by piece."""
    start, step = boundary[:, 0], boundary[:, 1] - boundary[:, 0]
    share = np.clip(np.sum((xy - start) * step, axis=1) / np.sum(step * step, axis=1), 0.0, 1.0)
    gap = np.hypot(*(start + share[:, None] * step - xy).T).min()
    return gap if polyline.in_any(polygons, xy[None])[0] else -gap


@pytest.mark.parametrize("name", NETWORKS)
@settings(max_examples=75)
@given(st.floats(-60.0, 60.0), st.floats(-60.0, 60.0))
@example(3.125, 3.125)
def test_signed_distance_is_that_to_the_polygons_boundary(name, x, y):
    surface = load_network(name).surface
    xy = np.array([x, y])
    expected = brute_force_distance(surface.polygons, surface.boundary, xy)
    corners = [brute_force_distance(surface.polygons, surface.boundary, corner) for corner in xy + AROUND]
    bend = abs(np.mean(corners) - expected)  # where another edge becomes the nearest: interpolation misses it
    told = max(float(surface.signed_distance(xy)), 1.0 - MARGIN)  # constant beyond
    assert told == pytest.approx(max(expected, 1.0 - MARGIN), abs=0.1 + bend)


@pytest.mark.parametrize("name", NETWORKS)
@settings(max_examples=50)
@given(st.floats(-60.0, 60.0), st.floats(-60.0, 60.0))
@example(1.1875, 26.125)
def test_the_projection_lies_on_the_edge_as_far_away_as_stated(name, x, y):
    surface = load_network(name).surface
    xy = np.array([x, y])
    nearest = surface.project(xy)
    assert abs(float(surface.signed_distance(nearest))) < 0.12
    expected = abs(brute_force_distance(surface.polygons, surface.boundary, xy))
    assert np.hypot(*(nearest - xy)) == pytest.approx(expected, abs=1e-6)


@pytest.mark.parametrize("name", NETWORKS)
def test_queries_of_many_points_are_those_of_each(name):
    surface = load_network(name).surface
    xy = np.random.default_rng(1).uniform(-200, 200, (3, 5, 2))
    distance, nearest = surface.signed_distance(xy), surface.project(xy)
    assert distance.shape == (3, 5)
    for index in np.ndindex(3, 5):
        assert float(surface.signed_distance(xy[index])) == distance[index]
        np.testing.assert_array_equal(surface.project(xy[index]), nearest[index])


@pytest.mark.parametrize("name", NETWORKS)
def test_the_edge_has_no_gaps_and_no_pieces_inside(name):
    """A lane's middle, from end to end, is nowhere near an edge, nor is the seam between an arm's lanes."""
    network = load_network(name)
    for arm in network.arms:
        lane = network.lanes[arm.in_lanes[-1]]
        seam = polyline.offset_polyline(polyline.resample(lane.xy, np.arange(0.0, 90.0, 0.1)), lane.width / 2)
        assert network.surface.signed_distance(seam).min() > 1.6
    for row in range(network.paths.count):
        s = np.arange(0.0, network.paths.length[row], 0.25)
        x, y, _ = network.paths.pose(np.full(len(s), row), s)
        assert network.surface.signed_distance(np.column_stack([x, y])).min() > 1.2


@pytest.mark.parametrize("name", NETWORKS)
def test_lane_direction_is_that_of_the_lane_and_nan_elsewhere(name):
    network = load_network(name)
    for arm in network.arms:
        for lane_id in (*arm.in_lanes, *arm.out_lanes):
            lane = network.lanes[lane_id]
            middle = 0.5 * (lane.xy[:-1] + lane.xy[1:])
            heading = np.arctan2(*np.diff(lane.xy, axis=0).T[::-1])
            error = [network.surface.direction(x, y) for x, y in middle] - heading
            np.testing.assert_allclose(np.cos(error), 1.0, atol=0.01)
    assert np.isnan(network.surface.direction(1000.0, 1000.0))
    assert np.isnan(network.surface.direction(*network.center))


def test_the_road_does_not_end_at_an_arms_outer_end():
    network = load_network("four_way")
    end = network.lane("south_in_1").xy[0]
    assert float(network.surface.signed_distance(end - [0.0, 5.0])) > 1.5
    assert float(network.surface.signed_distance(end - [0.0, 11.0])) < 0.0


def test_a_road_of_ten_kilometres_costs_what_is_looked_at():
    """The raster of its bounding box would have 1.6e9 points."""
    along = polyline.strip(np.array([[-5000.0, -5000.0], [5000.0, 5000.0]]), 7.0)
    across = polyline.strip(np.array([[-5000.0, 5000.0], [5000.0, -5000.0]]), 7.0)
    surface = Surface([along, across], [(np.array([[-5000.0, -5000.0], [5000.0, 5000.0]]), along)])
    assert surface.depth(1000.0, 1000.0) == pytest.approx(3.5, abs=0.01)
    assert surface.depth(4000.0, -4010.0) == pytest.approx(3.5 - 10.0 / np.sqrt(2), abs=0.01)
    assert surface.direction(-2000.0, -2001.0) == pytest.approx(np.pi / 4, abs=1e-6)
    assert len(surface._tiles) == 3


@pytest.mark.parametrize("name", NETWORKS)
def test_distances_go_on_across_the_borders_of_tiles(name):
    surface = load_network(name).surface
    border = SIDE * np.floor(load_network(name).center / SIDE)
    for shift in ([1e-9, 0.0], [0.0, 1e-9]):
        xy = border + np.linspace(-40.0, 40.0, 200)[:, None] * np.sign(shift)[::-1]
        np.testing.assert_allclose(
            surface.signed_distance(xy - shift), surface.signed_distance(xy + shift), atol=1e-8
        )


@pytest.mark.parametrize("name", NETWORKS)
def test_one_point_is_looked_up_as_many_are(name):
    network = load_network(name)
    for x, y in network.center + np.random.default_rng(2).uniform(-300.0, 300.0, (50, 2)):
        xy = np.array([x, y])
        assert network.surface.depth(x, y) == pytest.approx(
            float(network.surface.signed_distance(xy)), abs=1e-9
        )


@pytest.mark.parametrize(("size", "filled"), [(1.0, True), (6.0, False)])
def test_a_hole_between_lanes_is_road_and_an_island_is_not(size, filled):
    """Four pieces of road round a square that none of them covers."""
    half, far = 0.5 * size, 20.0
    south_north = [(-far, -far, far, -half), (-far, half, far, far)]
    west_east = [(-far, -half, -half, half), (half, -half, far, half)]
    pieces = [np.array([(a, b), (c, b), (c, d), (a, d)]) for a, b, c, d in south_north + west_east]
    surface = Surface(pieces, [])
    assert surface.depth(0.0, 0.0) == pytest.approx(far if filled else -half, abs=0.1)
    assert (np.abs(surface.boundary).max(axis=(1, 2)).min() > far - 0.01) == filled
