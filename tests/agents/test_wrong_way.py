"""Who comes the wrong way: the lane that it takes, and the way round it before the junction."""

# ruff: noqa: F811 -- fixtures come by import
import math
from dataclasses import replace

import numpy as np
import pytest

from rudc.agents.blocking import Blocking
from rudc.agents.coming import BACKS_S, LANE_S, MEETING_S, PACE, not_passed
from rudc.agents.courses import ASIDE, CLEAR, Courses, _wait
from rudc.agents.registry import make_agent
from rudc.env.episode import Episode
from rudc.evaluation.rollout import run_episode
from rudc.geometry import Rectangles
from rudc.network.course import gaps_along
from rudc.scenario import load_scenario
from tests.world.conftest import four_way, make_scene, world, world_on  # noqa: F401 -- fixtures

GHOST = """
name: ghost
network: t_junction
ego: {route: {from: west, turn: right}, speed: 7, distance: 85}
traffic: {density: 5}
events:
  - {kind: wrong_way, lane: west_to_south_0, at: 13, speed: 4, when: {ego_distance_to_junction: {below: 60}}}
episode: {timeout: 60}
"""


def against(make_scene, four_way, ahead, v=4.0, turn="straight", **ego):
    """An ego `front` m before its stop line, and one `ahead` m before it in its lane who comes towards it."""
    alone = make_scene(turn=turn, **ego)
    s = alone.ego_s + ahead
    x, y, psi = (float(value) for value in alone.route.path.pose(s))
    return make_scene({"at": (x, y, psi + math.pi), "v": v}, turn=turn, **ego)


def test_before_the_junction_the_lane_beside_is_taken(make_scene, four_way):
    scene = against(make_scene, four_way, 50.0, front=-75.0, v=8.0)
    courses = Courses()
    courses.reset(scene)
    shown = courses.see(scene)
    assert courses.course is not None
    body = Rectangles(scene.position, scene.heading, scene.size)
    _, gap = gaps_along(shown.route.path, shown.ego_s, shown.ego_s + 70.0, scene.vehicle, body)
    assert CLEAR <= gap.min() < 3.0
    nobody = replace(scene, velocity=np.zeros((1, 2)), position=scene.position + np.array([0.0, 300.0]))
    courses.reset(nobody)
    assert courses.see(nobody) is nobody


def test_an_ego_that_stands_does_not_wait_until_who_backs_away_is_gone(make_scene, four_way):
    """One that drives does, and so does one before somebody who stands: they may come once more."""
    for v, waited, waits in (
        (-2.5, 0.0, True),
        (-2.5, BACKS_S, False),
        (0.0, BACKS_S, True),
        (3.0, BACKS_S, True),
    ):
        scene = replace(against(make_scene, four_way, 30.0, v=v), waited_s=waited)
        assert not_passed(scene, frozenset(scene.ids)) == waits, (v, waited)
        assert not not_passed(scene, frozenset({"somebody else"}))


def test_who_backs_away_does_not_come(make_scene, four_way):
    scene = against(make_scene, four_way, 20.0, v=-2.5, front=-75.0)
    assert not Blocking().look(scene).coming.outside.number
    forwards = replace(scene, velocity=-scene.velocity)
    assert Blocking().look(forwards).coming.outside.number


@pytest.mark.parametrize("may_cross_centre", [False, True])
def test_once_it_has_passed_the_way_is_the_route_again(make_scene, four_way, may_cross_centre):
    scene = against(make_scene, four_way, 50.0, front=-75.0, v=8.0)
    scene = replace(scene, may_cross_centre=may_cross_centre)
    courses = Courses()
    courses.reset(scene)
    shown = courses.see(scene)
    s = shown.ego_s + 40.0  # there it is beside its route
    x, y, psi = (float(value) for value in shown.route.path.pose(s))
    ego = replace(scene.ego, x=x, y=y, psi=psi)
    ego_s, offset = scene.route.path.project(x, y)
    assert abs(offset) > 1.0
    later = replace(scene, ego=ego, ego_s=ego_s, ego_offset=offset, time_s=scene.time_s + 5.0)
    past = replace(later, position=np.array([[x, y]]) - 20.0 * np.array([math.cos(psi), math.sin(psi)]))
    back = courses.see(past).route.path
    places = [
        scene.route.path.project(*map(float, back.pose(back.project(x, y)[0] + way)[:2]))
        for way in (0.0, 40.0)
    ]
    assert places[0][1] == pytest.approx(offset, abs=0.2)
    assert abs(places[1][1]) < 0.2
    assert courses.see(replace(past, time_s=past.time_s + 2.0)).route.path is back, "and it is kept"


def test_once_it_has_passed_wrecks_elsewhere_change_nothing(make_scene, four_way):
    scene = against(make_scene, four_way, 50.0, front=-75.0, v=8.0)
    courses = Courses()
    courses.reset(scene)
    courses.see(scene)
    assert courses.course is not None
    behind = scene.position - 80.0 * np.array([math.cos(scene.ego.psi), math.sin(scene.ego.psi)])
    wreck = against(make_scene, four_way, -40.0, 0.0, front=-75.0)
    past = make_scene(
        {"at": (*behind[0].tolist(), float(scene.heading[0])), "v": 4.0},
        {"at": (*wreck.position[0].tolist(), float(wreck.heading[0]))},
        front=-75.0,
    )
    past = replace(past, time_s=scene.time_s + 5.0)
    assert Blocking().look(past).standing.number == 1
    for v in (4.0, 0.0, -2.5):  # it comes, waits before the ego, makes room
        there = replace(scene, velocity=scene.velocity / 4.0 * v, time_s=scene.time_s + 3.0)
        before = courses.course
        courses.see(there)
        assert courses.course is before, "it has not passed yet"
    courses.see(past)
    assert courses.course is None


def test_once_it_has_passed_others_who_face_the_ego_far_ahead_change_nothing(make_scene, four_way):
    """A wreck that stands there with its front to the ego kept the course for good."""
    scene = against(make_scene, four_way, 50.0, front=-75.0, v=8.0)
    behind = scene.position[0] - 80.0 * np.array([math.cos(scene.ego.psi), math.sin(scene.ego.psi)])
    wreck = against(make_scene, four_way, 115.0, 0.0, front=-75.0)
    past = make_scene(
        {"at": (*behind.tolist(), float(scene.heading[0])), "v": 4.0},
        {"at": (*wreck.position[0].tolist(), float(wreck.heading[0]))},
        front=-75.0,
    )
    courses = Courses()
    courses.reset(scene)
    courses.see(scene)
    assert courses.course is not None
    courses.see(replace(past, time_s=scene.time_s + 5.0))
    assert courses.course is None


def test_its_lane_follows_the_bends_of_the_road(make_scene, four_way):
    scene = against(make_scene, four_way, 30.0, v=5.0, turn="left", front=-14.0)
    path = scene.route.path
    s, offset = path.project(*scene.position[0].tolist())
    assert scene.route.stop_line_s < s < scene.route.exit_s
    taken = Blocking().look(scene).coming.outside
    assert taken.number > 3
    places = [path.project(x, y) for x, y in taken.position.tolist()]
    assert max(abs(aside - offset) for _, aside in places) < 0.2
    assert np.ptp(taken.heading) > 0.3  # it bends


@pytest.mark.parametrize("v", [0.0, 2.0, 9.0])
def test_it_ends_where_the_ego_will_have_left_the_lane(make_scene, four_way, v):
    theirs = 4.0
    scene = against(make_scene, four_way, 60.0, theirs, front=-70.0)
    scene = replace(scene, ego=replace(scene.ego, v=v))
    path, taken = scene.route.path, Blocking().look(scene).coming.outside
    s, _ = path.project(*scene.position[0].tolist())
    ends = [path.project(x, y)[0] - 0.5 * (size - 5.0) for (x, y), (size, _) in zip(*taken[::2], strict=True)]
    comes_s = (s - min(ends)) / theirs
    ego_s = (min(ends) - scene.ego_s) / max(v, PACE)
    assert comes_s == pytest.approx(min(ego_s + MEETING_S, LANE_S), abs=0.1)


@pytest.mark.parametrize("agent", ["planner", "rudc-t"])
def test_a_ghost_driver_on_the_approach_is_passed(world_on, tmp_path, agent):
    (tmp_path / "ghost.yaml").write_text(GHOST, encoding="utf-8")
    scenario = load_scenario(tmp_path / "ghost.yaml")
    record = run_episode(Episode(world_on(scenario.network)), scenario.plan(0), make_agent(agent))
    assert record.values["events_fired"] == 1
    assert record.values["outcome"] == "success"


@pytest.mark.parametrize("front", [-6.0, -2.0, 0.0, 2.0])
@pytest.mark.parametrize("v", [2.0, 4.0])
def test_who_waits_for_one_who_comes_through_the_junction_is_beside_its_way(make_scene, four_way, front, v):
    """The ego turns right; the other leaves the road into which it turns, straight on over the junction."""
    alone = make_scene(turn="right", front=front, v=v)
    s = alone.route.exit_s + 12.0
    x, y, psi = (float(value) for value in alone.route.path.pose(s))
    scene = make_scene({"at": (x, y, psi + math.pi), "v": 5.0}, turn="right", front=front, v=v)
    blocks = Blocking().look(scene)
    assert blocks.soon.number
    room = _wait(scene, blocks)
    assert room < math.inf
    there = scene.ego_s + room
    _, gap = gaps_along(scene.route.path, there, there + 0.5, scene.vehicle, blocks.later)
    assert gap[0] > 0.5 * ASIDE


@pytest.mark.parametrize("v", [0.0, 0.9, 1.8])
def test_who_creeps_towards_its_way_stops_beside_it_wherever_it_is(make_scene, four_way, v):
    waits = 0
    for front in np.arange(0.0, 14.0, 0.1).tolist():
        alone = make_scene(turn="right", front=front, v=v)
        x, y, psi = (float(value) for value in alone.route.path.pose(alone.route.exit_s + 12.0))
        scene = make_scene({"at": (x, y, psi + math.pi), "v": 5.0}, turn="right", front=front, v=v)
        blocks = Blocking().look(scene)
        _, gap = gaps_along(scene.route.path, scene.ego_s, scene.ego_s + 0.5, scene.vehicle, blocks.later)
        if gap[0] < CLEAR:
            break
        there = scene.ego_s + _wait(scene, blocks)
        assert there < math.inf
        _, gap = gaps_along(scene.route.path, there, there + 0.5, scene.vehicle, blocks.later)
        assert gap[0] >= CLEAR
        waits += 1
    assert waits > 5


def test_who_stands_in_its_way_does_not_wait_there(make_scene, four_way):
    alone = make_scene(turn="right")
    s = alone.route.exit_s + 12.0
    x, y, psi = (float(value) for value in alone.route.path.pose(s))
    scene = make_scene({"at": (x, y, psi + math.pi), "v": 5.0}, turn="right", front=10.0, v=0.0)
    blocks = Blocking().look(scene)
    _, gap = gaps_along(scene.route.path, scene.ego_s, scene.ego_s + 0.5, scene.vehicle, blocks.later)
    assert gap[0] < CLEAR
    assert _wait(scene, blocks) == math.inf


def test_in_the_junction_only_who_goes_straight_on_towards_the_ego_is_gone_round(make_scene, four_way):
    for turn, through in (("straight", True), ("left", False)):
        scene = against(make_scene, four_way, 45.0, v=5.0, turn=turn, front=-6.0)
        scene = replace(scene, may_cross_centre=True)
        inside = Blocking().look(scene).coming.inside
        assert bool(inside.number) is through
        courses = Courses()
        courses.reset(scene)
        route = courses.see(scene).route
        middle = 0.5 * (scene.route.stop_line_s + scene.route.exit_s)
        x, y, _ = scene.route.path.pose(middle)
        assert (abs(route.path.project(float(x), float(y))[1]) > 1.0) is through
