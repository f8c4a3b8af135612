"""To whom an ego gives way where the right of way is silent: junctions so skewed that bodies on ways straight
on towards each other overlap, as netconvert makes them."""

import math
from dataclasses import replace

import numpy as np
import pytest

from rudc.agents.approach import ready_to_wait
from rudc.agents.gaps import crossing, suffices
from rudc.env.tracking import speeds_in_bends
from rudc.geometry import rectangle_gaps
from rudc.network.build import build_network
from rudc.network.conflicts import PASSING, silent, through_waiting
from rudc.network.network import load_network, shipped_networks
from rudc.network.route_builder import _lines
from rudc.vehicle import EgoVehicle
from rudc.world.scene import EgoState, Kind, Scene

ANGLES = (0.0, 100.0, 148.0, 255.0)
"""deg, directions of the arms"""


@pytest.fixture(scope="module")
def skewed(tmp_path_factory):
    """Four arms of one lane each way, with small corners; the first and the third are the main road, which
    bends by 32 degrees.
    """
    folder = tmp_path_factory.mktemp("skewed")
    nodes = ['<node id="centre" x="0" y="0" type="priority" radius="3"/>']
    edges = []
    for k, angle in enumerate(ANGLES):
        x, y = 120 * math.cos(math.radians(angle)), 120 * math.sin(math.radians(angle))
        nodes.append(f'<node id="end{k}" x="{x:.1f}" y="{y:.1f}"/>')
        for way, start, end in (("in", f"end{k}", "centre"), ("out", "centre", f"end{k}")):
            edges.append(
                f'<edge id="{way}{k}" from="{start}" to="{end}" numLanes="1" speed="11" width="2.8" '
                f'priority="{1 if k % 2 else 2}"/>'
            )
    (folder / "skewed.nod.xml").write_text(f"<nodes>{''.join(nodes)}</nodes>")
    (folder / "skewed.edg.xml").write_text(f"<edges>{''.join(edges)}</edges>")
    return load_network(str(build_network(folder)))


def routes(network):
    return [network.route(movement.origin, movement.destination) for movement in network.movements]


def bodies_meet(network, route, row):
    """Whether two cars, one on the route and one on the row, can be closer than PASSING at the junction."""
    paths, body = network.paths, EgoVehicle()
    ours, its_pose = np.arange(route.stop_line_s - 8.0, route.exit_s + 8.0, 0.5), []
    for s in np.arange(paths.stop_s[row] - 5.0, paths.exit_s[row] + 8.0, 0.5):
        (x, u), (y, v), _ = paths.pose(np.full(2, row), s + np.array([2.5, -2.5]))
        its_pose.append((0.5 * (x + u), 0.5 * (y + v), math.atan2(y - v, x - u)))
    its_pose, size = np.array(its_pose), np.tile([body.length, body.width], (len(its_pose), 1))
    for (x, y), psi in zip(*route.path.body_pose(ours, body), strict=True):
        near = rectangle_gaps(x, y, psi, body.length, body.width, its_pose[:, :2], its_pose[:, 2], size)
        if (near < PASSING).any():
            return True
    return False


@pytest.mark.parametrize("name", sorted(shipped_networks()))
def test_in_shipped_networks_the_right_of_way_says_it_all(name):
    network = load_network(name)
    paths = network.paths
    for route in routes(network):
        must = paths.yields[route.row] & (paths.origin != paths.origin[route.row])
        np.testing.assert_array_equal(network.gives_way(route, route.row), must)


def test_who_meets_the_ego_with_nothing_said_is_given_way_to(skewed):
    paths, found = skewed.paths, 0
    for route in routes(skewed):
        met = np.flatnonzero(np.isfinite(silent(route.path, paths, route.row)[:, 0]))
        others = np.flatnonzero(paths.origin != paths.origin[route.row])
        for row in set(others) - set(met):
            said = paths.yields[route.row, row] or paths.yields[row, route.row]
            assert said or not bodies_meet(skewed, route, row)
        for row in met:
            assert not paths.yields[route.row, row]
            assert not paths.yields[row, route.row]
            assert skewed.gives_way(route, route.row)[row]
            assert bodies_meet(skewed, route, row)
        must = paths.yields[route.row] & (paths.origin != paths.origin[route.row])
        assert skewed.gives_way(route, route.row)[must].all()
        found += len(met)
    assert found >= 4


def test_a_line_that_keeps_out_of_their_way_is_taken_before_a_wider_arc(skewed):
    better = 0
    for movement in skewed.movements:
        route = skewed.route(movement.origin, movement.destination)
        row, paths = route.row, skewed.paths
        ends = float(paths.stop_s[row]), float(paths.exit_s[row])
        lines = list(_lines(skewed, skewed.centre_line(row), *ends, movement, EgoVehicle()))
        met = [
            (np.isfinite(silent(line, paths, row)[:, 0]) | through_waiting(line, paths, row)).sum()
            for line in lines
        ]
        chosen = int(np.argmin(met))
        np.testing.assert_array_equal(route.path.xy, lines[chosen].xy)
        better += chosen > 0
    assert better >= 1


def test_an_ego_comes_ready_to_stop_before_somebody_of_whom_nothing_is_said(skewed):
    """And does not slow down where nobody comes."""
    paths, u, held = skewed.paths, np.array([2.0, 0.0]), 0
    for route in routes(skewed):
        table = silent(route.path, paths, route.row)
        for row in np.flatnonzero(np.isfinite(table[:, 0])):
            near = scene(skewed, route, int(row), float(table[row, 2]) - 10.0)
            near = replace(near, ego_s=float(table[row, 0]) - 14.5)
            found = crossing(near)
            assert found is not None
            assert found.yields.all()
            assert found.silent.all()
            if suffices(near, found, speeds_in_bends(route.path), margin=0.0, acceleration=2.0).all():
                continue
            held += 1
            assert ready_to_wait(near, u)[0] < 1.0
            assert ready_to_wait(scene(skewed, route, int(row), paths.length[row] - 1.0), u)[0] == 2.0
    assert held >= 5


def test_where_it_swings_out_before_its_turn_it_stops_before_it_does(skewed):
    """It met those who leave by the arm that it comes from before its stop line, and gave way to nobody: the
    two stood nose to nose for good."""
    u, early = np.array([2.0, 0.0]), 0
    for route in routes(skewed):
        table = silent(route.path, skewed.paths, route.row)
        for row in np.flatnonzero(table[:, 0] < route.stop_line_s - 1.0).tolist():
            there = replace(scene(skewed, route, row, float(table[row, 2])), ego_s=float(table[row, 0]) - 6.0)
            slow = replace(there, ego=replace(there.ego, v=5.0))
            assert ready_to_wait(slow, u)[0] < 0.0
            past = replace(slow, ego_s=float(table[row, 0]) - 2.0)
            assert ready_to_wait(past, u)[0] == 2.0, "it cannot stop there any more"
            early += 1
    assert early >= 1


def scene(network, route, row, s):
    """An ego at 9 m/s, 12 m before its waiting point, and a car at 6 m/s on the row."""
    ego_s = route.waiting_s - 14.5
    x, y, psi = (float(value) for value in route.path.pose(ego_s))
    pose = [float(value) for value in network.paths.pose(row, s)]
    return Scene(
        time_s=3.0, timeout_s=40.0, ego=EgoState(x, y, psi, 9.0, 0.0, 0.0, 0.0, 0.0), vehicle=EgoVehicle(),
        route=route, ego_s=ego_s, ego_offset=0.0, waited_s=0.0, last_u=np.zeros(2), network=network,
        ids=("other",), position=np.array([pose[:2]]), heading=np.array([pose[2]]),
        velocity=6.0 * np.array([[math.cos(pose[2]), math.sin(pose[2])]]), acceleration=np.zeros(1),
        size=np.array([[5.0, 1.8]]), kind=np.array([int(Kind.CAR)]), path=np.array([row]),
        path_s=np.array([s]),
    )  # fmt: skip
