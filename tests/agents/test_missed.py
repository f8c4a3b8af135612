"""A car that has missed a bend and is far off its line slows down, and gets a course back if there is one."""

# ruff: noqa: F811 -- fixtures come by import
import math
from dataclasses import replace

import numpy as np
import pytest

from rudc.agents.courses import Courses
from tests.world.conftest import four_way, make_scene  # noqa: F401 -- fixtures


def beside_its_line(make_scene, offset, v, turned=0.0):
    """The ego in the junction, `offset` m to the left of its line, turned by `turned` rad from it."""
    scene = make_scene(turn="straight", front=6.0, v=v)
    ego = scene.ego
    x, y = ego.x - offset * math.sin(ego.psi), ego.y + offset * math.cos(ego.psi)
    return replace(scene, ego=replace(ego, x=x, y=y, psi=ego.psi + turned), ego_offset=offset)


@pytest.mark.parametrize(("offset", "turned"), [(3.5, 0.0), (3.5, 0.4), (3.5, -0.4)])
def test_one_that_creeps_far_off_its_line_gets_a_course_from_where_it_is(make_scene, offset, turned):
    scene, courses = beside_its_line(make_scene, offset, v=0.5, turned=turned), Courses()
    courses.reset(scene)
    shown = courses.see(scene)
    assert courses.course is not None
    assert abs(shown.ego_offset) < 0.3
    path, end = shown.route.path, scene.route.path.pose(scene.route.length - 10.0)
    assert abs(path.project(float(end[0]), float(end[1]))[1]) < 0.1, "it leads back to the line"


@pytest.mark.parametrize(("offset", "v"), [(3.5, 4.0), (1.0, 0.5)])
def test_one_that_drives_or_is_on_its_lane_gets_none(make_scene, offset, v):
    scene, courses = beside_its_line(make_scene, offset, v), Courses()
    courses.reset(scene)
    assert courses.see(scene) is scene


def test_on_the_course_it_is_not_planned_again(make_scene):
    scene, courses = beside_its_line(make_scene, 3.5, v=0.5), Courses()
    courses.reset(scene)
    courses.see(scene)
    first = courses.course
    for k in range(30):
        courses.see(replace(scene, time_s=scene.time_s + 0.1 * k))
    assert courses.course is first


@pytest.mark.parametrize(
    ("offset", "v", "most"), [(3.5, 9.0, -4.0), (3.5, 3.0, -4.0), (3.5, 0.5, 2.0), (1.0, 9.0, 2.0)]
)
def test_one_that_is_far_off_its_line_slows_down_until_it_creeps(make_scene, offset, v, most):
    scene, courses = beside_its_line(make_scene, offset, v), Courses()
    courses.reset(scene)
    shown = courses.see(scene)
    assert courses.govern(shown, np.array([2.0, 0.0]))[0] == pytest.approx(most)


def test_where_there_is_no_course_back_it_goes_on_creeping(make_scene):
    scene, courses = beside_its_line(make_scene, -7.0, v=0.2), Courses()
    courses.reset(scene)
    shown = courses.see(scene)
    assert courses.course is None
    assert 0.0 < courses.govern(shown, np.array([2.0, 0.0]))[0] <= 2.0
