"""Which SVs the yielding layer brakes, in scenes made by hand; no SV hits an ego in an unusual pose."""

import math
from dataclasses import replace

import numpy as np
import pytest

from rudc.world.config import WorldConfig
from rudc.world.scene import EgoState, Kind
from rudc.world.yielding import must_yield
from rudc.world.yielding_kernels import FACED_M, STEADY
from tests.benchmarks.yielding import awkward_poses, fair_moment, stand, waiting
from tests.plans import PlanSource, event


def row_of(network, origin, turn):
    return network.movement(origin, turn).rows[0]


def before(network, row, place, away):
    """Arc length on a row at which a car's front is `away` m short of the nearest point to a place (m, m)."""
    stations = np.arange(0.0, network.paths.length[row], 0.25)
    x, y, _ = network.paths.pose(np.full(len(stations), row), stations)
    return float(stations[np.argmin(np.hypot(x - place[0], y - place[1]))]) - away - 2.5


@pytest.fixture
def crossing(make_scene, four_way):
    """Scene of an SV that comes from the west, `away` m short of where the ego's path crosses its own."""

    def make(away, v, *, ego_v=0.0, front=12.0, turn="straight", **changes):
        row = row_of(four_way, "west", "straight")
        route = four_way.route("south", turn)
        conflict = four_way.conflict(route)[row]
        x, y, _ = four_way.paths.pose(np.array([row]), np.array([0.5 * (conflict[2] + conflict[3])]))
        s = before(four_way, row, (x[0], y[0]), away)
        return replace(make_scene({"row": row, "s": s, "v": v}, front=front, v=ego_v, turn=turn), **changes)

    return make


def test_brakes_for_an_ego_that_stands_in_the_way(crossing):
    found = must_yield(crossing(14.0, 9.0, front=11.0))
    assert found.rows == found.for_ego == [0]
    assert 2.0 < found.deceleration[0] < 9.0


def test_brakes_for_the_ego_while_it_drives_past_somebody_else(crossing):
    """Who is beside a walker already cannot brake that away, and brakes for what is ahead all the same."""
    scene = crossing(4.0, 2.5, front=11.0)
    along = np.array([math.cos(scene.heading[0]), math.sin(scene.heading[0])])
    walker = scene.position[0] - 2.4 * along + 1.1 * np.array([-along[1], along[0]])
    beside = replace(
        scene,
        ids=(*scene.ids, "walker"),
        position=np.vstack([scene.position, walker]),
        heading=np.append(scene.heading, scene.heading[0]),
        velocity=np.vstack([scene.velocity, np.zeros(2)]),
        acceleration=np.zeros(2),
        size=np.vstack([scene.size, [0.5, 0.5]]),
        kind=np.append(scene.kind, Kind.PEDESTRIAN),
        path=np.append(scene.path, -1),
        path_s=np.append(scene.path_s, 0.0),
    )
    alone, passing = must_yield(scene), must_yield(beside)
    assert alone.rows == passing.rows == [0]
    assert passing.deceleration == alone.deceleration


def test_a_bus_that_turns_brakes_for_what_its_tail_would_sweep_over(make_scene, four_way):
    """Its ends are on its lane: in the bend its middle is inside of it, by more than its lane's line says."""
    row = row_of(four_way, "west", "right")
    paths = four_way.paths
    s = float(paths.stop_s[row]) - 8.0
    bus = {"row": row, "s": s, "v": 5.0, "size": (12.0, 2.5)}
    x, y, psi = (float(v) for v in four_way.route("west", "right").path.pose(s + 11.0))
    inside = x + 2.2 * math.sin(psi), y - 2.2 * math.cos(psi)
    bollard = {"at": (*inside, psi), "size": (0.4, 0.4)}
    alone = must_yield(make_scene(bus, origin="north", front=-60.0))
    assert alone.rows == []
    assert must_yield(make_scene(bus, bollard, origin="north", front=-60.0)).rows == [0]


def test_brakes_the_harder_the_nearer(crossing):
    far, near = (must_yield(crossing(away, 8.0, front=11.0)).deceleration[0] for away in (13.0, 9.0))
    assert near > far


def test_is_not_concerned_by_what_is_far(crossing):
    assert must_yield(crossing(40.0, 9.0, front=11.0)).rows == []


@pytest.mark.parametrize("front", [-1.0, 6.0])
def test_lets_an_ego_wait_where_it_should(crossing, front):
    """Before the stop line, and at the waiting point inside the junction."""
    assert must_yield(crossing(10.0, 9.0, front=front)).rows == []


def test_has_priority_over_an_ego_that_approaches_on_the_minor_road(crossing):
    assert must_yield(crossing(10.0, 9.0, front=-3.0, ego_v=6.0)).rows == []


def test_heeds_an_ego_that_is_committed(crossing):
    assert must_yield(crossing(10.0, 9.0, front=9.0, ego_v=5.0)).rows == [0]


@pytest.mark.parametrize(("front", "held"), [(9.0, True), (10.5, True), (18.0, False)])
def test_who_stands_sets_off_only_into_a_way_that_is_free_before_it_gets_there(crossing, front, held):
    found = must_yield(crossing(2.5, 0.0, front=front, ego_v=4.5))
    assert found.rows == ([0] if held else [])
    assert found.deceleration == [0.0] * held


def test_heeds_an_ego_off_its_lane(crossing):
    scene = crossing(10.0, 9.0, front=4.0, ego_v=5.0)
    assert must_yield(scene).rows == []
    assert must_yield(replace(scene, ego_offset=1.5)).rows == [0]


def test_yields_to_an_ego_on_the_major_road(make_scene, four_way):
    row = row_of(four_way, "south", "straight")
    route = four_way.route("west", "straight")
    conflict = four_way.conflict(route)[row]
    x, y, _ = four_way.paths.pose(np.array([row]), np.array([0.5 * (conflict[2] + conflict[3])]))
    s = before(four_way, row, (x[0], y[0]), 8.0)
    front = route.path.project(x[0], y[0])[0] - route.stop_line_s - 8.0
    scene = make_scene({"row": row, "s": s, "v": 8.0}, origin="west", front=front, v=8.0)
    assert must_yield(scene).rows == [0]
    assert must_yield(scene, ego_present=False).rows == []


def test_who_is_heedless_brakes_for_obstacles_only(crossing, make_scene, four_way):
    """It ran pedestrians over without braking."""
    scene = crossing(14.0, 9.0, front=11.0)
    assert must_yield(scene).rows == [0]
    assert must_yield(scene, heedless={scene.ids[0]}).rows == []
    row = row_of(four_way, "north", "straight")
    x, y, psi = (float(v) for v in four_way.paths.pose(np.int64(row), np.float64(60.0)))
    walks = {"at": (x, y, psi + 1.0), "kind": Kind.PEDESTRIAN, "size": (0.5, 0.5)}
    scene = make_scene({"row": row, "s": 45.0, "v": 9.0}, walks)
    assert must_yield(scene, heedless=scene.ids).rows == must_yield(scene).rows == [0]


@pytest.mark.parametrize("kind", [Kind.CAR, Kind.PEDESTRIAN, Kind.OBSTACLE])
def test_brakes_for_whatever_is_on_the_road(make_scene, four_way, kind):
    row = row_of(four_way, "north", "straight")
    x, y, psi = (float(v) for v in four_way.paths.pose(np.int64(row), np.float64(60.0)))
    car = {"row": row, "s": 45.0, "v": 9.0}
    size = (0.5, 0.5) if kind == Kind.PEDESTRIAN else (5.0, 1.8)
    in_way = {"at": (x, y, psi + 1.0), "kind": kind, "size": size}
    beside = {"at": (x + 8.0 * math.sin(psi), y - 8.0 * math.cos(psi), psi), "kind": kind, "size": size}
    found = must_yield(make_scene(car, in_way))
    assert (found.rows, found.for_ego) == ([0], [])
    assert must_yield(make_scene(car, beside)).rows == []
    walks_into = {
        **beside,
        "at": (x + 4.0 * math.sin(psi), y - 4.0 * math.cos(psi), psi + math.pi / 2),
        "v": 2.5,
    }
    assert must_yield(make_scene(car, walks_into)).rows == [0]


def test_who_stands_lets_one_who_walks_close_by_pass_first(make_scene, four_way):
    """A group crosses right before its bumper: it does not set off between two of them."""
    row = row_of(four_way, "north", "straight")
    x, y, psi = (float(v) for v in four_way.paths.pose(np.int64(row), np.float64(60.0)))
    along, beside = np.array([math.cos(psi), math.sin(psi)]), np.array([-math.sin(psi), math.cos(psi)])
    car = {"row": row, "s": 60.0, "v": 0.0}
    at = np.array([x, y]) + 2.9 * along
    walker = {"kind": Kind.PEDESTRIAN, "size": (0.5, 0.5), "v": 1.2}
    leaves = {**walker, "at": (*(at + 0.6 * beside), psi + math.pi / 2)}
    away = {**walker, "at": (*(at + 3.0 * beside), psi + math.pi / 2)}
    assert must_yield(make_scene(car, leaves)).rows == [0]
    assert must_yield(make_scene(car, away)).rows == []


@pytest.mark.parametrize(("turned", "brakes"), [(0.34, True), (0.0, False)])
def test_sees_it_beyond_the_junction_too(make_scene, four_way, turned, brakes):
    row, route = row_of(four_way, "south", "straight"), four_way.route("south", "straight")
    front = route.exit_s - route.stop_line_s + 12.0
    behind = {"row": row, "s": route.exit_s - 1.0, "v": 4.0}
    scene = make_scene(behind, turn="straight", front=front, v=0.0)
    ego = replace(scene.ego, x=scene.ego.x - 0.5, psi=scene.ego.psi + turned)
    found = must_yield(replace(scene, ego=ego, ego_offset=0.5))
    assert found.rows == [0] * brakes


def test_sees_the_rear_of_an_ego_that_stands_in_the_junction_and_goes_another_way(make_scene, four_way):
    """SUMO does not: on a lane that branches off there it would drive into that corner."""
    beside, behind = four_way.movement("south", "straight").rows

    def braking(row, front):
        follower = {"row": row, "s": float(four_way.paths.stop_s[row]) - 9.0, "v": 6.0}
        return must_yield(make_scene(follower, front=front, v=0.0, turn="left"))

    assert braking(behind, 3.0).rows == [0]
    assert braking(behind, 3.0).deceleration[0] > 2.0
    assert braking(behind, -1.0).rows == [], "before the stop line that is SUMO's business"
    assert braking(beside, 3.0).rows == [], "the ego turns left from the other lane"


def test_passes_an_obstacle_in_another_lane(make_scene, four_way):
    """Also when its own lane leads elsewhere and its place is told on the path of the lane beside."""
    row = row_of(four_way, "north", "straight")
    x, y, psi = (float(v) for v in four_way.paths.pose(np.int64(row), np.float64(60.0)))
    wall = {"at": (x, y, psi), "kind": Kind.OBSTACLE, "size": (10.0, 3.0)}
    scene = make_scene({"row": row, "s": 45.0, "v": 8.0}, wall)
    assert must_yield(scene).rows == [0]
    beside = scene.position.copy()
    beside[0] += 3.5 * np.array([-math.sin(psi), math.cos(psi)])
    assert must_yield(replace(scene, position=beside)).rows == []


def test_brakes_no_harder_than_the_road_allows(crossing):
    assert must_yield(crossing(3.0, 9.0, front=11.0), brake_most=1.2).deceleration == [1.2]


def test_one_that_creeps_in_the_junction_holds_before_one_that_passes(make_scene, four_way):
    slow, fast = row_of(four_way, "east", "left"), row_of(four_way, "west", "straight")
    here, past, of_slow, _ = four_way.conflict(four_way.route("west", "straight"))[slow]
    creeping = {"row": slow, "s": of_slow - 2.0, "v": 1.0}

    def found(other):
        return must_yield(make_scene(creeping, other, origin="north", front=-60.0)).rows

    assert found({"row": fast, "s": here - 6.0, "v": 9.0}) == [0]
    assert found({"row": fast, "s": here - 6.0, "v": 2.0}) == [], (
        "neither passes: they do not block each other"
    )
    assert found({"row": fast, "s": past + 6.0, "v": 9.0}) == [], "it has passed"
    assert found({"row": fast, "s": 80.0, "v": 9.0}) == [], "it is not there yet: SUMO's right of way decides"


@pytest.mark.parametrize(("turned", "brakes"), [(-0.34, True), (0.0, False)])
def test_sees_the_rear_of_an_ego_whose_front_is_in_the_lane_beside(make_scene, four_way, turned, brakes):
    """Before the stop line, where whoever queues behind the ego is left to SUMO."""
    row = row_of(four_way, "south", "left")
    behind = {"row": row, "s": four_way.route("south", "left").stop_line_s - 25.0, "v": 4.0}
    scene = make_scene(behind, turn="left", front=-12.0, v=0.0)
    ego = replace(scene.ego, x=scene.ego.x + 0.5, psi=scene.ego.psi + turned)
    found = must_yield(replace(scene, ego=ego, ego_offset=-0.5))
    assert found.rows == [0] * brakes


def test_spares_an_ego_in_awkward_poses(four_way, world):
    source = PlanSource(density=30.0, speed=(0.0, 0.0))
    results = []
    for seed in range(3):
        origin = world.reset(source.plan(seed)).route.origin
        for pose in awkward_poses(four_way, origin).values():
            world.reset(source.plan(seed))
            results.append(stand(world, pose))
    assert results.count("hit") == 0
    assert results.count("spared") > 10


def test_who_disregards_the_right_of_way_still_keeps_its_distance(four_way, world):
    """Behind an ego that stands between two lanes, where SUMO sees it in neither; not before one across its
    way.
    """
    source = PlanSource(density=30.0, speed=(0.0, 0.0), events=(event("priority_violation", vehicle="all"),))
    results = {"between two lanes": [], "in the junction, at 45 degrees": []}
    for seed in range(6):
        for name, found in results.items():
            pose = awkward_poses(four_way, world.reset(source.plan(seed)).route.origin)[name]
            found.append(stand(world, pose))
            assert world.happenings()[0].bodies
    assert "hit" not in results["between two lanes"]
    assert results["between two lanes"].count("spared") > 2
    assert "hit" in results["in the junction, at 45 degrees"]


def test_without_the_layer_it_is_hit(four_way, world_on):
    source, world = PlanSource(density=30.0, speed=(0.0, 0.0)), world_on(config=WorldConfig(yielding=False))
    results = []
    for seed in range(4):
        pose = awkward_poses(four_way, world.reset(source.plan(seed)).route.origin)["between two lanes"]
        results.append(stand(world, pose))
    assert "hit" in results


def test_never_brakes_for_an_ego_that_waits_where_it_should(world):
    assert waiting(world, 2, 30.0) == 0


def test_a_standing_ego_off_the_road_is_nobodys_business(crossing):
    scene = crossing(10.0, 9.0)
    away = replace(scene, ego=EgoState(60.0, 60.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0))
    assert must_yield(away).rows == []


def test_brakes_for_a_nose_in_its_lane_though_the_lanes_never_meet(make_scene, four_way):
    """The ego stopped in the junction, 0.9 m beside its line and turned by 28 degrees; who comes is on the
    lane beside."""
    route, row = four_way.route("south", "straight", 1), four_way.movement("north", "straight").rows[1]
    assert np.isnan(four_way.conflict(route)[row]).all()
    s, psi = route.stop_line_s + 11.5, 0.5 * math.pi
    x, y, _ = (float(value) for value in route.path.pose(s))
    coming = {"row": row, "s": before(four_way, row, (x - 3.0, y + 2.0), 12.0), "v": 8.0}
    scene = replace(make_scene(coming, turn="straight", v=0.0), route=route, ego_s=s)
    straight = replace(scene.ego, x=x, y=y, psi=psi)
    assert must_yield(replace(scene, ego=straight)).rows == []
    turned = replace(straight, x=x - 0.9, psi=psi + 0.49)
    found = must_yield(replace(scene, ego=turned, ego_offset=0.9))
    assert found.rows == [0]
    assert found.deceleration[0] > 1.5


def test_who_creeps_passes_closer_to_an_ego_that_stands(make_scene, four_way):
    """Two that turn left and wait opposite each other: one stood for good where it had 0.2 m to pass."""
    row = row_of(four_way, "north", "left")
    stations = np.arange(0.0, four_way.paths.length[row], 0.25)
    x, y, _ = four_way.paths.pose(np.full(len(stations), row), stations)
    s = float(stations[np.argmin(np.hypot(x - 5.8, y - 0.1))])
    waiting_m = four_way.route("east", "left").waiting_s - four_way.route("east", "left").stop_line_s

    def held(v, *, beside=-0.5):
        other = {"row": row, "s": s, "v": v}
        scene = make_scene(other, origin="east", turn="left", front=waiting_m - 2.9, v=0.0)
        ego = replace(scene.ego, y=scene.ego.y + beside)
        return must_yield(replace(scene, ego=ego, ego_offset=-beside)).rows == [0]

    assert not held(0.0)
    assert held(2.0), "faster, it keeps its distance"
    assert held(0.0, beside=-0.8), "and where there is no room it stands"


@pytest.fixture
def face_to_face(make_scene, four_way):
    """Scene of an ego that drives left of its lane, in that of an SV which comes from the north; `gap` m
    between their fronts."""
    row = max(four_way.movement("north", "straight").rows, key=lambda row: four_way.paths.xy[row, -1, 0])

    def make(gap, v, *, beside=3.5, turned=0.0):
        scene = make_scene(front=-40.0, v=3.0, turn="left")
        ego = replace(scene.ego, x=scene.ego.x - beside, psi=scene.ego.psi + turned)
        s = before(four_way, row, (ego.x, ego.y + 2.5), gap)
        scene = make_scene({"row": row, "s": s, "v": v}, front=-40.0, v=3.0, turn="left")
        return replace(scene, ego=ego, ego_offset=beside)

    return make


def test_stops_early_for_an_ego_that_comes_in_its_lane(face_to_face):
    """Who goes round something comes back only if the other leaves it room before it."""
    early = must_yield(face_to_face(FACED_M + 10.0, 8.0))
    assert early.rows == [0]
    assert early.deceleration[0] == pytest.approx(8.0**2 / (2 * 10.0), rel=0.1)
    assert must_yield(face_to_face(FACED_M + 30.0, 8.0)).rows == [], "not before it must"
    near = must_yield(face_to_face(FACED_M - 5.0, 1.0))
    assert near.rows == [0], "and does not come nearer"
    assert near.deceleration[0] == STEADY


def test_does_not_stop_early_for_an_ego_that_leaves_it_its_lane(face_to_face):
    assert must_yield(face_to_face(FACED_M, 8.0)).rows == [0]
    assert must_yield(face_to_face(FACED_M, 8.0, beside=1.2)).rows == []
    assert must_yield(face_to_face(FACED_M + 2.0, 4.0, turned=0.5 * math.pi)).rows == [], "nor who crosses"


def test_in_traffic_too_an_ego_in_the_oncoming_lane_keeps_room_before_it(four_way, world):
    """It stands there for 20 s: nobody who comes in that lane comes nearer than half of FACED_M."""
    source, met = PlanSource(density=30.0, speed=(0.0, 0.0)), 0
    for seed in range(4):
        origin = world.reset(source.plan(seed)).route.origin
        pose = awkward_poses(four_way, origin)["in the oncoming lane"]
        assert fair_moment(world, pose)
        assert not len(rooms_before(world.scene(), pose)), "whoever is there already cannot"
        world.put_ego(*pose)
        least = math.inf
        for _ in range(200):
            world.advance(np.zeros(2))
            least = min(least, rooms_before(world.scene(), pose).min(initial=math.inf))
        assert least > 0.5 * FACED_M
        met += least < FACED_M + 10.0
    assert met > 1, "somebody did come"


def rooms_before(scene, pose):
    """(K,) m between the front of an ego at a pose and of those who face it in its lane, up to 40 m away."""
    psi, away = pose[2], scene.position - pose[:2]
    before = away[:, 0] * math.cos(psi) + away[:, 1] * math.sin(psi)
    beside = away[:, 1] * math.cos(psi) - away[:, 0] * math.sin(psi)
    facing = np.cos(scene.heading - psi) < -0.7
    room = before - 0.5 * (scene.size[:, 0] + scene.vehicle.length)
    return room[(before > 0.0) & (room < 40.0) & (np.abs(beside) < 2.5) & facing]
