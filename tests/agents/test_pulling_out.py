"""Ways on which an ego that stands before a body pulls out: all of them are tried, one a decision. Who finds
none for long passes through a gap that is smaller than usual.
"""

# ruff: noqa: F811 -- fixtures come by import
import math
from dataclasses import replace

import numpy as np
import pytest

import rudc.agents.courses as courses_module
from rudc.agents.courses import Courses
from tests.world.conftest import four_way, make_scene  # noqa: F401 -- fixtures

WAYS = 40
"""more than there are decisions between two plans"""


class Planner:
    """Finds nothing, and keeps which ways it was asked for."""

    def __init__(self):
        self.plans, self.tried = 0, []

    def angle(self, s, psi):
        return 0.0

    def plan(self, *_):
        self.plans += 1

    def pull_outs(self, *_):
        for way in range(WAYS):
            self.tried.append(way)
            yield None


@pytest.fixture
def planner(monkeypatch):
    found = Planner()
    monkeypatch.setattr(courses_module, "_planners_of", lambda scene: [found])
    return found


def blocked(make_scene, v=0.0):
    """Somebody stands across the ego's lane, without a way of its own."""
    alone = make_scene(turn="straight", front=-40.0, v=v)
    x, y, psi = (float(value) for value in alone.route.path.pose(alone.ego_s + 8.0))
    return make_scene({"at": (x, y, psi + 0.5 * math.pi)}, turn="straight", front=-40.0, v=v)


def look(courses, scene, decisions, first=0):
    for k in range(first, first + decisions):
        courses.see(replace(scene, time_s=scene.time_s + 0.1 * k))


def test_all_ways_are_tried_before_they_are_tried_again(make_scene, planner):
    scene, courses = blocked(make_scene), Courses()
    courses.reset(scene)
    look(courses, scene, WAYS + 1)
    assert planner.tried == list(range(WAYS))
    assert planner.plans == 1
    look(courses, scene, WAYS, first=WAYS + 1)
    assert planner.tried[: WAYS + 10] == [*range(WAYS), *range(10)]
    assert planner.plans == 2


def test_who_has_moved_since_begins_anew(make_scene, planner):
    scene, courses = blocked(make_scene), Courses()
    courses.reset(scene)
    look(courses, scene, 6)
    assert planner.tried == list(range(5))
    look(courses, blocked(make_scene, v=2.0), 20, first=6)
    assert planner.tried == list(range(5)), "who drives does not pull out"
    look(courses, scene, 6, first=60)
    assert planner.tried == [*range(5), *range(5)]


def beside(make_scene, gap, front=-40.0, ahead=(9.0,)):
    """Across the ego's lane somebody stands `ahead` m before it, at each of these, and leaves `gap` m."""
    alone = make_scene(turn="straight", front=front, v=0.0)
    left = 0.5 * (alone.vehicle.width + 5.0) + gap
    stand = []
    for m in ahead:
        x, y, psi = (float(value) for value in alone.route.path.pose(alone.ego_s + m))
        stand.append({"at": (x - left * math.sin(psi), y + left * math.cos(psi), psi + 0.5 * math.pi)})
    return make_scene(*stand, turn="straight", front=front, v=0.0)


def accelerates(courses, scene):
    shown = courses.see(scene)
    return courses.govern(shown, np.array([2.0, 0.0]))[0] > 0.0


@pytest.mark.parametrize(("gap", "after_long"), [(0.3, True), (0.17, True), (0.08, False)])
def test_who_has_found_no_way_for_long_passes_through_a_smaller_gap(make_scene, planner, gap, after_long):
    scene, courses = beside(make_scene, gap), Courses()
    courses.reset(scene)
    assert accelerates(courses, scene) == (gap > 0.25)
    look(courses, scene, 48)
    assert accelerates(courses, scene) == (gap > 0.25)
    look(courses, scene, 8, first=48)
    later = replace(scene, time_s=scene.time_s + 6.0)
    assert accelerates(courses, later) == after_long


def test_through_a_smaller_gap_it_goes_slowly(make_scene, planner):
    scene, courses = beside(make_scene, 0.17), Courses()
    courses.reset(scene)
    look(courses, scene, 60)
    fast = replace(scene, time_s=scene.time_s + 6.0, ego=replace(scene.ego, v=6.0))
    assert not accelerates(courses, fast)
    slow = replace(scene, time_s=scene.time_s + 6.0, ego=replace(scene.ego, v=1.5))
    assert accelerates(courses, slow)


def test_once_past_the_next_gap_must_be_as_large_as_usual_again(make_scene, planner):
    scene, courses = beside(make_scene, 0.17), Courses()
    courses.reset(scene)
    look(courses, scene, 60)
    free = make_scene(turn="straight", front=-20.0, v=0.0)
    courses.see(replace(free, time_s=scene.time_s + 7.0))
    again = beside(make_scene, 0.17, front=-20.0)
    assert not accelerates(courses, replace(again, time_s=scene.time_s + 8.0))


def test_the_next_gap_in_sight_must_be_as_large_as_usual_too(make_scene, planner):
    courses = Courses()
    scene = beside(make_scene, 0.17, ahead=(9.0, 55.0))
    courses.reset(scene)
    look(courses, scene, 60)
    at_next = beside(make_scene, 0.17, front=6.0, ahead=(-37.0, 9.0))
    past = beside(make_scene, 0.17, front=-20.0, ahead=(-11.0, 35.0))
    assert accelerates(courses, replace(scene, time_s=scene.time_s + 6.0))
    assert accelerates(courses, replace(past, time_s=scene.time_s + 8.0))
    assert not accelerates(courses, replace(at_next, time_s=scene.time_s + 9.0))


@pytest.mark.parametrize(("ahead", "back"), [(25.0, True), (9.0, False)])
def test_who_has_stood_on_a_course_that_is_no_longer_clear_goes_back_to_its_route(
    make_scene, planner, four_way, ahead, back
):
    """It stood half-way in the junction for a queue on the lanes that its course used, and the queue stood
    for it. Where its own way is free for no more than what it keeps before a body, it stays.
    """
    alone = make_scene(turn="straight", front=-40.0, v=0.0)
    (row,) = set(four_way.movement("south", "straight").rows) - {alone.route.row}
    lane = int(four_way.inbound_lane(row).index)
    course = four_way.route("south", "straight", lane)
    x, y, psi = (float(value) for value in alone.route.path.pose(alone.ego_s + ahead))
    across = {"at": (x, y, psi + 0.5 * math.pi)}
    beside = {"at": tuple(float(value) for value in course.path.pose(alone.ego_s + 9.0))}
    scene, courses = make_scene(across, beside, turn="straight", front=-40.0, v=0.0), Courses()
    courses.reset(scene)
    courses.course, courses._strays, courses._round = course, frozenset({"gone"}), np.zeros((1, 2))
    look(courses, scene, 48)
    assert courses.course is course
    look(courses, scene, 10, first=48)
    assert (courses.course is None) is back
    assert (not courses._strays and not len(courses._round)) is back, "what the course was for is forgotten"
    assert accelerates(courses, replace(scene, time_s=scene.time_s + 6.0)) == back
