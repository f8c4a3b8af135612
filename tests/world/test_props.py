"""Props: where they are on their ways, and for what they stop."""

import math
from dataclasses import replace

import numpy as np
import pytest

from rudc.world.props import (
    ACCELERATION,
    BRAKING,
    DRIVER_BACK_M,
    FURTHER_M,
    LONG_S,
    WALKING_PACE,
    Prop,
    standing,
)
from rudc.world.scene import Kind

BEND = np.array([[0.0, 0.0], [10.0, 0.0], [10.0, 20.0]])


def car(way=BEND, wanted=6.0):
    return Prop("prop", Kind.CAR, (5.0, 1.8), way, wanted=wanted)


def test_follows_its_way():
    prop = car()
    assert prop.pose() == (0.0, 0.0, 0.0)
    for _ in range(40):
        prop.step(0.05)
    assert prop.travelled == pytest.approx(12.0)
    assert prop.pose() == pytest.approx((10.0, 2.0, math.pi / 2))
    assert prop.pose(-4.0) == pytest.approx((8.0, 0.0, 0.0))
    assert not prop.finished
    for _ in range(61):
        prop.step(0.05)
    assert prop.finished


def test_starts_before_its_way_when_told_to():
    prop = car()
    prop.travelled = -3.0
    assert prop.pose() == pytest.approx((-3.0, 0.0, 0.0))


def test_a_standing_prop_stands():
    prop = standing("prop", Kind.TRUCK, 3.0, 4.0, 0.7, 7.5, 2.4)
    prop.step(1.0)
    assert prop.pose() == (3.0, 4.0, 0.7)
    assert not prop.finished
    assert prop.speed == 0.0


def drive_towards(prop, scene_at, steps=200):
    for i in range(steps):
        if i % 2 == 0:  # once a decision
            prop.look_out(scene_at(i))
        prop.step(0.05)
    return prop.pose()


def test_a_car_stops_short_of_what_stands_and_goes_on_when_it_leaves(make_scene):
    way = np.array([[-60.0, 100.0], [60.0, 100.0]])
    prop = car(way)
    blocked = make_scene({"at": (0.0, 100.0, 0.0)})
    free = make_scene({"at": (0.0, 110.0, 0.0)})
    x, _, _ = drive_towards(prop, lambda i: blocked)
    assert -6.5 < x < -5.5, "half a metre to a metre and a half between the bumpers"
    assert prop.speed <= 0.2, "it stands, but for its last centimetres"
    assert drive_towards(prop, lambda i: free)[0] > 30.0


def test_a_car_stops_short_of_a_long_closure(make_scene):
    """What counted was how far its middle was: the car was 15 m inside when it stopped."""
    prop = car(np.array([[-60.0, 100.0], [60.0, 100.0]]))
    closure = {"at": (40.0, 100.0, 0.0), "size": (80.0, 3.0), "kind": Kind.OBSTACLE}
    x, _, _ = drive_towards(prop, lambda i: make_scene(closure), steps=250)
    assert -4.0 < x < -2.5
    assert not car(np.array([[2.0, 100.0], [60.0, 100.0]])).has_room(make_scene(closure))


@pytest.mark.parametrize(("heading", "stops"), [(math.pi / 2, True), (math.pi, False)])
def test_a_car_stops_for_who_walks_across_its_way(make_scene, heading, stops):
    """A wrong-way driver stopped only for pedestrians who stood. Of two that come towards each other neither
    would go on."""
    prop = car(np.array([[-60.0, 100.0], [60.0, 100.0]]))
    walker = {"at": (0.0, 100.0, heading), "v": 1.4, "size": (0.5, 0.5), "kind": Kind.PEDESTRIAN}
    x, _, _ = drive_towards(prop, lambda i: make_scene(walker), steps=220)
    assert (x < -2.75) is stops


@pytest.mark.parametrize(("wanted", "start"), [(6.0, -20.0), *((12.6, -50.0 + 0.25 * k) for k in range(8))])
def test_a_car_stops_for_an_oncoming_one_that_brakes(make_scene, wanted, start):
    """Between two looks a fast one came nearer by more than its margin."""
    prop = car(np.array([[start, 100.0], [60.0, 100.0]]), wanted)
    them = make_scene({"row": 0, "s": 10.0})

    def oncoming(i):
        """It comes at 8 m/s from x = 60 m and from second 4 on brakes with 5 m/s2."""
        t = 0.05 * i
        v = max(8.0 - 5.0 * max(t - 4.0, 0.0), 0.0)
        x = 60.0 - 8.0 * min(t, 4.0) - (64.0 - v**2) / 10.0
        seen.append(x)
        at = np.array([[x, 100.0]])
        return replace(them, position=at, velocity=np.array([[-v, 0.0]]), heading=np.array([math.pi]))

    seen: list[float] = []
    x, _, _ = drive_towards(prop, oncoming, steps=140)
    assert prop.speed == 0.0
    assert x + 2.5 < seen[-1] - 2.5


def test_a_driver_who_is_held_up_makes_room_and_keeps_it(make_scene):
    prop = car(np.array([[-60.0, 100.0], [60.0, 100.0]]))
    for x in (0.0, -8.0):  # who stands before it, and comes nearer
        before_it = make_scene({"at": (x, 100.0, math.pi)})
        drive_towards(prop, lambda i, scene=before_it: scene, steps=600)
        assert x - 2.5 - (prop.pose()[0] + 2.5) == pytest.approx(DRIVER_BACK_M + FURTHER_M + 0.4, abs=0.5)
        assert prop.speed == 0.0
    assert drive_towards(prop, lambda i: make_scene(), steps=600)[0] > 30.0, "it goes on once its way is free"


def test_a_driver_goes_back_as_a_car_does_and_not_again_and_again_before_who_creeps_up(make_scene):
    """It was at its full speed at once, and backed a little at each little step of an ego that crept up."""
    prop = car(np.array([[-60.0, 100.0], [60.0, 100.0]]))
    drive_towards(prop, lambda i: make_scene({"at": (0.0, 100.0, math.pi)}), steps=500)
    speeds = []
    for i in range(600):  # 0.4 m/s towards it
        prop.look_out(make_scene({"at": (-0.02 * i, 100.0, math.pi)}))
        prop.step(0.05)
        speeds.append(prop.speed)
    changes = np.diff(speeds)
    assert min(speeds) < 0.0
    assert changes.min() >= -ACCELERATION * 0.05 - 1e-9
    assert changes.max() <= BRAKING * 0.05 + 1e-9
    assert np.count_nonzero((np.array(speeds[1:]) < 0.0) & (np.array(speeds[:-1]) >= 0.0)) <= 2


def test_a_driver_who_has_gone_back_to_where_it_appeared_backs_out_of_the_road(make_scene):
    prop = car(np.array([[-60.0, 100.0], [-20.0, 100.0], [60.0, 100.0]]))
    prop.travelled = prop.appeared_m = 40.0
    prop.may_back_out = True
    follower = [-12.0]

    def nose_to_nose(i):
        follower[0] = min(follower[0], prop.pose()[0] + 12.0)  # drives up whenever it backs
        return make_scene({"at": (follower[0], 100.0, math.pi)})

    drive_towards(prop, nose_to_nose, steps=200)
    assert 0.0 < prop.travelled < 36.0
    assert not prop.finished
    drive_towards(prop, lambda i: make_scene(), steps=60)
    assert prop.travelled < 30.0, "it has given up, though its way is free now"
    drive_towards(prop, lambda i: make_scene(), steps=500)
    assert prop.finished


@pytest.mark.parametrize(("appeared", "may"), [(30.0, True), (0.0, True), (0.0, False)])
def test_a_driver_against_a_lane_gives_up_if_it_is_held_up_for_long(make_scene, appeared, may):
    """The other does not drive off, though there is room."""
    prop = car(np.array([[-60.0, 100.0], [60.0, 100.0]]))
    prop.travelled, prop.appeared_m, prop.may_back_out = 40.0, appeared, may
    stands = make_scene({"at": (0.0, 100.0, math.pi)})
    drive_towards(prop, lambda i: stands, steps=round((LONG_S + 2.0) / 0.05))
    assert not prop.finished
    drive_towards(prop, lambda i: stands, steps=800)
    assert prop.finished is may


def test_a_moment_in_which_the_way_is_free_does_not_make_who_is_held_up_begin_anew(make_scene):
    """Where a queue moved up now and then, a pedestrian stayed on the road, and a driver against a lane
    never gave up."""
    way = np.array([[-60.0, 100.0], [60.0, 100.0]])
    walker, driver = Prop("walker", Kind.PEDESTRIAN, (0.5, 0.5), way, wanted=1.4), car(way)
    stands, free = make_scene({"at": (0.0, 100.0, math.pi / 2)}), make_scene()
    for prop, at, appeared in ((walker, 58.0, 53.0), (driver, 54.0, 30.0)):
        prop.travelled, prop.appeared_m, prop.speed = at, appeared, 0.0
        prop.may_back_out = prop is driver
        drive_towards(prop, lambda i: free if i % 80 < 2 else stands, steps=round(3.0 * LONG_S / 0.05))
    assert [walker.travelled < 54.0, driver.finished or driver.travelled < 28.0] == [True, True]


def test_who_gets_on_by_stop_and_go_does_not_give_up(make_scene):
    prop, free = car(np.array([[-60.0, 100.0], [60.0, 100.0]])), make_scene()
    prop.may_back_out = True
    before = lambda i: make_scene({"at": (prop.pose()[0] + 3.9, 100.0, 1.6)}) if i % 80 < 48 else free  # noqa: E731
    drive_towards(prop, before, steps=round(3.0 * LONG_S / 0.05))
    assert prop.travelled > 12.0


def test_a_driver_who_has_gone_back_stops_for_an_ego_that_moves(make_scene):
    ego = make_scene(v=1.0)
    psi, place = ego.ego.psi, np.array([ego.ego.x, ego.ego.y])
    way = place + np.outer([40.0, -40.0], [math.cos(psi), math.sin(psi)])
    for room, stops in ((0.0, False), (1.0, True)):
        prop = car(way, wanted=2.0)
        prop.travelled, prop._stepped_back = 33.0, room
        drive_towards(prop, lambda i: ego, steps=40)
        assert (prop.travelled < 33.5) is stops


@pytest.mark.parametrize(("pace", "stops"), [(WALKING_PACE - 0.1, True), (WALKING_PACE + 0.1, False)])
def test_a_driver_stops_for_an_ego_at_walking_pace_not_for_a_faster_one(make_scene, pace, stops):
    ego = make_scene(v=pace)
    psi, place = ego.ego.psi, np.array([ego.ego.x, ego.ego.y])
    prop = car(place + np.outer([40.0, -40.0], [math.cos(psi), math.sin(psi)]), wanted=4.0)
    drive_towards(prop, lambda i: ego, steps=190)
    assert (prop.travelled < 35.0) is stops


def test_a_driver_who_has_stopped_does_not_set_off_into_an_ego_that_pulls_out(make_scene):
    stands, pulls_out = make_scene(v=0.0), make_scene(v=3.0)
    psi, place = stands.ego.psi, np.array([stands.ego.x, stands.ego.y])
    prop = car(place + np.outer([40.0, -40.0], [math.cos(psi), math.sin(psi)]), wanted=4.0)
    drive_towards(prop, lambda i: stands, steps=190)
    before = prop.travelled
    drive_towards(prop, lambda i: pulls_out, steps=40)
    assert prop.travelled <= before
    drive_towards(prop, lambda i: make_scene(front=-60.0), steps=80)
    assert prop.travelled > before, "and goes on once the way is free"


def test_a_driver_who_has_stopped_does_not_set_off_into_an_ego_that_passes_close_by(make_scene):
    """It set off once the ego was beside its way, and turned into the ego's flank."""
    ego = make_scene(v=3.0)
    psi, place = ego.ego.psi, np.array([ego.ego.x, ego.ego.y])
    along, aside = np.array([math.cos(psi), math.sin(psi)]), np.array([-math.sin(psi), math.cos(psi)])
    for beside, sets_off in ((2.1, False), (2.4, True)):
        prop = car(place + beside * aside + np.outer([40.0, -40.0], along), wanted=4.0)
        prop.travelled, prop.speed = 35.0, 0.0
        drive_towards(prop, lambda i: ego, steps=40)
        assert (prop.travelled > 35.5) is sets_off


@pytest.mark.parametrize(("v", "away", "sets_off"), [(6.0, 8.0, False), (6.0, 14.0, True), (1.0, 4.0, True)])
def test_a_driver_who_has_stopped_lets_an_ego_pass_that_would_have_to_brake_hard(
    make_scene, v, away, sets_off
):
    """It looked 1 m ahead only, and was a lane farther, and not to be stopped, when the ego came."""
    ego = make_scene(v=v)
    psi, place = ego.ego.psi, np.array([ego.ego.x, ego.ego.y])
    along, aside = np.array([math.cos(psi), math.sin(psi)]), np.array([-math.sin(psi), math.cos(psi)])
    prop = car(place + (2.5 + away) * along + np.outer([15.0, -15.0], aside), wanted=4.0)
    prop.travelled, prop.speed = 9.0, 0.0
    drive_towards(prop, lambda i: ego, steps=40)
    assert (prop.travelled > 9.5) is sets_off


@pytest.mark.parametrize(("left", "sets_off"), [(15.0, True), (11.0, False)])
def test_who_has_stopped_in_the_way_of_an_ego_that_comes_goes_on(make_scene, left, sets_off):
    """It waited there for the ego, which could not pass."""
    ego = make_scene(v=6.0)
    psi, place = ego.ego.psi, np.array([ego.ego.x, ego.ego.y])
    along, aside = np.array([math.cos(psi), math.sin(psi)]), np.array([-math.sin(psi), math.cos(psi)])
    prop = car(place + 8.0 * along + np.outer([15.0, -15.0], aside), wanted=4.0)
    prop.travelled, prop.speed = left, 0.0  # m along its way, which meets the middle of the ego's at 15
    drive_towards(prop, lambda i: ego, steps=20)
    assert (prop.travelled > left + 0.2) is sets_off


def test_a_driver_does_not_go_back_into_somebody(make_scene):
    prop = car(np.array([[-60.0, 100.0], [60.0, 100.0]]))
    both = make_scene({"at": (0.0, 100.0, math.pi)}, {"at": (-14.0, 100.0, 0.0)})
    prop.travelled = 52.0
    x, _, _ = drive_towards(prop, lambda i: both, steps=600)
    assert -14.0 + 2.5 < x - 2.5 < -10.0


@pytest.mark.parametrize(("kind", "speed"), [(Kind.PEDESTRIAN, 1.4), (Kind.CAR, 0.5)])
def test_ice_keeps_a_vehicle_from_setting_off_at_once_but_no_pedestrian(make_scene, kind, speed):
    """A pedestrian braked there as on a dry road, and set off as a vehicle does."""
    prop = Prop("prop", kind, (0.5, 0.5), np.array([[-60.0, 100.0], [60.0, 100.0]]), wanted=1.4)
    prop.speed, prop.grip = 0.0, 0.5
    drive_towards(prop, lambda i: make_scene(), steps=20)
    assert prop.speed == pytest.approx(speed)


def test_who_runs_needs_some_way_to_stop_and_stops_before_who_stands(make_scene):
    """A runner came to rest from 4 m/s in one step."""
    prop = Prop("runner", Kind.PEDESTRIAN, (0.5, 0.5), np.array([[0.0, 90.0], [0.0, 110.0]]), wanted=4.0)
    speeds = [prop.speed]
    for _ in range(90):
        prop.look_out(make_scene({"at": (0.0, 100.0, 0.0)}))
        prop.step(0.05)
        speeds.append(prop.speed)
    assert min(np.diff(speeds)) == pytest.approx(-BRAKING * 0.05)
    assert prop.speed == 0.0
    assert 98.0 < prop.pose()[1] + 0.25 < 99.1, "before the car's side at 99.1"


def test_who_is_faster_does_not_drive_into_the_one_ahead(make_scene):
    """Cyclists of a column whose speeds differ rode through one another."""
    way = np.array([[0.0, 90.0], [0.0, 130.0]])
    column = [Prop(str(i), Kind.BICYCLE, (1.8, 0.6), way, wanted=v) for i, v in enumerate((3.0, 6.0))]
    column[0].travelled, gaps = 8.0, []
    for _ in range(120):
        poses = [prop.pose() for prop in column]
        gaps.append(poses[0][1] - poses[1][1] - 1.8)
        scene = make_scene(*({"at": pose, "v": p.speed} for pose, p in zip(poses, column, strict=True)))
        scene = replace(scene, ids=("0", "1"), size=np.tile([1.8, 0.6], (2, 1)))
        for prop in column:
            prop.look_out(scene)
            prop.step(0.05)
    assert min(gaps) > 0.3
    assert column[0].speed == 3.0, "who is ahead goes on"


def test_a_place_that_its_way_names_twice_turns_nobody():
    """Behind a start inside the junction a driver looked to the east, not back along its way."""
    way = np.array([[0.0, 0.0], [0.0, 0.0], [0.0, 10.0]])
    driver = Prop("driver", Kind.CAR, (5.0, 1.8), way, wanted=5.0)
    assert driver.pose(-3.0) == pytest.approx((0.0, -3.0, math.pi / 2))


@pytest.mark.parametrize(
    ("other", "room"),
    [
        ({"at": (18.0, 100.0, math.pi), "v": 8.0}, False),
        ({"at": (26.0, 100.0, math.pi), "v": 8.0}, True),
        ({"at": (18.0, 100.0, math.pi), "v": 2.0}, True),
        ({"at": (-8.0, 100.0, 0.0), "v": 8.0}, False),
        ({"at": (-8.0, 100.0, math.pi), "v": 8.0}, True),
        ({"at": (1.0, 100.0, 0.0)}, False),
        ({"at": (18.0, 104.0, math.pi), "v": 8.0}, True),
    ],
    ids=["oncoming", "far", "slow", "from behind", "drives off", "stands there", "beside"],
)
def test_there_is_room_where_all_can_stop(make_scene, other, room):
    """An oncoming car at 8 m/s goes 5.6 m until it brakes, and 5.3 m until it stands; the prop 3.8 m."""
    prop = car(np.array([[0.0, 100.0], [60.0, 100.0]]))
    scene = replace(make_scene(other), path=np.array([0]))
    assert prop.has_room(scene) == room
