"""Surrounding vehicles pass what stands beside the middle of their lane, if it leaves them room."""

import numpy as np
import pytest

from rudc.world.passing import Passing
from tests.plans import PlanSource, event

STAND = np.array([-6.0, 0.0])
THERE = np.array([-62.0, -1.75])
"""m, on the only lane of the roundabout's west arm, which is 3.5 m wide; 40 m from the ring's entry"""


@pytest.fixture
def ring(world_on):
    return world_on("roundabout")


def barrel(aside, at=40.0, **fields):
    """A barrel on west_in_0, its middle `aside` m to the left of the lane's."""
    thing = {"lane": "west_in_0", "at": at, "lateral": aside, "size": [0.6, 0.6]}
    return event("accident", objects=[thing], **fields)


def drive(world, *events, seconds=40.0, mix=None, network="roundabout", density=25.0, seed=1, **where):
    """How many pass a place 40 m along the west arm, the least and the most that vehicles on the lane there
    are to its left (m), how many pairs touch, and for how long somebody stands at most (s), in an episode
    whose ego stands far off."""
    given = {"origins": {"west": 1.0}, "turns": {"straight": 1.0}, **where}
    plan = PlanSource(
        network, density, "south", "right", mix or {"car": 1.0}, warm_up_s=0.1, events=events, **given
    )
    world.reset(plan.plan(seed))
    came, passed, aside, touched, stood = set(), set(), [0.0], 0, {}
    x0, y0 = THERE
    for _ in range(round(seconds * 10)):
        touched += world.advance(STAND).sv_collisions
        scene = world.scene()
        x, y = scene.position.T
        lane = (np.abs(y - y0) < 1.7) & (np.cos(scene.heading) > 0.9) & (scene.path >= 0) & (x < x0 + 25.0)
        for i in np.flatnonzero(lane):
            name, stands = scene.ids[i], np.hypot(*scene.velocity[i]) < 0.3
            stood[name] = stood.get(name, 0.0) + 0.1 if stands else 0.0
            came |= {name} if x[i] < x0 - 8.0 else set()
            passed |= {name} if x[i] > x0 + 8.0 else set()
        aside += (y - y0)[lane].tolist()
    return len(passed & came), min(aside), max(aside), touched, max(stood.values(), default=0.0)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_who_has_room_in_the_lane_passes(ring, side):
    passed, least, most, touched, stood = drive(ring, barrel(0.8 * side))
    assert passed >= 4
    assert touched == 0
    away = -least if side > 0 else most
    assert 0.58 < away <= 0.85  # the barrel begins 0.5 m beside the middle: 0.9 + 0.2 - 0.5 m at least
    assert (most if side > 0 else -least) == 0.0
    assert stood < 8.0


def test_nobody_leaves_the_lane_to_pass(ring):
    passed, least, most, touched, _ = drive(ring, barrel(0.5))
    assert passed == 0
    assert least == most == touched == 0.0


def test_without_it_they_stood(ring, monkeypatch):
    monkeypatch.setattr(Passing, "step", lambda *_: None)
    assert drive(ring, barrel(0.8))[0] == 0


def test_two_things_on_two_sides_leave_no_room(ring):
    passed, least, most, touched, _ = drive(ring, barrel(1.0), barrel(-1.0, at=41.0))
    assert passed == touched == 0
    assert least == most == 0.0


@pytest.mark.parametrize(("further", "passes"), [(9.0, False), (19.0, False), (24.0, True)])
def test_things_that_are_near_each_other_close_the_lane(ring, further, passes):
    """Who stopped between the two could not get aside any more."""
    passed, least, most, touched, stood = drive(ring, barrel(0.8), barrel(-0.8, at=40.0 - further))
    assert touched == 0
    assert (most > 0.55) == passes
    if passes:
        assert passed >= 3
        assert least < -0.55
        assert stood < 15.0
    else:
        assert len(ring.stage._stand_ins["accident1"]) == 1


def test_wide_vehicles_need_a_wide_lane(ring):
    bus = {"bus": 1.0}
    assert drive(ring, barrel(1.0), mix=bus)[0] == 0
    passed, least, _, touched, _ = drive(ring, barrel(1.4), mix=bus)
    assert passed >= 1
    assert touched == 0
    assert -0.5 <= least < -0.3


def test_they_come_back_to_the_middle(ring):
    passed, least, *_ = drive(ring, barrel(0.8, duration=15.0))
    assert passed
    assert least < -0.5
    assert not ring._detours._passing._aside


@pytest.mark.parametrize("at", [16.0, 40.0])
def test_who_is_there_already_gets_past_what_appears_before_it(ring, at):
    late = barrel(0.8, at=at, when={"simulation_time": {"above": 6.0}})
    *_, touched, stood = drive(ring, late, density=45.0, seconds=50.0)
    assert touched == 0
    assert stood < 20.0


@pytest.mark.parametrize("seed", [0, 1, 2])
@pytest.mark.parametrize("at", [4.0, 12.0, 113.0])
def test_nobody_is_put_onto_it_nor_changes_lanes_into_it(world, at, seed):
    """Where nothing closed the lane for SUMO, some entered within it, and others changed to its lane."""
    thing = {"lane": "west_in_0", "at": at, "lateral": 0.8, "size": [0.6, 0.6]}
    there = event("accident", objects=[thing])
    *_, touched, _ = drive(
        world, there, network="four_way", density=60.0, seed=seed, origins=None, turns=None
    )
    assert touched == 0


@pytest.mark.parametrize("at", [5.0, 108.0])
@pytest.mark.parametrize("lane", ["west_in_0", "west_out_0"])
def test_near_a_node_and_where_vehicles_enter_it_closes_the_lane(ring, lane, at):
    thing = {"lane": lane, "at": at, "lateral": 0.8, "size": [0.6, 0.6]}
    *_, touched, _ = drive(ring, event("accident", objects=[thing]), density=45.0)
    assert touched == 0
    assert bool(ring.stage._stand_ins)


@pytest.mark.parametrize("seed", [0, 1, 2, 3])
@pytest.mark.parametrize("at", [20.0, 35.0, 70.0])
def test_traffic_from_everywhere_flows_past_it_and_touches_nobody(ring, at, seed):
    """Who had passed a thing that SUMO knows of drove through whoever was ahead."""
    late = {"when": {"simulation_time": {"above": 5.0}}} if seed == 0 else {}
    *_, touched, stood = drive(
        ring, barrel(0.8 * (-1) ** seed, at=at, **late), density=45.0, seed=seed, origins=None, turns=None
    )
    assert touched == 0
    assert stood < 20.0


def test_a_sumo_driven_ego_passes_too(ring):
    ahead = event("accident", objects=[{"lane": "ego_in", "at": 25.0, "lateral": 0.8, "size": [0.6, 0.6]}])
    plan = PlanSource("roundabout", 0.0, "west", "straight", distance=(60.0, 60.0), events=(ahead,))
    ring.reset(plan.plan(0), ego_driver="sumo")
    offsets = []
    for _ in range(200):
        advance = ring.advance(STAND)
        offsets.append(ring.scene().ego_offset)
        assert advance.collision is None
        if ring.scene().ego_s > ring.scene().route.stop_line_s:
            break
    else:
        pytest.fail("it stood")
    assert -0.85 <= min(offsets) < -0.58


@pytest.mark.parametrize("mix", [{"car": 1.0}, {"truck": 1.0}])
def test_who_passes_a_thing_that_stands_aslant_goes_as_far_aside_as_its_far_end_asks(ring, mix):
    """Its near end asked for less: a truck stopped before the far end, and stood for good."""
    thing = {"lane": "west_in_0", "at": 40.0, "lateral": 1.6, "size": [6.0, 0.3], "heading_offset": -8.0}
    passed, _, _, touched, _ = drive(ring, event("accident", objects=[thing]), mix=mix)
    assert passed >= 2
    assert touched == 0


def test_of_two_things_on_two_sides_the_nearer_counts_first(ring):
    """Who drives fast sees both; the farther one, which asks for more, drew it towards the nearer."""
    events = (barrel(0.95, at=60.0), barrel(-0.8, at=36.0))
    ring.reset(PlanSource("roundabout", 5.0, "south", "right", warm_up_s=0.1, events=events).plan(1))
    ring.advance(STAND)
    passing, paths = ring._detours._passing, ring.network.paths
    (row,) = ring.network.movement("west", "east").rows
    s = np.array([float(paths.stop_s[row]) - 60.0 - 3.0])
    wanted = passing._wanted(np.array([row]), s, np.array([5.0]), np.array([20.0]))
    far = passing._wanted(np.array([row]), s + 24.0, np.array([5.0]), np.array([20.0]))
    assert -0.6 < wanted[0] < 0.0
    assert far[0] > 0.5
