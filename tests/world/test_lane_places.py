"""Events on lanes inside the junction, in a roundabout, or relative to the ego; ways across an arm."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest

from rudc.data import data_folder
from rudc.errors import NetworkError
from rudc.geometry import rectangle_corners
from rudc.network.network import Network, load_network
from rudc.network.polyline import arc_length, in_any, resample
from rudc.scenario import load_scenario
from rudc.scenario.events.stage import ROADSIDE_M
from rudc.world.events.places import across_arm, against_lane
from rudc.world.fitting import misfits
from rudc.world.scene import Kind
from rudc.world.vehicle_types import VEHICLE_TYPES
from tests.plans import PlanSource, event
from tests.world.networks import by_heading, two_lane_ring
from tests.world.test_world import follow

HELD_OUT = data_folder("results") / "held-out-19" / "networks"
CROSSKEYS = HELD_OUT / "crosskeys" / "crosskeys.net.xml"
EMPTY = PlanSource(density=0.0, speed=(0.0, 0.0))
STAND = np.array([-6.0, 0.0])


def placed(world, source, *names, seconds=0.0):
    """Poses (x, y, heading) of named things `seconds` into the episode."""
    scene = world.reset(source.plan(0))
    for _ in range(round(seconds / 0.1)):
        world.advance(STAND)
        scene = world.scene()
    rows = [scene.ids.index(name) for name in names]
    return [(*scene.position[i], scene.heading[i]) for i in rows]


def test_lanes_about_the_ego_are_those_of_the_route_it_drives(world):
    for origin, turn in (("south", "left"), ("east", "straight"), ("west", "right")):
        lanes = ("ego_in", "ego_out", "left_of_ego")
        accident = event("accident", vehicles=[{"lane": lane, "at": 6} for lane in lanes])
        source = replace(EMPTY, origin=origin, turn=turn, events=(accident,))
        poses = placed(world, source, *(f"accident0:{i}" for i in range(3)))
        route = world.scene().route
        for (x, y, _), expected in zip(poses[:2], (route.stop_line_s - 6, route.exit_s + 6), strict=True):
            s, offset = route.path.project(x, y)
            assert s == pytest.approx(expected, abs=0.2)
            assert offset == pytest.approx(0.0, abs=0.2)
        s, offset = route.path.project(*poses[2][:2])
        assert s == pytest.approx(route.stop_line_s - 6, abs=0.2)
        assert offset == pytest.approx(3.5, abs=0.3)


def test_things_stand_inside_the_junction_and_on_a_ring(world):
    stalled = event("stalled_vehicle", lane="south_to_west_0", at=10)
    source = replace(EMPTY, origin="south", turn="left", events=(stalled,))
    assert placed(world, source, "stalled_vehicle0:0") == [
        pytest.approx(world.network.place_on_lane("south_to_west_0", 10.0))
    ]
    closure = event("lane_closure", lane="west_to_north_0", at=2, length=20)
    world.reset(replace(source, events=(closure,)).plan(0))
    scene = world.scene()
    assert scene.count > 3
    near = [world.network.place_on_lane("west_to_north_0", s)[:2] for s in np.arange(2.0, 22.0, 0.5)]
    away = [min(math.dist(place, spot) for place in near) for spot in scene.position]
    assert max(away) < 0.5, "its pieces follow the bend"
    assert scene.size[:, 0].sum() == pytest.approx(20.0)


def test_things_stand_on_a_lane_of_a_ring_into_which_nobody_turns(world_on, tmp_path):
    world = world_on(str(two_lane_ring(tmp_path)))
    lane = world.network.lane("ring_east_1")
    assert not any(lane.id in ids for ids in world.network.paths.lane_ids)
    (tmp_path / "own.yaml").write_text(
        f"name: own\nnetwork: {world.network.path}\nevents:\n"
        f"  - {{kind: stalled_vehicle, lane: {lane.id}, at: 10}}\n"
        f"  - {{kind: lane_closure, lane: {lane.id}, at: 15, length: 10}}\n"
        f"  - {{kind: wrong_way, lane: ring_north_1, at: 20}}\n"
    )
    world.reset(load_scenario(tmp_path / "own.yaml", fit=misfits).plan(0))
    world.advance(STAND)
    scene = world.scene()
    things = [i for i, name in enumerate(scene.ids) if ":" in name]
    events = {scene.ids[i].partition(":")[0][:-1] for i in things}
    assert events == {"stalled_vehicle", "lane_closure", "wrong_way"}
    for x, y in scene.position[things]:
        assert math.hypot(x, y) == pytest.approx(math.hypot(*lane.xy[len(lane.xy) // 2]), abs=0.4)
    x, y, heading = world.network.place_on_lane(lane.id, 10.0)
    i = scene.ids.index("stalled_vehicle0:0")
    assert (*scene.position[i], scene.heading[i]) == pytest.approx((x, y, heading))


def test_a_ring_is_driven_the_wrong_way_round(world_on):
    wrong = event("wrong_way", lane="ring_south_0", at=12, speed=5)
    source = replace(EMPTY, network="roundabout", origin="north", turn="right", events=(wrong,))
    before = placed(world_on("roundabout"), source, "wrong_way0:0", seconds=0.5)[0]
    after = placed(world_on("roundabout"), source, "wrong_way0:0", seconds=3.0)[0]
    at, ahead = (math.atan2(y, x) for x, y, _ in (before, after))
    assert ahead < at, "clockwise"
    assert math.hypot(*after[:2]) == pytest.approx(16.0, abs=4.0)


def test_reach_position_on_a_lane(world):
    when = {"reach_position": {"lane": "ego_in", "at": 20, "tolerance": 2}}
    surge = event("density_surge", density=50, when=when)
    for origin in ("south", "east"):
        source = replace(EMPTY, origin=origin, turn="straight", speed=(8.0, 8.0), events=(surge,))
        scene = world.reset(source.plan(0))
        while world.traffic.density < 50 and scene.time_s < 6:
            last = scene
            world.advance(np.zeros(2))
            scene = world.scene()
        assert scene.route.stop_line_s - last.ego_s == pytest.approx(20 + 1.6, abs=0.8)


def test_the_egos_distance_to_a_place_is_negative_once_it_is_past_it(world_on):
    """On a ring, where the distance to the junction says nothing of the way out."""
    world = world_on("roundabout")
    source = replace(EMPTY, network="roundabout", origin="south", turn="left", speed=(8.0, 8.0))
    x, y, _ = world.network.place_on_lane("west_out_0", 6.0)
    centre = world.network.center
    places = {"lane": "ego_out", "at": 6}, {"position": [x - centre[0], y - centre[1]]}
    for place, metres in itertools.product(places, (12.0, -3.0)):
        surge = event("density_surge", density=50, when={"ego_distance_to_place": place | {"below": metres}})
        scene = world.reset(replace(source, events=(surge,)).plan(0))
        while world.traffic.density < 50:
            last = scene
            world.advance(follow(scene))
            scene = world.scene()
        ahead = last.route.path.project(x, y)[0] - last.ego_s - 0.5 * last.vehicle.length
        assert metres - 1.0 < ahead < metres
    elsewhere = {"ego_distance_to_place": {"lane": "east_out_0", "at": 20, "below": 900}}
    east = event("density_surge", density=50, when=elsewhere)
    world.reset(replace(source, events=(east,)).plan(0))
    for _ in range(100):
        world.advance(follow(world.scene()))
    assert world.traffic.density < 50, "it is not on its way"


@pytest.mark.parametrize(("kind", "size"), [("bicycle", Kind.BICYCLE), ("motorcycle", Kind.MOTORCYCLE)])
def test_vehicles_cross_the_arm_one_behind_the_other(world, kind, size):
    crossing = event("vehicle_crossing", arm="ego_out", type=kind, at=6, speed=5, count=2, from_side="left")
    source = replace(EMPTY, origin="south", turn="straight", events=(crossing,))
    scene = world.reset(source.plan(0))
    seen = {}
    while scene.time_s < 8:
        for i, name in enumerate(scene.ids):
            assert scene.kind[i] == size
            seen.setdefault(name, []).append(
                (scene.time_s, *scene.position[i], math.hypot(*scene.velocity[i]))
            )
        world.advance(STAND)
        scene = world.scene()
    first, second = (np.array(seen[f"vehicle_crossing0:{k}"]) for k in (0, 1))
    assert world.network.surface.signed_distance(first[:1, 1:3])[0] < 0, "it begins beside the road"
    assert first[:, 3] == pytest.approx(5.0)
    # Left of who drives towards the junction from the north is the east, where traffic leaves by that arm.
    assert first[0, 1] > 7.0
    assert first[-1, 1] < -7.0
    assert np.ptp(first[:, 2]) < 0.1
    gap = np.interp(0.0, -second[:, 1], second[:, 0]) - np.interp(0.0, -first[:, 1], first[:, 0])
    assert gap == pytest.approx(1.2 + VEHICLE_TYPES[kind].length / 5.0, abs=0.05)


@pytest.mark.parametrize(("kind", "length"), [("vehicle_crossing", 1.8), ("pedestrian_crossing", 0.0)])
def test_a_gap_in_s_is_left_between_one_and_the_next(world, kind, length):
    crossing = event(kind, arm="north", at=6, speed=2, count=2, gap=3)
    scene = world.reset(replace(EMPTY, origin="south", turn="right", events=(crossing,)).plan(0))
    apart = []
    while scene.time_s < 12:
        if scene.count == 2:
            apart.append(float(np.hypot(*np.diff(scene.position, axis=0)[0])))
        world.advance(STAND)
        scene = world.scene()
    assert apart[len(apart) // 2] == pytest.approx(length + 3.0 * 2.0, abs=0.05)


def test_what_crosses_may_be_of_another_size(world):
    """A hospital bed, which the file calls a bicycle."""
    crossing = event("vehicle_crossing", arm="north", at=6, speed=2, count=2, size=[2.2, 1.1])
    scene = world.reset(replace(EMPTY, origin="south", turn="right", events=(crossing,)).plan(0))
    first, both = None, []
    while scene.time_s < 12:
        assert all(size == (2.2, 1.1) for size in map(tuple, scene.size.tolist()))
        if scene.count and first is None:
            first = scene.position[:1].copy()
        if scene.count == 2:
            both.append(float(np.hypot(*np.diff(scene.position, axis=0)[0])))
        world.advance(STAND)
        scene = world.scene()
    assert both[len(both) // 2] == pytest.approx(2.2 + 1.2 * 2.0, abs=0.05)
    edge = -world.network.surface.signed_distance(first)[0]
    assert edge == pytest.approx(1.5 + 0.5 * 2.2, abs=0.25), "its front begins at the roadside"


@pytest.mark.parametrize("kind", ["bicycle", "car", "bus"])
def test_who_crosses_is_there_until_no_part_of_it_is_on_the_road(world, kind):
    """A bus was gone as soon as its centre was off the road."""
    crossing = event("vehicle_crossing", arm="north", type=kind, at=6, speed=5)
    scene = world.reset(replace(EMPTY, origin="south", turn="right", events=(crossing,)).plan(0))
    body, places = VEHICLE_TYPES[kind], []
    while scene.time_s < 8:
        places += zip(scene.position, scene.heading, strict=True)
        world.advance(STAND)
        scene = world.scene()
    assert scene.count == 0
    corners = rectangle_corners(*places[-1], np.array([body.length, body.width]))
    last_step = 0.5
    wanted = 1.5 - (0.5 * body.length if kind == "bicycle" else 0.0)
    assert -world.network.surface.signed_distance(corners).max() == pytest.approx(
        wanted - last_step / 2, abs=0.3
    )


@pytest.mark.parametrize(("at_m", "room"), [(4.0, True), (1.0, False), (-8.0, False)])
def test_who_crosses_needs_room_from_its_rear_to_where_it_can_stop_and_no_farther(world, at_m, room):
    """What had to be free lay half its length too far on. Its front begins at the roadside; from 5 m/s it
    needs 3.4 m to stop."""
    crossing = event(
        "vehicle_crossing", arm="north", type="bus", at=6, speed=5, when={"simulation_time": {"above": 0.05}}
    )
    world.reset(replace(EMPTY, origin="south", turn="right", events=(crossing,)).plan(0))
    first, last = world.stage.across_arm("north", 6.0)
    at = first + (at_m + 0.25) * (last - first) / np.linalg.norm(last - first)
    stands = replace(
        world.scene(), time_s=0.1, ids=("there",), position=at[None], velocity=np.zeros((1, 2)),
        heading=np.zeros(1), acceleration=np.zeros(1), size=np.array([[0.5, 0.5]]), kind=np.zeros(1, int),
        path=np.zeros(1, int), path_s=np.zeros(1),
    )  # fmt: skip
    assert bool(world._script.step(stands)) is room


def test_crossing_cyclists_cross_where_the_ego_leaves(world):
    scenario = load_scenario("crossing_cyclists")
    met = 0
    for seed in range(10):
        scene = world.reset(scenario.plan(seed))
        route = scene.route
        while scene.time_s < 14 and not any(name.startswith("vehicle_crossing") for name in scene.ids):
            # 7 m/s along the path, whatever is there
            world.put_ego(*(float(v) for v in route.path.pose(scene.ego_s + 0.7)), 7.0)
            world.advance(np.zeros(2))
            scene = world.scene()
        rows = [i for i, name in enumerate(scene.ids) if name == "vehicle_crossing0:0"]
        met += bool(rows)
        for i in rows:
            s, _ = route.path.project(*scene.position[i])
            assert 3.0 < s - route.exit_s < 11.0
    assert met == 10


@pytest.mark.parametrize("network", ["four_way", "t_junction", "roundabout", str(CROSSKEYS)])
def test_a_wrong_way_driver_stays_on_the_road_to_the_end_of_an_arm(network):
    """It went dead straight on: over fields, or over the island of a roundabout."""
    network = load_network(network)
    route = network.route(network.arms[0].name, network.movements[0].destination)
    begins = np.array([network.lanes[name].xy[0] for arm in network.arms for name in arm.in_lanes])
    for lane in (name for arm in network.arms for name in (*arm.in_lanes, *arm.out_lanes)):
        farthest = against_lane(network, route, lane, network.stretch(lane).reach)
        assert np.isfinite(farthest).all() and len(farthest) > 2  # noqa: PT018 - from the very end, too
        way = against_lane(network, route, lane, 40.0)
        s = arc_length(way)
        on = network.surface.signed_distance(resample(way, np.arange(0.0, s[-2], 1.0)))
        assert on.min() > 1.0
        assert network.surface.depth(*way[-1]) < -4.0
        assert np.hypot(*(begins - way[-2]).T).min() < 0.6


def test_who_crosses_an_arm_comes_from_beside_its_bus_lanes():
    """Also where these are roads of their own beside it."""
    network = Network(HELD_OUT / "bleachfield" / "bleachfield.net.xml")
    assert {*network.left_out} == {"west_in_0", "east_out_0", "contra_in_0", "contra_out_0"}
    route = network.route("south", "right")
    ends = across_arm(network, route, "east", 36.0)
    assert not in_any([lane.area for lane in network.reserved], ends).any()
    edges = ends - ROADSIDE_M * np.array([1.0, -1.0])[:, None] * (ends[0] - ends[1]) / math.dist(*ends)
    inwards = 0.3 * (ends.mean(axis=0) - ends) / math.dist(*ends)
    assert in_any([lane.area for lane in network.reserved], edges + 2.0 * inwards).all(), "right beside them"
    with pytest.raises(NetworkError, match="closed to cars"):
        network.stretch("contra_in_0")


def test_an_arm_is_crossed_where_it_is_also_if_its_lanes_ids_are_names_of_others(tmp_path):
    network = Network(by_heading(tmp_path))
    assert network.arm("south").in_edge == "north_in"
    for arm, side in (("north", 1.0), ("south", -1.0)):
        ends = across_arm(network, network.route("east", "left"), arm, 20.0)
        assert (side * ends[:, 1] > 20.0).all()
