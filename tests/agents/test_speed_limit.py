"""How an agent that is led along courses slows down: to speed limits, and to where it has to stop."""

# ruff: noqa: F811 -- fixtures come by import
import math
from dataclasses import replace

import numpy as np
import pytest

from rudc.agents.courses import HARDEST, TOLERATED, Courses
from rudc.agents.gap_acceptance import GapAcceptance
from rudc.agents.gaps import DECELERATION
from rudc.env.tracking import COMFORT, slowing
from rudc.network.network import load_network
from rudc.world.ego import EgoPlant
from tests.world.conftest import four_way, make_scene  # noqa: F401 -- fixtures
from tests.world.networks import in_pieces


def speeds(make_scene, before, after, *, onwards=False):
    """m/s by m past the junction's end, straight on at full acceleration from 50 m before the stop line."""
    scene = make_scene(turn="straight", front=-50.0, v=5.0)
    limits = (-math.inf, before), (scene.route.exit_s, after)
    return driven(replace(scene, route=replace(scene.route, limits=limits)), onwards=onwards)


def driven(scene, *, onwards=False):
    """m past the junction's end, m/s and m/s2 of an ego that follows its path at full acceleration."""
    courses, plant, s = Courses(), EgoPlant(scene.vehicle), scene.ego_s
    courses.reset(scene)
    plant.resume(scene.ego, plant.actuation)
    rows = []
    while s < min(scene.route.exit_s + 25.0, scene.route.length):
        x, y, psi = scene.route.path.pose(s)
        ego = replace(plant.state, x=float(x), y=float(y), psi=float(psi))
        now = replace(scene, ego=ego, ego_s=s)
        u = courses.govern(courses.see(now), np.array([3.0, 0.0]), onwards=onwards)
        before_step = plant.state.v
        s += 0.05 * (before_step + plant.step(float(u[0]), 0.0, 0.1).v)
        rows.append((s - scene.route.exit_s, plant.state.v, (plant.state.v - before_step) / 0.1))
    return np.array(rows)


@pytest.mark.parametrize(("before", "after"), [(5.5, 14.0), (10.0, 5.5), (6.0, 6.0)])
def test_no_faster_than_the_speed_limit_tolerates(make_scene, before, after):
    s, v, a = speeds(make_scene, before, after).T
    assert v[s < 0.0].max() == pytest.approx(TOLERATED * before, rel=0.02), "it is used"
    assert v[s > 0.5].max() <= 1.05 * TOLERATED * after
    assert a.min() > -1.5 * COMFORT, "it brakes in time, not at the sign"


def test_each_edge_of_an_arm_has_its_own_limit(make_scene, tmp_path):
    """The limit next to the junction was taken for the whole arm: 16.7 m/s was driven where 5 are allowed."""
    network = load_network(in_pieces(tmp_path))
    route, paths = network.route("north", "south"), network.paths
    assert [limit for _, limit in route.limits if limit in (5.0, 13.9, 8.33, 27.8)] == [5.0, 13.9, 8.33, 27.8]
    for lane, limit in (("in1", 5.0), ("in0", 13.9), ("out0", 8.33), ("out1", 27.8)):
        prefix = "north" if lane.startswith("in") else "south"
        begin, end = paths.spans[route.row][f"{prefix}_{lane}_0"]
        middle, rows = np.array([0.5 * (begin + end)]), np.array([route.row])
        assert paths.highest_limit(rows, middle, middle) == limit == route.limit_at(float(middle[0]))
    s, v, a = driven(make_scene(origin="north", turn="straight", front=-100.0, v=4.0, network=network)).T
    s += route.exit_s
    near = [s < route.limits[1][0], (s > route.exit_s + 0.5) & (s < route.limits[-2][0])]
    assert [v[where].max() for where in near] == pytest.approx([TOLERATED * 5.0, TOLERATED * 8.33], rel=0.03)
    assert v.max() > 10.0
    assert a.min() > -1.5 * COMFORT


def test_the_reference_driver_slows_down_before_lower_limits(make_scene):
    """It braked fully where the limit began."""
    agent, scene = GapAcceptance(), make_scene(turn="straight", front=-50.0, v=8.0)
    sign, plant, s, rows = scene.ego_s + 30.0, EgoPlant(scene.vehicle), scene.ego_s, []
    scene = replace(scene, route=replace(scene.route, limits=((-math.inf, 13.9), (sign, 5.0))))
    agent.reset(scene, 0)
    plant.resume(scene.ego, plant.actuation)
    while s < sign + 5.0:
        u = agent.act(replace(scene, ego=plant.state, ego_s=s)).u
        s += 0.1 * plant.step(float(u[0]), 0.0, 0.1).v
        rows.append((s - sign, plant.state.v, float(u[0])))
    s, v, a = np.array(rows).T
    assert v[s < -15.0].max() > 7.5
    assert v[s > 0.5].max() < 5.3
    assert a.min() > -1.3 * DECELERATION


def test_who_would_be_hit_if_it_braked_minds_no_limit(make_scene):
    assert speeds(make_scene, 5.5, 5.5, onwards=True)[:, 1].max() > 10.0


@pytest.mark.parametrize("deceleration", [COMFORT, HARDEST])
@pytest.mark.parametrize("v", [2.0, 6.0, 12.0])
def test_it_comes_to_a_stand_where_it_has_to_and_not_beyond(make_scene, v, deceleration):
    room = v**2 / (2 * deceleration) + 5.0
    scene = make_scene(v=v)
    plant, driven, hardest = EgoPlant(scene.vehicle), 0.0, 0.0
    plant.resume(scene.ego, plant.actuation)
    for _ in range(150):
        now, before = replace(scene, ego=plant.state), plant.state.v
        a = min(slowing(now, room - driven, 0.0, deceleration), 1.0)
        driven += 0.05 * (before + plant.step(a, 0.0, 0.1).v)
        hardest = max(hardest, (before - plant.state.v) / 0.1)
    assert room - 0.1 < driven < room + 0.02
    assert hardest < 1.1 * deceleration
