"""How an ego that must give way comes to its waiting point; on scenes made by hand."""

# ruff: noqa: F811 -- fixtures come by import
from dataclasses import replace

import numpy as np
import pytest

from rudc.agents.approach import (
    ACCELERATIONS,
    AT_POINT,
    CLOSE,
    CLOSE_TO_FAST,
    HARDEST,
    PLANNED,
    SLOW,
    ready_to_wait,
)
from rudc.agents.gaps import crossing, suffices
from rudc.agents.outlook import OutlookSettings
from rudc.agents.registry import make_agent
from rudc.env.tracking import LATERAL, speeds_in_bends
from rudc.world.ego import EgoPlant
from rudc.world.scene import STANDING
from tests.world.conftest import four_way, make_scene  # noqa: F401 -- fixtures

FULL = np.array([3.0, 0.0])


@pytest.fixture(scope="module")
def first(four_way):
    """Rows from the west, straight on: that road goes first."""
    rows = four_way.movement("west", "straight").rows
    assert all(four_way.paths.yields[four_way.route("south", "left").row, row] for row in rows)
    return rows


def coming(four_way, row, metres, v):
    """Somebody on the row, that far before its stop line."""
    return {"row": row, "s": float(four_way.paths.stop_s[row]) - metres, "v": v}


def on_ice(four_way, grip):
    """The car, where the road gives so many m/s2."""
    return replace(four_way.vehicle, a_min=-grip, a_max=min(four_way.vehicle.a_max, grip))


def drive(scene, seconds=6.0):
    """m before the waiting point, and m/s, decision by decision, with full acceleration asked for."""
    plant, s, seen = EgoPlant(scene.vehicle), scene.ego_s, []
    plant.resume(scene.ego, plant.actuation)
    for _ in range(int(10 * seconds)):
        x, y, psi = scene.route.path.pose(s)
        now = replace(scene, ego=replace(plant.state, x=float(x), y=float(y), psi=float(psi)), ego_s=s)
        before = plant.state.v
        s += 0.05 * (before + plant.step(float(ready_to_wait(now, FULL)[0]), 0.0, 0.1).v)
        seen.append((scene.route.waiting_s - s - 0.5 * scene.vehicle.length, plant.state.v))
        if seen[-1][1] < STANDING:
            break
    return np.array(seen)


@pytest.mark.parametrize(("v", "grip"), [(7.0, HARDEST), (12.0, HARDEST), (7.0, 1.5), (9.0, 3.0)])
def test_it_can_stop_where_it_waits_while_somebody_who_goes_first_is_near(
    make_scene, four_way, first, v, grip
):
    other = coming(
        four_way, first[0], -10.0, 1.5
    )  # creeps where the ways meet and, in this test, stays there
    car = on_ice(four_way, grip)
    room, speed = drive(make_scene(other, turn="left", front=-40.0, v=v, vehicle=car), seconds=12.0).T
    assert speed[-1] < STANDING
    assert (speed**2 / (2 * grip) < room).all(), "it could always still stop before the waiting point"
    assert 0.0 < room[-1] < AT_POINT + 1.0, "and it is used"


def test_it_is_free_where_nobody_goes_first(make_scene, four_way, first):
    south_left = {"turn": "left", "front": -3.0, "v": 8.0}
    near, far = coming(four_way, first[0], -10.0, 1.5), coming(four_way, first[0], 90.0, 6.0)
    gone = {"row": first[0], "s": float(four_way.paths.exit_s[first[0]]) + 8.0, "v": 8.0}
    assert ready_to_wait(make_scene(near, **south_left), FULL)[0] < -1.0
    for others in ((), (far,), (gone,)):
        assert ready_to_wait(make_scene(*others, **south_left), FULL) is FULL


def test_it_is_free_where_the_other_gives_way(make_scene, four_way):
    minor = four_way.movement("south", "straight").rows[0]
    scene = make_scene(coming(four_way, minor, 4.0, 6.0), origin="west", turn="straight", front=-8.0)
    assert not four_way.paths.yields[scene.route.row, minor]
    assert ready_to_wait(scene, FULL) is FULL


def test_it_comes_later_rather_than_stopping_where_that_will_do(make_scene, four_way, first):
    soon_gone = coming(four_way, first[1], -16.0, 6.0)
    commands = [
        float(ready_to_wait(make_scene(soon_gone, front=front, v=9.0), FULL)[0])
        for front in np.arange(-20.0, 0.0, 0.5)
    ]
    assert ACCELERATIONS[-1] in commands, "somewhere braking a little is enough"
    assert min(commands) < ACCELERATIONS[-1], "and somewhere not"
    assert commands[0] == FULL[0], "and far enough away it is free"


def test_it_is_held_back_sooner_for_somebody_slow_who_may_speed_up(make_scene, four_way, first):
    def gap_short_by(margin, scene):
        found = crossing(scene)
        return not suffices(scene, found, speeds_in_bends(scene.route.path), margin=-margin).all()

    held = {True: 0, False: 0}
    for v in (4.0, 12.0):
        slow = v < SLOW * four_way.paths.speed_limit[first[0]]
        for metres in np.arange(-8.0, 80.0, 1.0):
            scene = make_scene(coming(four_way, first[0], metres, v), turn="left", front=-1.0, v=8.0)
            free = ready_to_wait(scene, FULL) is FULL
            assert not free or not gap_short_by(CLOSE if slow else CLOSE_TO_FAST, scene)
            held[slow] += not free and not gap_short_by(CLOSE_TO_FAST, scene)
    assert held[True] > 0, "by gaps that are short by a little"
    assert held[False] == 0


def test_who_speeds_up_does_not_let_it_go_by_becoming_fast(make_scene, four_way, first):
    """Held back by somebody slow, the ego was free once that one drove at half its limit: it went in front of
    a vehicle that sped up."""
    held = {0.0: 0, 2.0: 0}
    for a in held:
        for metres in np.arange(-8.0, 40.0, 1.0):
            scene = make_scene(coming(four_way, first[0], metres, 7.0), turn="left", front=-1.0, v=8.0)
            scene = replace(scene, acceleration=np.array([a]))
            held[a] += ready_to_wait(scene, FULL) is not FULL
    assert held[2.0] > held[0.0] + 5


@pytest.mark.parametrize("grip", [1.5, 3.0])
def test_on_a_poor_road_a_gap_that_is_a_little_too_short_holds_it_back(make_scene, four_way, first, grip):
    car, v, held = on_ice(four_way, grip), 10.0, 0
    route = four_way.route("south", "left")
    front = route.waiting_s - route.stop_line_s - AT_POINT - 5.0**2 / (2 * grip * PLANNED / HARDEST)
    for metres in np.arange(-8.0, 80.0, 1.0):
        other = coming(four_way, first[0], metres, v)
        scene = make_scene(other, turn="left", front=front, v=5.0, vehicle=car)
        profile = speeds_in_bends(scene.route.path) * np.sqrt(grip * PLANNED / HARDEST / LATERAL)
        free = ready_to_wait(scene, FULL) is FULL
        found = crossing(scene)
        if found is None:
            continue
        on_poor, on_dry = (
            suffices(scene, found, profile, margin=-short).all()
            for short in (CLOSE_TO_FAST * grip / HARDEST, CLOSE_TO_FAST)
        )
        assert on_poor or not free
        held += on_dry and not free
    assert held > 0, "by gaps that would not count on a dry road"


def test_steering_stays_and_harder_braking_too(make_scene, four_way, first):
    scene = make_scene(coming(four_way, first[0], -10.0, 1.5), turn="left", front=-3.0)
    assert ready_to_wait(scene, np.array([3.0, 0.2]))[1] == 0.2
    braking = np.array([-6.0, 0.0])
    assert ready_to_wait(scene, braking) is braking


@pytest.mark.parametrize(
    ("room", "v", "free"), [(11.0, 12.0, True), (0.9, 1.5, False), (0.4, 0.2, False), (-0.1, 0.2, True)]
)
def test_only_who_cannot_stop_there_is_left_to_the_driver(make_scene, four_way, first, room, v, free):
    other, route = coming(four_way, first[0], -10.0, 1.5), four_way.route("south", "left")
    front = route.waiting_s - route.stop_line_s - room
    assert (ready_to_wait(make_scene(other, turn="left", front=front, v=v), FULL) is FULL) is free


def test_it_can_be_left_out(make_scene, four_way, first):
    scene = make_scene(coming(four_way, first[0], -10.0, 1.5), turn="left", front=-3.0)
    for approach, held in ((True, True), (False, False)):
        outlook = OutlookSettings(course=True, approach=approach).make()
        outlook.reset(scene)
        assert bool(outlook.govern(outlook.see(scene), FULL)[0] < 0.0) is held
        assert outlook.govern(scene, FULL, onwards=True)[0] > 0.0, "who would be hit if it stopped goes on"
    with pytest.raises(Exception, match="course=false"):
        make_agent("follower:outlook.approach=true")
