"""Events on lanes that bend, and on arms of several edges."""

import math
from dataclasses import replace

import libsumo
import numpy as np
import pytest

from rudc.geometry import rectangle_corners
from rudc.network.build import build_network
from rudc.network.network import load_network
from rudc.network.polyline import beside
from rudc.world.events.places import against_lane
from rudc.world.fitting import _misplaced
from rudc.world.world import World
from tests.plans import PlanSource, event
from tests.world.networks import bent, in_pieces

EMPTY = PlanSource(density=0.0, speed=(0.0, 0.0))


def test_a_closure_follows_its_lane_round_a_bend(tmp_path):
    network = load_network(bent(tmp_path))
    lane = network.lane("north_in_0")
    closure = event("lane_closure", lane="north_in_0", at=5, length=40)
    with World(network) as world:
        world.reset(replace(EMPTY, events=(closure,)).plan(0))
        scene = world.scene()
        blocks = [name for name in world._sumo.vehicles() if name.startswith("block")]
        assert sum(libsumo.vehicle.getLength(name) for name in blocks) == pytest.approx(40.0, abs=2.0)
    corners = rectangle_corners(scene.position, scene.heading, scene.size).reshape(-1, 2)
    aside = beside(lane.xy, corners)[1]
    assert np.abs(aside).max() < 0.5 * lane.width + 0.4
    assert scene.size[:, 0].sum() == pytest.approx(40.0)


def test_a_closure_of_a_bent_lane_ends_on_it(tmp_path):
    network = load_network(bent(tmp_path))
    stretch = network.stretch("north_out_0")
    assert stretch.pieces(5.0, 15.0) == 1
    assert stretch.pieces(5.0, 45.0) > 2


def test_against_a_lane_a_way_follows_all_edges_of_its_arm(tmp_path):
    network = load_network(in_pieces(tmp_path))
    route = network.route("south", "left")
    for name, at in (("east_in_0", 5.0), ("east_out_0", 60.0), ("east_out_0", 0.0)):
        stretch = network.stretch(name, route)
        way = against_lane(network, route, name, at)
        assert way[0] == pytest.approx(stretch.place(at)[:2])
        opposite = network.stretch("west_in_0" if name == "east_out_0" else name)
        assert way[-2] == pytest.approx(opposite.place(opposite.reach)[:2], abs=0.2)


@pytest.mark.parametrize("name", ["east_out_0", "east_in_0", "east_to_west_0"])
def test_a_wrong_way_driver_can_back_out_of_the_road(name, tmp_path):
    """By the lane it came on, or, from before or inside the junction, through it and out."""
    network = load_network(in_pieces(tmp_path))
    wrong = event("wrong_way", lane=name, at=5, speed=5)
    with World(network) as world:
        world.reset(replace(EMPTY, events=(wrong,)).plan(0))
        world.advance(np.zeros(2))
        (driver,) = world.stage.props
        stretch = network.stretch(name)
        x, y, heading = driver.pose(driver.appeared_m - driver.travelled)
        assert (x, y) == pytest.approx(stretch.place(5.0)[:2], abs=0.1)
        assert math.cos(heading - stretch.place(5.0)[2]) < -0.99
        x, y, _ = driver.pose(-driver.travelled)
        assert math.hypot(x - network.center[0], y - network.center[1]) > 110.0, "at the end of an arm"
        assert network.surface.depth(x, y) > 0.0 or math.hypot(x, y) > 118.0


def test_a_wrong_way_driver_who_begins_at_the_end_of_its_road_gives_up_as_others_do():
    """There is no way behind it; it stood there for good."""
    with World(load_network("four_way")) as world:
        end = world.network.stretch("west_out_0").reach
        stands = event("accident", vehicles=[{"lane": "west_out_0", "at": end - 11.0}])
        wrong = event("wrong_way", lane="west_out_0", at=end, speed=5)
        world.reset(replace(EMPTY, origin="east", turn="right", events=(stands, wrong)).plan(0))
        world.advance(np.zeros(2))
        assert any(prop.moves for prop in world.stage.props)
        for _ in range(200):
            world.advance(np.array([-6.0, 0.0]))
        assert [prop.name for prop in world.stage.props] == ["accident0:0"]


def test_what_stands_far_out_on_an_arm_of_several_edges_closes_its_lane_for_traffic(tmp_path):
    network = load_network(in_pieces(tmp_path))
    stalled = event("stalled_vehicle", lane="east_in_0", at=80)
    with World(network) as world:
        world.reset(replace(EMPTY, events=(stalled,)).plan(0))
        assert [name for name in world._sumo.vehicles() if name.startswith("block")]


def test_the_way_against_a_lane_that_winds_leaves_out_nothing(tmp_path):
    network = load_network(bent(tmp_path))
    lane = network.lane("north_in_0")
    way = network.stretch("north_in_0").against(10.0)
    s, aside = beside(lane.xy, way)
    assert (np.diff(s) < 0.0).all()
    assert np.abs(aside).max() < 0.1


def test_outbound_traffic_drives_to_the_outer_end_of_its_arm(tmp_path):
    network = load_network(in_pieces(tmp_path))
    with World(network) as world:
        world.reset(EMPTY.plan(0))
        for arm in network.arms:
            assert libsumo.route.getEdges(f"leave:{arm.name}") == arm.out_edges


def test_a_crossing_far_out_needs_the_lanes_at_both_sides_of_its_arm_only(tmp_path):
    text = "".join(
        f'<edge id="{a}_{b}" from="{a}" to="{b}" speed="10" numLanes="{lanes}"/>'
        for a, b, lanes in (
            ("c", "m", 3), ("m", "e", 1), ("e", "m", 1), ("m", "c", 1), ("c", "w", 1), ("w", "c", 1),
            ("c", "s", 1), ("s", "c", 1),
        )
    )  # fmt: skip
    nodes = {"c": (0, 0), "m": (40, 0), "e": (150, 0), "w": (-100, 0), "s": (0, -100)}
    rows = "".join(f'<node id="{k}" x="{x}" y="{y}" type="priority"/>' for k, (x, y) in nodes.items())
    (tmp_path / "own.nod.xml").write_text(f"<nodes>{rows}</nodes>")
    (tmp_path / "own.edg.xml").write_text(f"<edges>{text}</edges>")
    network = load_network(build_network(tmp_path))
    crossing = event("pedestrian_crossing", arm="east", at=80)
    reach = [network.stretch(f"east_out_{k}").reach for k in range(3)]
    assert min(reach) < 40.0 < 80.0 < reach[0], "a lane leads nowhere"
    assert _misplaced(network, list(network.movements), ("events", 0), crossing) == []
