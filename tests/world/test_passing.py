"""Surrounding vehicles pass what stands beside the middle of their lane, if it leaves them room."""

import numpy as np
import pytest

from rudc.world.passing import Passing
from tests.plans import PlanSource, event

STAND = np.array([-6.0, 0.0])
LANE_Y = -5.25
"""m, the middle of west_in_0, which is 3.5 m wide"""


def barrel(aside, at=40.0, **fields):
    """A barrel on west_in_0, its middle `aside` m to the left of the lane's."""
    thing = {"lane": "west_in_0", "at": at, "lateral": aside, "size": [0.6, 0.6]}
    return event("accident", objects=[thing], **fields)


def drive(world, *events, seconds=30.0, mix=None):
    """How many pass a barrel 40 m along that lane, the least and the most that vehicles there are to its
    left (m), and how many pairs touch, in an episode whose ego stands far off."""
    plan = PlanSource(
        origin="south", turn="right", density=25.0, mix=mix or {"car": 1.0}, warm_up_s=0.1, events=events,
        origins={"west": 1.0}, turns={"right": 1.0},
    )  # fmt: skip
    world.reset(plan.plan(1))
    came, passed, aside, touched = set(), set(), [0.0], 0
    for _ in range(round(seconds * 10)):
        touched += world.advance(STAND).sv_collisions
        scene = world.scene()
        x, y = scene.position.T
        lane = (np.abs(y - LANE_Y) < 1.7) & (np.cos(scene.heading) > 0.9) & (scene.path >= 0) & (x < -20.0)
        came |= {scene.ids[i] for i in np.flatnonzero(lane & (x < -70.0))}
        passed |= {scene.ids[i] for i in np.flatnonzero(lane & (np.abs(x + 54.0) < 2.0))} & came
        aside += (y - LANE_Y)[lane].tolist()
    return len(passed), min(aside), max(aside), touched


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_who_has_room_in_the_lane_passes(world, side):
    passed, least, most, touched = drive(world, barrel(0.8 * side))
    assert passed >= 4
    assert touched == 0
    away = -least if side > 0 else most
    assert 0.58 < away <= 0.85  # the barrel begins 0.5 m beside the middle: 0.9 + 0.2 - 0.5 m at least
    assert (most if side > 0 else -least) == 0.0


def test_nobody_leaves_the_lane_to_pass(world):
    passed, least, most, touched = drive(world, barrel(0.5))
    assert passed == 0
    assert least == most == touched == 0.0


def test_without_it_they_stood(world, monkeypatch):
    monkeypatch.setattr(Passing, "step", lambda *_: None)
    assert drive(world, barrel(0.8))[0] == 0


def test_two_things_on_two_sides_leave_no_room(world):
    passed, _, _, touched = drive(world, barrel(1.0), barrel(-1.0, at=41.0))
    assert passed == touched == 0


def test_wide_vehicles_need_a_wide_lane(world):
    bus = {"bus": 1.0}
    assert drive(world, barrel(1.0), mix=bus)[0] == 0
    passed, least, _, touched = drive(world, barrel(1.4), mix=bus)
    assert passed >= 1
    assert touched == 0
    assert -0.5 <= least < -0.3


def test_they_come_back_to_the_middle(world):
    drive(world, barrel(0.8, duration=15.0), seconds=30.0)
    assert not world._detours._passing._aside


def test_a_sumo_driven_ego_passes_too(world):
    ahead = event("accident", objects=[{"lane": "ego_in", "at": 25.0, "lateral": 0.8, "size": [0.6, 0.6]}])
    plan = PlanSource(origin="west", turn="straight", density=0.0, distance=(60.0, 60.0), events=(ahead,))
    world.reset(plan.plan(0), ego_driver="sumo")
    offsets = []
    for _ in range(150):
        advance = world.advance(STAND)
        offsets.append(world.scene().ego_offset)
        assert advance.collision is None
        if world.scene().ego_s > world.scene().route.exit_s:
            break
    else:
        pytest.fail("it stood")
    assert -0.85 <= min(offsets) < -0.58


@pytest.mark.parametrize("mix", [{"car": 1.0}, {"truck": 1.0}])
def test_who_passes_a_thing_that_stands_aslant_goes_as_far_aside_as_its_far_end_asks(world, mix):
    """Its near end asked for less: a truck stopped before the far end, and stood for good."""
    thing = {"lane": "west_in_0", "at": 40.0, "lateral": 1.5, "size": [6.0, 0.3], "heading_offset": -8.0}
    passed, _, _, touched = drive(world, event("accident", objects=[thing]), mix=mix)
    assert passed >= 2
    assert touched == 0
