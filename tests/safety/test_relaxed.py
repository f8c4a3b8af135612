"""What the filter does where not all rows can hold."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from rudc.safety.filter import FilterConfig, SafetyFilter
from rudc.safety.last_resort import COMING_S, GOES_ON_S, LastResort
from rudc.safety.tyres import tyres_of
from rudc.vehicle import EgoVehicle
from rudc.world.scene import Scene
from tests.safety.scenes import Other, make_scene, straight_road


@pytest.mark.parametrize("y", [-0.75, -0.9])
def test_steering_stays_on_the_road_for_somebody_for_whom_the_ego_brakes(y: float) -> None:
    """Random destination, seed 50: it swerved off the road beside the junction, for a car on its far side."""
    road = straight_road(half_width=2.0)
    crossing = Other(18.0, 9.0, -math.pi / 2, 5.0)
    scene = make_scene([crossing], y=y, psi=-0.03, v=11.0, route=road)
    config = FilterConfig.preset("ttcbf", constrained="all", last_resort=False)
    answer = SafetyFilter(config).filter(scene, np.array([3.0, 0.0]))
    assert answer.status == "relaxed"
    assert answer.u[0] < 0.0
    assert answer.u[1] > 0.0, "away from the edge"


def in_the_way(*more: Other, distance: float = 25.0, **changes: Any) -> Scene:
    """An ego that creeps, half in the way of a car from the right, whose row no action satisfies."""
    comes = Other(0.0, -distance, math.pi / 2, 10.0, row=0, s=100.0 - distance)
    return make_scene([comes, *more], **{"x": -1.0, "v": 2.0, **changes})


def speeding_up(distance: float, speed: float, rate: float, **changes: Any) -> Scene:
    """As `in_the_way`, with a car that drives at `speed` m/s and speeds up with `rate` m/s2."""
    comes = Other(0.0, -distance, math.pi / 2, speed, row=0, s=100.0 - distance)
    return replace(make_scene([comes], **changes), acceleration=np.array([rate]))


GENTLY = np.array([2.0, 0.0])
ON_ICE = EgoVehicle(a_min=-1.8)
ECBF = FilterConfig.preset("ecbf")


def test_who_would_stop_in_somebodys_way_and_is_out_of_it_in_time_goes_on() -> None:
    scene = in_the_way()
    answer = SafetyFilter(ECBF).filter(scene, GENTLY)
    assert (answer.status, answer.active, answer.onwards) == ("onwards", ("veh:sv0",), True)
    assert (answer.u == GENTLY).all()
    without = SafetyFilter(FilterConfig.preset("ecbf", last_resort=False)).filter(scene, GENTLY)
    assert (without.status, without.infeasible) == ("relaxed", True)
    assert without.u[0] < -3.0


@pytest.mark.parametrize(
    "scene",
    [
        in_the_way(Other(13.0, 0.0, 0.0, 2.0)),
        speeding_up(10.95, 3.42, 1.7, x=-0.53, v=1.62),
        speeding_up(17.6, 5.73, 1.85, x=-1.27, v=1.65),
        in_the_way(x=-3.0, vehicle=ON_ICE),
    ],
)
def test_so_does_one_with_a_slow_leader_or_before_somebody_who_speeds_up_or_cannot_stop(scene: Scene) -> None:
    """It may stop again beyond the other's way. Who speeds up has not begun to do so half a second ago. And
    with nothing to spare, where the other could not stop for it: on a dry road it does not (below).
    """
    answer = SafetyFilter(ECBF).filter(scene, GENTLY)
    assert answer.status == "onwards"
    assert (answer.u == GENTLY).all()


def test_so_does_one_whose_rows_all_hold_if_it_brakes_for_a_slow_leader() -> None:
    """held-out-29, seed 6001: it crept for a bus 12 m ahead, and stopped in a motorcycle's way."""
    scene = in_the_way(Other(12.0, 0.0, 0.0, 0.5), distance=22.0, v=3.0)
    without = SafetyFilter(FilterConfig.preset("ecbf", last_resort=False)).filter(scene, GENTLY)
    assert without.status == "solved"
    assert without.u[0] < -1.0
    answer = SafetyFilter(ECBF).filter(scene, GENTLY)
    assert (answer.status, answer.active) == ("onwards", ("veh:sv1",))
    alone = make_scene([Other(12.0, 0.0, 0.0, 0.5)], x=-1.0, v=3.0)
    assert SafetyFilter(ECBF).filter(alone, GENTLY).status == "solved", "nobody comes"


@pytest.mark.parametrize(("distance", "goes_on"), [(10.0, True), (9.7, False)])
def test_half_the_margin_is_enough_where_a_stop_would_be_hit(distance: float, goes_on: bool) -> None:
    """icy_junction, seeds 330007 and 330103: it missed by less than the margin, stopped, and was hit."""
    answer = SafetyFilter(ECBF).filter(speeding_up(distance, 3.42, 1.7, x=-0.53, v=1.62), GENTLY)
    assert answer.onwards is goes_on


@pytest.mark.parametrize("dt", [0.1, 1.0, 2.0])
def test_an_ego_that_goes_on_and_then_stops_never_drives_backwards(dt: float) -> None:
    """Also where a step is longer than the time for which it goes on."""
    scene, last = in_the_way(), LastResort(FilterConfig.preset("ecbf", dt=dt))
    last._times, last._tyres = last._until(COMING_S), tyres_of(scene)
    way = 3.0 * last._times
    for end_s in GOES_ON_S:
        driven = last._ended(way, end_s)
        assert (np.diff(driven) >= 0.0).all()
        assert (driven <= way + 1e-9).all()
        assert driven[-1] == pytest.approx(3.0 * max(end_s, dt) + 9.0 / 12.0, abs=3.0 * dt)


@pytest.mark.parametrize(
    ("why", "scene"),
    [
        ("the other comes too soon", in_the_way(distance=15.0)),
        ("it would be out of the way at the last moment", in_the_way(x=-3.0)),
        ("it stops before the other's way", in_the_way(x=-5.0, v=2.0, distance=15.0)),
        ("somebody stands on its way", in_the_way(Other(6.5, 0.0))),
        ("somebody else comes", in_the_way(Other(0.0, 9.0, -math.pi / 2, 4.0))),
        ("its leader leaves it no room beyond the other's way", in_the_way(Other(7.0, 0.0, 0.0, 1.0))),
        ("the other, who speeds up, would hit it", speeding_up(10.95, 3.42, 3.4, x=-0.53, v=1.62)),
    ],
)
def test_it_does_not_go_on_where(why: str, scene: Scene) -> None:
    answer = SafetyFilter(ECBF).filter(scene, GENTLY)
    assert not answer.onwards, why
    assert answer.u[0] < GENTLY[0]
