"""Courses round bodies, judged by exact rectangles (shapely) and by the car that has to drive them."""

import math
import pickle

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from rudc.geometry import Rectangles, rectangle_corners, rectangle_gaps
from rudc.network.course import REACH, CoursePlanner, gaps_along
from rudc.network.network import load_network
from rudc.vehicle import EgoVehicle
from tests.world.networks import with_pockets

BODY = EgoVehicle()
NOBODY = Rectangles(np.zeros((0, 2)), np.zeros(0), np.zeros((0, 2)))


def bodies(*poses, size=(5.0, 1.8)):
    return Rectangles(
        np.array([pose[:2] for pose in poses]),
        np.array([pose[2] for pose in poses]),
        np.tile(size, (len(poses), 1)),
    )


def beside(route, s, offset, turned=0.0):
    x, y, psi = (float(v) for v in route.path.pose(s))
    return x - offset * math.sin(psi), y + offset * math.cos(psi), psi + turned


def least_gap(course, standing):
    """m, of a car that follows the course, at every 0.25 m, to any of the bodies."""
    s = np.arange(0.0, course.length, 0.25)
    xy, psi = course.path.body_pose(s, BODY)
    return min(
        float(rectangle_gaps(*xy[i], psi[i], BODY.length, BODY.width, *standing).min()) for i in range(len(s))
    )


def on_the_road(network, course, first, last):
    """Whether every corner of a car that follows the course from first to last m stays on the carriageway."""
    s = np.arange(first, last, 0.5)
    xy, psi = course.path.body_pose(s, BODY)
    corners = rectangle_corners(xy, psi, np.tile([BODY.length, BODY.width], (len(s), 1)))
    return network.surface.signed_distance(corners.reshape(-1, 2)).min() >= 0.0


@pytest.fixture(scope="module")
def left():
    network = load_network("four_way")
    route = network.route("south", "left")
    return network, route, CoursePlanner(network, route, BODY)


def test_a_free_road_gives_the_reference_path(left):
    _, route, planner = left
    course = planner.plan(80.0, 0.0, 0.0, NOBODY, NOBODY, NOBODY)
    assert course is not None
    for s in np.arange(80.0, 150.0, 5.0):
        x, y, _ = course.path.pose(course.path.project(*(float(v) for v in route.path.pose(s)[:2]))[0])
        assert (
            math.hypot(float(x) - float(route.path.pose(s)[0]), float(y) - float(route.path.pose(s)[1])) < 0.1
        )


def test_where_the_number_of_lanes_changes_the_road_goes_on(tmp_path):
    """What lies between two edges of an arm was no carriageway: nowhere within REACH of it was a course."""
    network = load_network(with_pockets(tmp_path))
    route = network.route("west", "straight")
    planner = CoursePlanner(network, route, BODY)
    start = route.exit_s - 15.0
    assert planner.plan(start, 0.0, 0.0, NOBODY, NOBODY, NOBODY) is not None
    standing = bodies(beside(route, route.exit_s + 12.0, 0.0))
    course = planner.plan(start, 0.0, 0.0, standing, NOBODY, NOBODY)
    assert course is not None
    assert least_gap(course, standing) > 0.3
    assert on_the_road(network, course, start, start + 60.0)


@pytest.mark.parametrize("at", [-10.0, 0.0, 8.0, 16.0, 35.0])
@pytest.mark.parametrize("offset", [-0.6, 0.0, 0.6])
def test_a_body_anywhere_in_the_lane_is_passed_on_the_road(left, at, offset):
    network, route, planner = left
    standing = bodies(beside(route, route.stop_line_s + at, offset, 0.2))
    start = route.stop_line_s + min(at, 0.0) - 30.0
    course = planner.plan(start, 0.0, 0.0, standing, NOBODY, NOBODY)
    assert course is not None
    assert least_gap(course, standing) > 0.3
    assert on_the_road(network, course, start, start + 75.0)
    first = int(2 * start)
    assert (
        np.abs(course.path.curvature[first : first + 150]).max() < math.tan(BODY.delta_max) / BODY.wheelbase
    )


def test_a_road_blocked_from_edge_to_edge_has_no_course(left):
    _, route, planner = left
    s = route.exit_s + 15.0
    standing = bodies(*(beside(route, s, offset, math.pi / 2) for offset in (-4.5, 0.0, 4.5)))
    assert planner.plan(90.0, 0.0, 0.0, standing, NOBODY, NOBODY) is None


@pytest.mark.parametrize("before_end", [30.0, 50.0, 70.0])
def test_where_the_road_ends_soon_there_are_courses_too(left, before_end):
    network, route, planner = left
    start = route.length - before_end
    standing = bodies(beside(route, start + 14.0, 0.6))
    course = planner.plan(start, 0.0, 0.0, standing, NOBODY, NOBODY)
    assert course is not None
    assert least_gap(course, standing) > 0.3
    assert on_the_road(network, course, start, start + 25.0)


def test_a_course_departs_where_it_has_left_its_route(left):
    network, route, planner = left
    standing = bodies(beside(route, route.exit_s + 20.0, 0.0))
    course = planner.plan(route.exit_s - 10.0, 0.0, 0.0, standing, NOBODY, NOBODY)
    assert course is not None
    table, whole = network.departure(course), network.conflict(course)
    rows = np.flatnonzero(np.isfinite(table[:, 0]))
    assert len(rows)
    for s in table[rows, :2].ravel():
        x, y, _ = course.path.pose(s)
        assert abs(route.path.project(float(x), float(y))[1]) > 0.4
    assert (table[rows, 0] >= whole[rows, 0]).all()
    assert (table[rows, 1] <= whole[rows, 1]).all()
    assert (table[rows, 0] > whole[rows, 0] + 20.0).any()
    assert not np.isfinite(network.departure(route)).any()


def test_on_the_lane_of_oncoming_traffic_a_course_gives_way_as_it_departs_and_not_as_at_the_junction():
    network = load_network("four_way")
    route = network.route("south", "straight")
    planner = CoursePlanner(network, route, BODY, may_cross_centre=True)
    s = route.stop_line_s - 8.0
    closed = bodies(beside(route, s, 0.0), beside(route, s, 3.2))  # both lanes of its half of the road
    course = planner.plan(s - 25.0, 0.0, 0.0, closed, NOBODY, NOBODY)
    assert course is not None
    assert course.path.departs.any()
    towards = network.paths.destination == network.paths.origin[route.row]
    assert np.isfinite(network.departure(course)[towards, 0]).any()
    assert not np.isfinite(network.silent(course, route.row)[towards, 0]).any()


def test_who_comes_the_wrong_way_counts_where_it_is_said_to(left):
    _, route, planner = left
    in_junction = bodies(beside(route, 0.5 * (route.stop_line_s + route.exit_s), 0.0))
    assert planner.plan(90.0, 0.0, 0.0, in_junction, NOBODY, NOBODY) is not None
    course = planner.plan(90.0, 0.0, 0.0, NOBODY, in_junction, NOBODY)
    assert course is not None
    assert least_gap(course, in_junction) == 0.0
    course = planner.plan(90.0, 0.0, 0.0, NOBODY, NOBODY, in_junction)
    assert course is not None
    assert least_gap(course, in_junction) > 0.3
    beyond = bodies(beside(route, route.exit_s + 20.0, 0.0), size=(40.0, 1.8))
    course = planner.plan(90.0, 0.0, 0.0, NOBODY, beyond, NOBODY)
    assert course is not None
    _, gap = gaps_along(course.path, course.exit_s, 90.0 + REACH - BODY.length, BODY, beyond)
    assert gap.min() > 0.25


@pytest.mark.parametrize("before_the_end", [30.0, 16.0, 10.0, 6.0])
def test_a_course_comes_back_to_its_route_wherever_what_is_planned_ends(before_the_end):
    network = load_network("four_way")
    route = network.route("south", "left")
    planner = CoursePlanner(network, route, BODY, may_cross_centre=True)
    wall = route.exit_s + 10.0
    standing = bodies(beside(route, wall, -1.0), size=(8.0, 4.0))
    start = wall + before_the_end - REACH
    course = planner.plan(start, 0.0, 0.0, standing, NOBODY, NOBODY)
    assert course is not None
    x, y, _ = route.path.pose(wall)
    assert abs(course.path.project(float(x), float(y))[1]) > 2.0, "it goes round"
    for s in np.arange(wall + 45.0, route.length - 1.0):
        x, y, _ = route.path.pose(s)
        assert abs(course.path.project(float(x), float(y))[1]) < 0.3
    assert least_gap(course, standing) > 0.2
    assert on_the_road(network, course, start, course.length - BODY.length)


@settings(max_examples=25, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    st.lists(
        st.tuples(st.floats(-20.0, 40.0), st.floats(-4.0, 4.0), st.floats(-math.pi, math.pi)),
        min_size=1,
        max_size=3,
    ),
    st.floats(60.0, 90.0),
    st.floats(-0.5, 0.5),
)
@example([(4.23, -0.76, -1.63)], 72.57, 0.18)
@example([(19.95, -2.19, 2.42), (3.9, -0.21, -2.09), (7.87, -1.78, 1.78)], 64.06, 0.03)
def test_what_comes_out_is_clear_on_the_road_and_starts_at_the_car(left, places, s, offset):
    network, route, planner = left
    standing = bodies(*(beside(route, route.stop_line_s + at, away, turned) for at, away, turned in places))
    course = planner.plan(s, offset, 0.0, standing, NOBODY, NOBODY)
    if course is None:
        return
    x, y, _ = beside(route, s, offset)
    start, away = course.path.project(x, y)
    assert abs(away) < 0.15
    assert on_the_road(network, course, start, start + 75.0)
    _, gap = gaps_along(course.path, start + 3.0, start + 75.0, BODY, standing)
    assert gap.min() > 0.25


def test_gaps_along_agree_with_rectangles_one_by_one(left):
    _, route, _ = left
    standing = bodies(beside(route, 100.0, 2.5, 0.3), beside(route, 120.0, -2.2, 1.0))
    s, gap = gaps_along(route.path, 80.0, 140.0, BODY, standing)
    for k in range(0, len(s), 7):
        (x, y), psi = route.path.body_pose(s[k], BODY)
        exact = float(rectangle_gaps(x, y, psi, BODY.length, BODY.width, *standing).min())
        assert gap[k] == pytest.approx(exact, abs=1e-9) if exact < 3.0 else gap[k] == math.inf


def test_a_course_travels_whole_and_a_route_by_its_key(left):
    _, route, planner = left
    course = planner.plan(80.0, 0.0, 0.0, bodies(beside(route, 140.0, 0.0)), NOBODY, NOBODY)
    assert course is not None
    again = pickle.loads(pickle.dumps(course))
    assert np.array_equal(again.path.xy, course.path.xy)
    assert again.waiting_s == course.waiting_s
    assert pickle.loads(pickle.dumps(route)) is route


@pytest.mark.parametrize("gap", [2.2, 3.0, 4.0])
@pytest.mark.parametrize("at", [-20.0, -6.0, 30.0])
def test_a_car_close_behind_a_body_pulls_out(left, gap, at):
    network, route, planner = left
    s = route.stop_line_s + at
    x, y, psi = (float(v) for v in route.path.pose(s))
    standing = bodies(beside(route, s + BODY.length + gap, 0.0))
    clear = []
    for course in filter(None, planner.pull_outs(x, y, psi, standing, 0.25)):
        here = course.path.project(x, y)[0]
        _, gaps = gaps_along(course.path, here, here + 40.0, BODY, standing)
        if gaps.min() >= 0.25 and on_the_road(network, course, here, here + 40.0):
            clear.append(course)
            break
    assert clear


def test_a_car_in_a_bend_that_stands_beside_a_body_drives_on_before_it_turns():
    network = load_network("skewed_four_way")
    route = network.route("south", "left")
    s = route.exit_s - 11.8
    x, y, path = (float(v) for v in route.path.pose(s))
    psi = path - 0.18
    ahead, left = 1.7, 3.3
    place = x + ahead * math.cos(psi) - left * math.sin(psi), y + ahead * math.sin(psi) + left * math.cos(psi)
    standing = bodies((*place, psi - math.radians(144)))
    now = float(rectangle_gaps(x, y, psi, BODY.length, BODY.width, *standing).min())
    assert 0.15 < now < 0.3
    clear = now - 0.03
    courses = CoursePlanner(network, route, BODY).pull_outs(x, y, psi, standing, clear)
    course = next(course for course in courses if course is not None)
    here = course.path.project(x, y)[0] + 1.0
    assert gaps_along(course.path, here, here + 40.0, BODY, standing)[1].min() >= clear


@pytest.mark.parametrize(
    ("origin", "turn", "start", "body"),
    [
        ("west", "straight", (-29.3, 0.4, 0.1), (1.2, 1.6, -0.4)),
        ("south", "right", (-4.697, -0.24, -0.032), (1.051, -1.028, -0.412)),
    ],
)
def test_a_car_that_pulls_out_stays_on_the_road_before_it_is_back_on_its_path_too(origin, turn, start, body):
    """`start`: m from the exit, m and rad to the left of the path; `body`: m before it, then the same."""
    network = load_network("t_junction")
    route = network.route(origin, turn)
    s = route.exit_s + start[0]
    x, y, psi = beside(route, s, *start[1:])
    standing = bodies(beside(route, s + BODY.length + body[0], *body[1:]))
    courses = [*filter(None, CoursePlanner(network, route, BODY).pull_outs(x, y, psi, standing, 0.25))]
    assert courses
    for course in courses:
        here = course.path.project(x, y)[0]
        places, heading = course.path.body_pose(np.arange(here, here + 10.0, 0.1), BODY)
        size = np.tile([BODY.length, BODY.width], (len(places), 1))
        corners = rectangle_corners(places, heading, size)
        assert network.surface.signed_distance(corners).min() >= -0.15
