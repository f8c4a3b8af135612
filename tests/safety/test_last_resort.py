"""Stop or go on: what the last resort lets through, and what it holds back."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rudc.arrays import Array
from rudc.geometry import gaps_between
from rudc.network.route import ReferencePath
from rudc.safety.filter import FilterConfig, SafetyFilter
from rudc.safety.kernels import LEAST
from rudc.safety.last_resort import HORIZON, STILL_MARGIN, LastResort
from rudc.safety.tyres import tyres_of
from rudc.vehicle import EgoVehicle
from rudc.world.ego import EgoPlant
from rudc.world.scene import Scene
from tests.safety.scenes import Other, Road, make_scene

ALONE = FilterConfig(max_vehicles=0, road=False)
"""no rows, so that only the last resort is left"""
THROTTLE = np.array([3.0, 0.0])


def status(scene: Scene, u: np.ndarray = THROTTLE, config: FilterConfig = ALONE) -> str:
    return SafetyFilter(config).filter(scene, u).status


def gap(scene: Scene) -> float:
    """m, between the ego and the nearest other."""
    n, body = scene.count, scene.vehicle
    own = np.repeat([[scene.ego.x, scene.ego.y]], n, axis=0), np.full(n, scene.ego.psi)
    size = np.array([body.length, body.width])
    return float(gaps_between(*own, size, scene.position, scene.heading, scene.size).min())


def drive(scene: Scene, u: np.ndarray, seconds: float = 6.0) -> tuple[float, Scene]:
    """Least gap and last scene, of a driver who always proposes `u`, on the real plant."""
    filter, plant, least = SafetyFilter(ALONE), EgoPlant(scene.vehicle), gap(scene)
    ego = scene.ego
    plant.reset(ego.x, ego.y, ego.psi, ego.v)
    for _ in range(round(seconds / 0.1)):
        answer = filter.filter(scene, u)
        for _ in range(2):
            ego = plant.step(float(answer.u[0]), float(answer.u[1]), 0.05)
            position = scene.position + 0.05 * scene.velocity
            s, offset = scene.route.path.project(ego.x, ego.y, scene.ego_s)
            scene = replace(scene, ego=ego, ego_s=s, ego_offset=offset, position=position)
            least = min(least, gap(scene))
    return least, scene


@given(
    st.floats(-4, 4),
    st.floats(-3.2, 3.2),
    st.floats(0, 12),
    st.floats(-0.3, 0.3),
    st.floats(1, 14),
    st.floats(0.5, 2.6),
)
@settings(max_examples=60)
def test_what_stands_still_is_never_hit(
    y: float, heading: float, v: float, delta: float, length: float, width: float
) -> None:
    room = 3.5 + 0.5 * math.hypot(length, width) + v * v / 12 + 2.0
    scene = make_scene([Other(room, y, heading, 0.0, length, width)], v=v)
    least, _ = drive(scene, np.array([3.0, delta]))
    assert least > 0.1


def test_it_drives_up_to_what_stands_in_its_way_and_no_further() -> None:
    least, last = drive(make_scene([Other(30.0, 0.0, length=7.5, width=2.4)], v=8.0), THROTTLE, 12.0)
    assert 0.1 < least < 0.5
    assert last.ego.v < 0.1


@pytest.mark.parametrize(("mu", "v"), [(0.2, 8.0), (0.15, 7.0), (0.1, 6.0)])
def test_on_ice_what_stands_still_is_not_hit_either(mu: float, v: float) -> None:
    """Stopping takes longer there than a dry road's horizon."""
    grip = 0.9 * mu * 9.81
    assert v / grip > HORIZON
    ice = EgoVehicle(a_min=-grip, a_max=grip)
    least, last = drive(make_scene([Other(3.5 + v * v / grip, 0.0)], v=v, vehicle=ice), THROTTLE, 20.0)
    assert least > 0.1
    assert last.ego.v < 0.1


def test_braking_comes_late_and_names_whom_it_is_for() -> None:
    truck = Other(20.0, 0.0, length=7.5, width=2.4)
    assert status(make_scene([truck], v=8.0)) == "nominal", "13.75 m are left, 5.3 to stop"
    near = make_scene([replace(truck, x=12.2)], v=8.0)
    answer = SafetyFilter(ALONE).filter(near, THROTTLE)
    assert (answer.status, answer.active) == ("last_resort", ("veh:sv0",))
    assert answer.u[0] == near.vehicle.a_min
    assert answer.correction == pytest.approx([-9.0, 0.0])
    assert status(near, config=FilterConfig(max_vehicles=0, road=False, last_resort=False)) == "nominal"


def test_going_on_is_as_good_as_stopping() -> None:
    crossing = Other(0.0, -40.0, math.pi / 2, 10.0, row=0, s=60.0)
    ahead_of_it = make_scene([crossing], x=-4.0, v=8.0)
    assert status(ahead_of_it) == "nominal", "it cannot stop before the crossing, but is through in 1 s"
    late = replace(crossing, y=-14.0, s=86.0)
    answer = SafetyFilter(ALONE).filter(make_scene([late], x=-6.8, v=6.0), THROTTLE)
    assert answer.status == "last_resort", "they would meet, and it can still stop"


def test_where_neither_helps_the_driver_is_left_to_it() -> None:
    scene = make_scene([Other(6.5, 0.0, math.pi, 10.0)], v=10.0)
    hopeless = SafetyFilter(ALONE).filter(scene, np.array([-6.0, 0.1]))
    assert hopeless.status == "nominal"
    assert hopeless.u == pytest.approx([-6.0, 0.1])


def test_who_drives_behind_is_not_looked_at() -> None:
    behind, ahead = Other(-12.0, 0.0, 0.0, 10.0), Other(7.0, 0.0)
    assert status(make_scene([behind], v=2.0), np.zeros(2)) == "nominal"
    answer = SafetyFilter(ALONE).filter(make_scene([behind, ahead], v=4.0), THROTTLE)
    assert answer.active == ("veh:sv0",)
    assert make_scene([behind, ahead], v=4.0).position[0, 0] == 7.0


def test_who_drives_behind_does_not_keep_it_from_braking() -> None:
    """Whom only full braking at once would meet was not left out."""
    crossing, behind = Other(0.0, -9.8, math.pi / 2, 7.8, row=0, s=90.2), Other(-35.9, 0.0, 0.0, 11.2)
    alone, pushed = (make_scene(others, x=-15.6, v=12.0) for others in ([crossing], [crossing, behind]))
    assert status(alone, np.zeros(2)) == status(pushed, np.zeros(2)) == "last_resort"


@pytest.mark.parametrize("away", [44.0, 46.0, 60.0])
def test_who_comes_fast_from_far_behind_does_not_make_it_go(away: float) -> None:
    """From more than 45 m behind it did not count as behind, and an ego that waited drove off."""
    crossing = Other(0.0, -32.0, math.pi / 2, 10.0, row=0, s=68.0)
    coming = Other(-7.0 - away, 0.0, 0.0, 25.0)
    assert status(make_scene([crossing, coming], x=-7.0), np.array([-6.0, 0.0])) == "nominal"


def test_a_truck_ahead_is_not_hit_for_the_sake_of_somebody_behind() -> None:
    truck, pushing = Other(6.5, 0.0, length=7.5, width=2.4), Other(-5.4, -7.5, 0.6, 4.0)
    scene = make_scene([truck, pushing], v=0.8)
    answer = SafetyFilter(ALONE).filter(scene, THROTTLE)
    assert answer.status == "last_resort"
    assert "veh:sv0" in answer.active


def test_who_brakes_is_taken_to_go_on_braking() -> None:
    crossing = Other(0.0, 1.0, math.pi / 2, 4.0, row=0, s=101.0)
    scene = make_scene([crossing], x=-9.5, v=8.0)
    assert status(scene, np.zeros(2)) == "nominal", "it is gone when the ego comes"
    assert status(replace(scene, acceleration=np.array([-8.0])), np.zeros(2)) == "last_resort"


@pytest.mark.parametrize(("gap", "held"), [(3.0, True), (6.5, False)])
def test_a_leader_may_brake_at_any_time_as_hard_as_cars_can(gap: float, held: bool) -> None:
    """Both at 10 m/s: the ego needs 1 + 100 / 12 m, the leader 100 / 18."""
    scene = make_scene([Other(5.0 + gap, 0.0, 0.0, 10.0)], v=10.0)
    assert (status(scene, np.zeros(2)) == "last_resort") == held
    assert status(make_scene([Other(5.0 + gap, 3.5, 0.0, 10.0)], v=10.0), np.zeros(2)) == "nominal"


@pytest.mark.parametrize("length", [5.0, 16.5])
def test_a_leader_is_one_however_long_it_is(length: float) -> None:
    """The centre of a lorry is far ahead of its tail: it was not known for a leader until it had braked."""
    scene = make_scene([Other(2.5 + 4.0 + 0.5 * length, 0.0, 0.0, 4.0, length)], v=8.0)
    assert status(scene, np.zeros(2)) == "last_resort"


@pytest.mark.parametrize("proposed", [0.0, 3.0])
@pytest.mark.parametrize(("length", "width", "away"), [(1.8, 0.6, 5.0), (5.0, 1.8, 3.0), (12.0, 2.5, 8.0)])
def test_where_everything_hits_it_brakes(length: float, width: float, away: float, proposed: float) -> None:
    """Bodies that overlap by more than their widths are as far apart whether the ego brakes or not."""
    scene = make_scene([Other(2.5 + away + 0.5 * length, 0.0, 0.0, 0.0, length, width)], v=14.0)
    answer = SafetyFilter(ALONE).filter(scene, np.array([proposed, 0.0]))
    assert (answer.status, answer.u[0]) == ("last_resort", scene.vehicle.a_min)


@pytest.mark.parametrize(("y", "held"), [(-5.0, False), (3.0, True)])
def test_where_everything_hits_it_does_not_leave_the_road_for_more_room(y: float, held: bool) -> None:
    """With the wheels as they are it would come past the other a little better, if there were road. It holds
    them no harder than lets it brake fully (tests/safety/test_tyres.py)."""
    scene = make_scene([Other(27.0, y + 0.5, speed=1.0)], x=20.0, y=y, v=12.0)
    scene = replace(scene, ego=replace(scene.ego, steering=-0.3))
    answer = SafetyFilter(ALONE).filter(scene, np.array([0.0, 0.0]))
    assert answer.status == "last_resort"
    firm = tyres_of(scene).firm(-0.3, 12.0)
    assert -0.15 < firm < -0.1
    assert answer.u.tolist() == [scene.vehicle.a_min, firm if held else 0.0]


def test_beside_somebody_it_may_drive_off_but_not_come_closer() -> None:
    beside = make_scene([Other(1.0, 2.0)], v=0.0)
    assert gap(beside) == pytest.approx(0.2)
    assert status(beside, np.array([1.0, 0.0])) == "nominal"
    assert status(beside, np.array([1.0, -0.3])) == "nominal"
    towards = make_scene([Other(1.0, 2.0)], v=1.0)
    assert status(towards, np.array([1.0, 0.4])) == "last_resort"


@pytest.mark.parametrize("delta", [0.0, 0.01])
def test_beside_who_stands_it_creeps_a_little_closer(delta: float) -> None:
    """Where a centimetre less than now was refused, the ego stood for good beside who waited for it."""
    beside = make_scene([Other(6.0, 1.94)], v=0.0)
    least, last = drive(beside, np.array([0.3, delta]), seconds=8.0)
    assert last.ego.x - beside.ego.x > 2.0
    assert LEAST - 0.03 < least < STILL_MARGIN


CROSSING = Other(0.0, -13.5, math.pi / 2, 10.0, row=0, s=86.5)
"""comes from the right, 1.3 s from where the ego's path crosses its own"""
BRAKE = np.array([-6.0, 0.0])


def held_up(*more: Other, **changes: Any) -> Scene:
    """An ego that would come to rest where CROSSING hits it, and is through before it if it goes on."""
    return make_scene([CROSSING, *more], **{"x": -2.9, "v": 6.0, **changes})


def test_who_would_be_hit_where_it_stops_goes_on() -> None:
    scene = held_up()
    for proposed in (BRAKE, np.array([-3.0, 0.0])):
        answer = SafetyFilter(ALONE).filter(scene, proposed)
        assert (answer.status, answer.active, answer.onwards) == ("onwards", ("veh:sv0",), True)
        assert answer.u == pytest.approx([scene.vehicle.a_max, 0.0])
        assert answer.correction == pytest.approx(answer.u - proposed)
    least, last = drive(scene, BRAKE, 2.0)
    assert least > 0.05, "and no longer than it must"
    assert last.ego.x > 4.0
    without = FilterConfig(max_vehicles=0, road=False, last_resort=False)
    assert SafetyFilter(without).filter(scene, BRAKE).u == pytest.approx(BRAKE)


@pytest.mark.parametrize(
    ("why", "scene"),
    [
        ("somebody stands on its way", held_up(Other(9.0, 0.0))),
        ("somebody else comes", held_up(Other(30.0, 0.0, math.pi, 12.0))),
        ("it would be too late", held_up(x=-5.5, v=2.0)),
        ("its car pulls away too slowly", held_up(x=-3.6, v=5.0, vehicle=EgoVehicle(a_max=0.3))),
        ("the other is about to stop", replace(held_up(), acceleration=np.array([-8.0]))),
        ("the other speeds up", replace(held_up(), acceleration=np.array([6.0]))),
        ("the other can still stop gently", make_scene([Other(0.0, -9.5, math.pi / 2, 3.3)], v=0.0)),
        ("nobody comes", make_scene([], x=-2.9, v=6.0)),
    ],
)
def test_it_does_not_go_on_where(why: str, scene: Scene) -> None:
    answer = SafetyFilter(ALONE).filter(scene, BRAKE)
    assert not answer.onwards, why
    assert answer.u[0] <= BRAKE[0]


def test_who_goes_on_reckons_with_the_bends_of_its_road() -> None:
    s = np.linspace(0.0, 2.0, 400)
    bend = np.column_stack([8.0 * np.sin(s), 8.0 - 8.0 * np.cos(s)])
    line = np.concatenate([np.array([[-100.0, 0.0]]), bend[:310]])
    path = ReferencePath(line)
    road = Road(path, path.xy, path.xy)
    wet = EgoVehicle(a_min=-2.0, a_max=2.0)
    scene = make_scene([], x=-4.0, v=5.0, route=road, vehicle=wet)
    judge = LastResort(ALONE)
    way = judge._go(scene, 0.5, 5.0)
    dry = judge._go(replace(scene, vehicle=EgoVehicle()), 0.5, 5.0)
    assert dry[-1] > way[-1] + 2.5

    def last_speed_inside(way: Array) -> float:
        inside = (scene.ego_s + way[1:-1] > 101.0) & (scene.ego_s + way[1:-1] < 110.0)
        return float((np.diff(way)[1:] / 0.1)[inside][-1])

    assert last_speed_inside(way) == pytest.approx(math.sqrt(0.8 * 2.0 * 8.0), rel=0.05)
    fast = judge._go(replace(scene, vehicle=EgoVehicle()), 1.0, 10.0)
    assert last_speed_inside(fast) == pytest.approx(math.sqrt(0.6 * 0.9 * 9.81 * 8.0), rel=0.02)


@pytest.mark.parametrize(("v", "farthest"), [(6.0, 15.0), (2.0, 7.5)])
def test_who_goes_on_does_so_as_far_as_the_vehicle_can(v: float, farthest: float) -> None:
    """A vehicle that drives 6 m/s at most was thought to be 20 m on after 2.5 s, where it is 15."""
    weak = EgoVehicle(a_max=0.8, v_max=6.0)
    way = LastResort(ALONE)._go(make_scene([], v=v, vehicle=weak), 0.1 * v, v)
    assert way[-1] <= min(farthest, v * 2.5 + 0.4 * 2.5**2) + 1e-9


@pytest.mark.parametrize("dt", [0.2, 0.4, 5.0])
def test_instants_are_whole_steps_apart(dt: float) -> None:
    """One step or more, over the horizon; 0.1 s apart they are 26."""
    times = LastResort(FilterConfig(dt=dt))._times
    assert times == pytest.approx(dt * np.arange(len(times)), abs=1e-12)
    assert len(times) > 1
    assert times[-2] < HORIZON <= times[-1]
    usual = LastResort(FilterConfig(dt=0.1))._times
    assert usual.tolist() == np.linspace(0.0, 2.5, 26).tolist()


def test_who_speeds_up_is_expected_sooner() -> None:
    late = replace(CROSSING, y=-16.2, s=83.8, speed=8.0)
    scene = make_scene([late], x=-9.1, v=8.0)
    assert status(scene, np.zeros(2)) == "nominal", "it is through before the other comes"
    assert status(replace(scene, acceleration=np.array([2.5])), np.zeros(2)) == "last_resort"
