"""Lines over sharp turns between narrow roads: on a network as netconvert makes it, with no help of ours."""

import numpy as np
import pytest

from rudc.geometry import rectangle_corners
from rudc.network.build import build_network
from rudc.network.conflicts import through_waiting
from rudc.network.network import load_network, shipped_networks
from rudc.network.route_builder import fits
from rudc.vehicle import EgoVehicle

BODY = EgoVehicle()
ENDS = {"n": (12, 140), "e": (140, 20), "se": (95, -100), "s": (-20, -140), "w": (-140, 5)}


@pytest.fixture(scope="module")
def five(tmp_path_factory):
    """Five arms with lanes of 3 m, two of them 40 degrees apart; corners as netconvert rounds them."""
    folder = tmp_path_factory.mktemp("five")
    nodes = [f'<node id="{name}" x="{x}" y="{y}"/>' for name, (x, y) in ENDS.items()]
    (folder / "five.nod.xml").write_text(
        f'<nodes><node id="C" x="0" y="0" type="priority"/>{"".join(nodes)}</nodes>'
    )
    road = 'numLanes="1" speed="8.33" width="3.0"'
    edges = [
        f'<edge id="{name}_{way}" from="{a}" to="{b}" {road}/>'
        for name in ENDS
        for way, a, b in (("in", name, "C"), ("out", "C", name))
    ]
    (folder / "five.edg.xml").write_text(f"<edges>{''.join(edges)}</edges>")
    return load_network(str(build_network(folder)))


def test_every_turn_can_be_driven_and_keeps_the_car_on_the_road(five):
    assert len(five.movements) == 20
    for movement in five.movements:
        route = five.route(movement.origin, movement.destination)
        path = route.path
        assert fits(five, path, BODY, margin=0.0), movement
        assert np.abs(path.curvature).max() < 1.15 * BODY.tightest, movement


def test_a_lane_that_runs_far_away_in_the_junction_stays_as_it_is(tmp_path):
    """A point of its shape lost its decimal point, as in the fuzzer's network 907, over which `network
    check` hung.
    """
    text = shipped_networks()["four_way"].read_text(encoding="utf-8")
    assert "-5.25,-14.25" in text
    (tmp_path / "far.net.xml").write_text(text.replace("-5.25,-14.25", "-5.25,-1425"), encoding="utf-8")
    network = load_network(str(tmp_path / "far.net.xml"))
    straight = network.route("north", "straight")
    assert straight.exit_s - straight.stop_line_s > 1000.0
    assert np.abs(straight.path.curvature).max() > BODY.tightest, "nor is it mended"


def test_the_car_lies_between_the_edges_of_its_route(five):
    for movement in five.movements:
        route = five.route(movement.origin, movement.destination)
        near = (route.path.s > route.stop_line_s - 20) & (route.path.s < route.exit_s + 20)
        xy, psi = route.path.body_pose(route.path.s[near], BODY)
        corners = rectangle_corners(xy, psi, np.broadcast_to([BODY.length, BODY.width], xy.shape))
        for k, s in enumerate(route.path.s[near]):
            for corner in corners[k]:
                at, aside = route.path.project(float(corner[0]), float(corner[1]), float(s))
                left = np.interp(at, route.path.s, route.left_width)
                right = np.interp(at, route.path.s, route.right_width)
                assert -right - 0.1 < aside < left + 0.1, (movement, s)


def test_those_who_wait_at_the_stop_lines_have_room(tmp_path):
    """A right turn by 110 degrees, between lanes of 3.1 m, went through the car at the stop line of the arm
    that it enters: the two stood nose to nose."""
    ends = {"e": (200, 0), "w": (-200, 0), "s": (-41, -113)}
    nodes = [f'<node id="{name}" x="{x}" y="{y}"/>' for name, (x, y) in ends.items()]
    edges = [
        f'<edge id="{name}_{way}" from="{a}" to="{b}" numLanes="1" width="3.1"/>'
        for name in ends
        for way, a, b in (("in", name, "C"), ("out", "C", name))
    ]
    (tmp_path / "tee.nod.xml").write_text(
        f'<nodes><node id="C" x="0" y="0" type="priority" radius="4"/>{"".join(nodes)}</nodes>'
    )
    (tmp_path / "tee.edg.xml").write_text(f"<edges>{''.join(edges)}</edges>")
    tee = load_network(str(build_network(tmp_path)))
    for movement in tee.movements:
        route = tee.route(movement.origin, movement.destination)
        assert not through_waiting(route.path, tee.paths, route.row).any(), movement
        assert np.abs(route.path.curvature).max() < 1.15 * BODY.tightest, movement
