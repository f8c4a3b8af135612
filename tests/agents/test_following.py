"""How an ego comes up behind its leader; on scenes made by hand."""

# ruff: noqa: F811 -- fixtures come by import
from dataclasses import replace

import numpy as np
import pytest

from rudc.agents.following import EASES, HEADWAY_S, LEADER, PLANNED, PULL_OUT, ready_to_follow
from rudc.agents.outlook import OutlookSettings
from rudc.world.ego import EgoPlant
from rudc.world.scene import STANDING, STILL
from tests.world.conftest import four_way, make_scene  # noqa: F401 -- fixtures

FULL = np.array([3.0, 0.0])
FRONT = -50.0
"""m, of the ego's front beyond its stop line"""


@pytest.fixture(scope="module")
def straight(four_way):
    """The ego's own way."""
    return four_way.movement("south", "straight").rows[0]


def leader(four_way, row, gap, v, **more):
    """Somebody 5 m long that drives the row, `gap` m before the ego."""
    return {"row": row, "s": float(four_way.paths.stop_s[row]) + FRONT + gap + 2.5, "v": v, **more}


def follow(make_scene, four_way, row, gap, v, leads):
    """m of gap while the leader brakes at LEADER until it stands. Full acceleration is asked for while it
    moves, and then full braking; the brakes give no more than what the ego plans with.
    """
    weak = replace(four_way.vehicle, a_min=-PLANNED)
    plant, gaps, went = EgoPlant(weak), [gap], 0.0
    s = began = make_scene(front=FRONT).ego_s
    plant.resume(make_scene(v=v).ego, plant.actuation)
    for _ in range(80):
        other = leader(four_way, row, gap + went, leads)
        x, y, psi = map(float, four_way.route("south", "straight").path.pose(s))
        ego = replace(plant.state, x=x, y=y, psi=psi)
        asked = FULL if leads > STILL else np.array([-6.0, 0.0])
        u = ready_to_follow(replace(make_scene(other), ego=ego, ego_s=s), asked)
        before, after = leads, max(leads - LEADER * 0.1, 0.0)
        s += 0.05 * (ego.v + plant.step(float(u[0]), 0.0, 0.1).v)
        went, leads = went + 0.05 * (before + after), after
        gaps.append(gap + went - (s - began))
    assert plant.state.v < STANDING
    return np.array(gaps)


@pytest.mark.parametrize(("v", "leads", "gap"), [(10.0, 10.0, 12.0), (8.0, 5.0, 14.0), (5.0, 4.0, 6.0)])
def test_it_can_stop_behind_a_leader_that_brakes_until_it_stands(
    make_scene, four_way, straight, v, leads, gap
):
    gaps = follow(make_scene, four_way, straight, gap, v, leads)
    assert gaps.min() > 0.5 * PULL_OUT
    assert gaps.min() < PULL_OUT + 4.0, "and does not stay farther behind than it must"


def test_who_turns_beside_the_ego_hides_no_leader(make_scene, four_way, straight):
    """A bus that turned away beside the ego counted for the leader, with no gap: nobody was followed."""
    near = leader(four_way, straight, 5.0, 6.0)
    x, y, psi = map(float, four_way.paths.pose(straight, near["s"] - 6.0))
    bus = {"v": 6.0, "size": (12.0, 2.5)}
    beside = {"at": (x + 4.0, y, psi - 0.5), **bus}
    into = {"at": (x + 2.2, y, psi), **bus}
    scene = make_scene(near, front=FRONT, v=10.0)
    alone = ready_to_follow(scene, FULL)
    assert alone[0] < -PLANNED
    for other in (beside, into):
        assert ready_to_follow(make_scene(near, other, front=FRONT, v=10.0), FULL).tolist() == alone.tolist()
    assert ready_to_follow(make_scene(beside, front=FRONT, v=10.0), FULL).tolist() == FULL.tolist()


def test_it_is_free_where_nobody_leads(make_scene, four_way, straight):
    v = {"front": FRONT, "v": 10.0}
    near = leader(four_way, straight, 5.0, 6.0)
    assert ready_to_follow(make_scene(near, **v), FULL)[0] < -PLANNED
    x, y, psi = four_way.paths.pose(straight, near["s"])
    beside = (x + 3.2, y, psi)
    for others in (
        (),
        (leader(four_way, straight, 45.0, 9.0),),
        (leader(four_way, straight, -12.0, 12.0),),
        (leader(four_way, straight, -1.0, 6.0),),
        ({"at": beside, "v": 6.0},),
        ({"at": (x, y, psi + np.pi / 2), "v": 6.0},),
        ({"at": (x, y, psi + np.pi), "v": 6.0},),
    ):
        assert ready_to_follow(make_scene(*others, **v), FULL) is FULL, others


@pytest.mark.parametrize("grip", [1.3, 1.8])
def test_on_a_poor_road_it_plans_with_what_that_gives(make_scene, four_way, straight, grip):
    """It came so near that only full braking would do, was let go a decision later, and so on."""
    ice = replace(four_way.vehicle, a_min=-grip, a_max=grip)
    plant, begun = EgoPlant(ice), make_scene(front=FRONT)
    s, hardest = begun.ego_s, 0.0
    plant.resume(make_scene(v=9.0).ego, plant.actuation)
    for k in range(120):
        other = leader(four_way, straight, 45.0 + 0.3 * k, 3.0)
        x, y, psi = map(float, begun.route.path.pose(s))
        now = replace(make_scene(other), ego=replace(plant.state, x=x, y=y, psi=psi), ego_s=s, vehicle=ice)
        u, before = ready_to_follow(now, FULL), plant.state.v
        hardest = max(hardest, -float(u[0]))
        s += 0.05 * (before + plant.step(float(u[0]), 0.0, 0.1).v)
    gap = 45.0 + 0.3 * 120 - (s - begun.ego_s)
    assert 0.5 * grip < hardest < 0.95 * grip
    assert gap > PULL_OUT + plant.state.v**2 / (2 * grip) - 3.0**2 / (2 * LEADER)


def test_who_stands_is_gone_round_by_a_course(make_scene, four_way, straight):
    standing = leader(four_way, straight, 5.0, 0.9 * STILL)
    assert ready_to_follow(make_scene(standing, front=FRONT, v=6.0), FULL) is FULL


@pytest.mark.parametrize("creeps", [1.1 * STILL, 0.9 * STANDING])
def test_behind_who_creeps_it_keeps_what_it_needs_to_pull_out(make_scene, four_way, straight, creeps):
    """A leader that comes to rest slowly was followed by nobody's rule from STANDING on: the ego stood 1 m
    behind it, and could not go round."""
    gaps = follow(make_scene, four_way, straight, 10.0, 5.0, creeps)
    assert gaps.min() > PULL_OUT - 0.5


def test_the_nearest_counts_and_steering_stays(make_scene, four_way, straight):
    far, near = leader(four_way, straight, 20.0, 8.0), leader(four_way, straight, 8.0, 8.0)
    wanted = np.array([3.0, 0.1])
    both = ready_to_follow(make_scene(far, near, front=FRONT, v=9.0), wanted)
    assert both == pytest.approx(ready_to_follow(make_scene(near, front=FRONT, v=9.0), wanted))
    assert both[0] < ready_to_follow(make_scene(far, front=FRONT, v=9.0), wanted)[0]
    assert both[1] == 0.1
    braking = np.array([-6.0, 0.0])
    assert ready_to_follow(make_scene(near, front=FRONT, v=9.0), braking) is braking


def test_it_goes_with_the_approach(make_scene, four_way, straight):
    scene = make_scene(leader(four_way, straight, 5.0, 6.0), front=FRONT, v=10.0)
    for approach in (True, False):
        outlook = OutlookSettings(course=True, approach=approach).make()
        outlook.reset(scene)
        assert bool(outlook.govern(outlook.see(scene), FULL)[0] < 0.0) is approach
        assert outlook.govern(scene, FULL, onwards=True)[0] > 0.0, "who would be hit if it stopped goes on"


def test_an_ego_that_is_fast_heeds_a_leader_that_is_farther_away(make_scene, four_way, straight):
    """From 50 m on, which it looked ahead, it cannot stop behind this one any more."""
    fast = replace(four_way.vehicle, v_max=30.0)
    scene = make_scene(leader(four_way, straight, 80.0, 1.0), front=FRONT, v=25.0, vehicle=fast)
    assert ready_to_follow(scene, FULL)[0] < 0.0


@pytest.mark.parametrize(("v", "gap"), [(8.0, 9.5), (8.0, 30.0), (4.0, 12.0)])
def test_it_comes_to_two_seconds_behind_a_leader_that_drives_on(make_scene, four_way, straight, v, gap):
    """A man who ran out between the two could not be braked for."""
    plant, went, hardest = EgoPlant(four_way.vehicle), 0.0, 0.0
    s = began = make_scene(front=FRONT).ego_s - 20.0
    plant.resume(make_scene(v=v).ego, plant.actuation)
    for _ in range(100):
        x, y, psi = map(float, four_way.route("south", "straight").path.pose(s))
        other = leader(four_way, straight, gap + went - 20.0, v)
        ego = replace(plant.state, x=x, y=y, psi=psi)
        u = ready_to_follow(replace(make_scene(other), ego=ego, ego_s=s), np.array([1.5, 0.0]))
        s += 0.05 * (ego.v + plant.step(float(u[0]), 0.0, 0.1).v)
        went, hardest = went + 0.1 * v, min(hardest, float(u[0]))
    assert gap + went - (s - began) == pytest.approx(HEADWAY_S * v, rel=0.1)
    assert hardest >= -EASES
