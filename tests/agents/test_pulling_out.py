"""Ways on which an ego that stands before a body pulls out: all of them are tried, one a decision."""

# ruff: noqa: F811 -- fixtures come by import
import math
from dataclasses import replace

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
