"""Giving way where a course enters ground that its route does not touch; on scenes made by hand."""

# ruff: noqa: F811 -- fixtures come by import
import math
from dataclasses import replace

import numpy as np
import pytest

from rudc.agents.courses import Courses, _entry, along
from rudc.agents.gap_acceptance import GapAcceptance
from rudc.agents.gaps import ACCELERATION, OTHERS_ACCELERATION, PULLS_OUT, crossing, entering, suffices
from rudc.env.tracking import RESPONSE_S, speeds_in_bends
from rudc.geometry import Rectangles
from rudc.network.course import CoursePlanner
from rudc.network.network import load_network
from rudc.world.ego import EgoPlant
from rudc.world.scene import STANDING, Kind
from tests.world.conftest import four_way, make_scene  # noqa: F401 -- fixtures
from tests.world.networks import with_limits


@pytest.fixture(scope="module")
def rows(four_way):
    """Rows straight on from the south: in the ego's own lane, and in the lane beside."""
    route = four_way.route("south", "straight")
    beside = [
        row
        for row in four_way.movement("south", "straight").rows
        if four_way.inbound_lane(row).index != four_way.inbound_lane(route.row).index
    ]
    return route.row, beside[0]


def truck(four_way):
    """A truck that stands in the lane by which the ego leaves."""
    route = four_way.route("south", "straight")
    x, y, psi = (float(v) for v in route.path.pose(route.exit_s + 15.0))
    return {"at": (x, y, psi), "size": (12.0, 2.5), "kind": Kind.TRUCK}


def shown(four_way, scene):
    """The scene along a course round the truck, and the guard's verdict on full acceleration."""
    courses = Courses()
    courses.reset(scene)
    seen = courses.see(scene)
    assert courses.course is not None
    return seen, courses.govern(seen, np.array([2.0, 0.0]))


@pytest.fixture(scope="module")
def slow_to_the_north(tmp_path_factory):
    """four_way, with 5 m/s on the north arm and 13.9 m/s elsewhere."""
    folder = tmp_path_factory.mktemp("limits")
    return load_network(with_limits(folder, lambda edge: 5.0 if edge.startswith("north") else 13.9))


def test_beyond_the_junction_the_limit_there_counts(make_scene, slow_to_the_north):
    """The limit before the junction counted for good: 13.9 m/s was driven where 5 are allowed."""
    driver = GapAcceptance()
    for front, wanted in ((-20.0, 8.0), (40.0, 5.0)):
        scene = make_scene(front=front, v=5.0, network=slow_to_the_north)
        assert scene.ego_s > scene.route.exit_s or front < 0.0
        a = float(driver.act(scene).u[0])
        assert a == pytest.approx(min((wanted - 5.0) / RESPONSE_S, ACCELERATION), abs=1e-9)


def test_who_comes_out_of_a_slow_road_is_expected_to_speed_up(make_scene, slow_to_the_north):
    """Beyond the junction too, others were assumed to keep to the limit before it."""
    paths = slow_to_the_north.paths
    (row, *_) = slow_to_the_north.movement("north", "left").rows
    inside, beyond = float(paths.stop_s[row]) + 1.0, float(paths.exit_s[row]) + 1.0
    limits = paths.highest_limit(
        np.array([row] * 3), np.array([inside, inside, beyond]), np.array([inside, beyond, inside])
    )
    assert limits.tolist() == [5.0, 13.9, 13.9]


def test_a_slow_vehicle_takes_longer_to_be_gone(make_scene, four_way):
    """Gaps were judged as if every vehicle could drive 8.5 m/s."""
    row = four_way.movement("west", "straight").rows[0]
    other = {"row": row, "s": float(four_way.paths.stop_s[row]) - 45.0, "v": 9.0}
    may_go = []
    for vehicle in (four_way.vehicle, replace(four_way.vehicle, v_max=3.0)):
        scene = make_scene(other, front=-1.0, v=0.0, vehicle=vehicle)
        may_go.append(suffices(scene, crossing(scene), speeds_in_bends(scene.route.path)).all())
    assert may_go == [True, False]


def test_who_speeds_up_hard_goes_on_doing_so(make_scene, four_way):
    """It was held to speed up with 1.5 m/s2 at most, and came earlier."""
    row = four_way.movement("west", "straight").rows[0]

    def least(acceleration):
        """m, from which on a gap before who comes at 5 m/s and speeds up so is long enough."""
        for metres in np.arange(10.0, 100.0, 1.0):
            other = {"row": row, "s": float(four_way.paths.stop_s[row]) - metres, "v": 5.0}
            scene = make_scene(other, front=-1.0, v=0.0, acceleration=np.array([acceleration]))
            if suffices(scene, crossing(scene), speeds_in_bends(scene.route.path)).all():
                return metres
        return math.inf

    assert least(-2.0) == least(0.0) == least(OTHERS_ACCELERATION)
    assert least(3.0) > least(2.2) > least(0.0) + 1.0


def test_on_a_poor_road_the_ego_takes_longer_to_be_gone(make_scene, four_way):
    """Gaps were judged as if it sped up as on a dry one."""
    row = four_way.movement("west", "straight").rows[0]
    ice = replace(four_way.vehicle, a_min=-0.9, a_max=0.9)

    def least(vehicle):
        """m, from which on a gap before who comes at 9 m/s is long enough."""
        for metres in np.arange(10.0, 100.0, 1.0):
            other = {"row": row, "s": float(four_way.paths.stop_s[row]) - metres, "v": 9.0}
            scene = make_scene(other, front=-1.0, v=0.0, vehicle=vehicle)
            if suffices(scene, crossing(scene), speeds_in_bends(scene.route.path)).all():
                return metres
        raise AssertionError

    assert least(ice) > least(four_way.vehicle) + 9.0


@pytest.mark.parametrize("front", [-14.0, -10.0])
def test_gap_acceptance_waits_at_its_line_on_a_poor_road_too(make_scene, four_way, front):
    ice = replace(four_way.vehicle, a_min=-1.5, a_max=1.5)
    row = four_way.movement("west", "straight").rows[0]
    other = {"row": row, "s": float(four_way.paths.stop_s[row]) + 4.0, "v": 1.5}
    scene = make_scene(other, turn="left", front=front, v=4.5, vehicle=ice)
    plant, s, driver = EgoPlant(ice), scene.ego_s, GapAcceptance()
    plant.resume(scene.ego, plant.actuation)
    for _ in range(80):
        x, y, psi = map(float, scene.route.path.pose(s))
        ego = replace(plant.state, x=x, y=y, psi=psi)
        u = driver.act(replace(scene, ego=ego, ego_s=s)).u
        s += 0.05 * (ego.v + plant.step(float(u[0]), 0.0, 0.1).v)
    assert plant.state.v < STANDING
    assert s + 0.5 * ice.length < scene.route.waiting_s + 0.6


@pytest.mark.parametrize("offset", [-6.0, 0.0, 6.0])
def test_who_drives_beside_is_let_past(make_scene, four_way, rows, offset):
    for front, stops in ((-10.0, False), (22.0, True)):
        alone = make_scene(truck(four_way), front=front, v=7.0)
        s = alone.ego_s + offset
        with_neighbour = make_scene(truck(four_way), {"row": rows[1], "s": s, "v": 7.0}, front=front, v=7.0)
        _, free = shown(four_way, alone)
        _, held = shown(four_way, with_neighbour)
        assert held[0] <= free[0]
        assert (held[0] < free[0] - 0.5) or not stops


def test_those_far_behind_ahead_or_in_the_own_lane_hinder_nobody(make_scene, four_way, rows):
    ego_s = make_scene(front=8.0).ego_s
    _, free = shown(four_way, make_scene(truck(four_way), front=8.0, v=7.0))
    for row, s in ((rows[1], ego_s - 60.0), (rows[1], ego_s + 45.0), (rows[0], ego_s - 15.0)):
        scene = make_scene(truck(four_way), {"row": row, "s": s, "v": 7.0}, front=8.0, v=7.0)
        _, u = shown(four_way, scene)
        assert u[0] == pytest.approx(free[0])


def test_only_what_the_route_itself_does_not_touch_is_the_courses_own(make_scene, four_way, rows):
    route = four_way.route("south", "straight")
    scene = make_scene({"row": rows[1], "s": 100.0}, {"row": rows[0], "s": 60.0}, front=-10.0)
    assert entering(scene, route) is None
    body = truck(four_way)
    standing = Rectangles(np.array([body["at"][:2]]), np.array([body["at"][2]]), np.array([body["size"]]))
    nobody = Rectangles(np.zeros((0, 2)), np.zeros(0), np.zeros((0, 2)))
    course = CoursePlanner(four_way, route, scene.vehicle).plan(
        scene.ego_s, 0.0, 0.0, standing, nobody, nobody
    )
    assert course is not None
    found = entering(along(scene, course), route)
    assert found is not None
    assert len(found.ego_in) == 1
    assert found.merges.all()
    assert found.yields.all()


def test_the_ego_waits_for_wider_ones_farther_from_their_ground(make_scene, four_way, rows):
    """They need all of their lane, and an ego that pulls out stood with a corner in it."""
    body, route = truck(four_way), four_way.route("south", "straight")
    standing = Rectangles(np.array([body["at"][:2]]), np.array([body["at"][2]]), np.array([body["size"]]))
    nobody = Rectangles(np.zeros((0, 2)), np.zeros(0), np.zeros((0, 2)))
    before, after = {}, set()
    for width in (1.8, 2.5):
        other = {"row": rows[1], "s": 100.0, "size": (5.0, width)}
        scene = make_scene(other, front=-10.0)
        planner = CoursePlanner(four_way, route, scene.vehicle)
        course = planner.plan(scene.ego_s, 0.0, 0.0, standing, nobody, nobody)
        assert course is not None
        found = entering(along(scene, course), route)
        assert found is not None
        before[width] = float(found.ego_in[0])
        after.add(float(found.ego_out[0]))
    own = make_scene().vehicle.width
    assert before[1.8] - before[2.5] == pytest.approx(PULLS_OUT * (2.5 - own))
    assert own >= 1.8
    assert len(after) == 1, "it leaves their ground where it does"


def test_who_has_crept_onto_others_ground_a_little_still_gives_way_there(make_scene, four_way, rows):
    """It drove off before a car that came at 15 m/s since its front was 1 mm over the line."""
    body, route = truck(four_way), four_way.route("south", "straight")
    standing = Rectangles(np.array([body["at"][:2]]), np.array([body["at"][2]]), np.array([body["size"]]))
    nobody = Rectangles(np.zeros((0, 2)), np.zeros(0), np.zeros((0, 2)))
    scene = make_scene({"row": rows[1], "s": 60.0, "v": 15.0}, front=-40.0)
    course = CoursePlanner(four_way, route, scene.vehicle).plan(
        scene.ego_s, 0.0, 0.0, standing, nobody, nobody
    )
    assert course is not None
    shown = along(scene, course)
    found = entering(shown, route)
    assert found is not None
    line = shown.ego_s + float(found.ego_in[0])

    def room(beyond, v, where=course):
        ego = replace(shown.ego, v=v)
        there = replace(shown, ego_s=line + beyond, ego=ego, route=where)
        return _entry(there, route, np.full(len(course.path.s), 15.0))

    assert room(-2.0, 0.0) == pytest.approx(2.0 - 0.3)
    assert room(0.5, 0.0) == room(0.5, 1.0) == 0.0
    assert room(0.5, 3.0) == room(1.5, 0.0) == math.inf
    in_the_junction = replace(course, stop_line_s=0.0, exit_s=course.length)
    assert room(0.5, 0.0, in_the_junction) == math.inf
