"""Who comes into the ego's way so near that it can only meet him."""

import numpy as np
import pytest

from rudc.scenario.events.stage import Halt
from rudc.vehicle import Actuation
from rudc.world.events.sudden import would_meet
from rudc.world.props import Prop
from rudc.world.scene import Kind
from tests.plans import PlanSource, event

BRAKING = 6.0


def walker(scene, ahead, right, speed=2.5):
    """A man who walks at right angles over the ego's way, `right` m to its right and `ahead` m before its
    middle now."""
    x, y, psi = (float(v) for v in scene.route.path.pose(scene.ego_s + ahead))
    over = np.array([-np.sin(psi), np.cos(psi)])
    start = np.array([x, y]) - right * over
    return Prop("man", Kind.PEDESTRIAN, (0.5, 0.5), np.array([start, start + 20.0 * over]), wanted=speed)


@pytest.mark.parametrize(
    ("ahead", "right", "v", "meets"),
    [
        (5.0, 2.5, 7.2, True),  # it can neither stop nor be past before he is there
        (5.0, 8.0, 7.2, False),  # it is past long before
        (12.0, 2.5, 7.2, False),  # it can stop
        (12.0, 2.5, 11.0, True),  # the faster it drives, the less
        (25.0, 2.5, 11.0, False),  # he is over before it
    ],
)
def test_it_is_met_by_braking_and_by_driving_on(make_scene, ahead, right, v, meets):
    scene = make_scene(v=v, front=-20.0)
    assert would_meet(scene, BRAKING, Actuation(), walker(scene, ahead, right)) == meets


def test_on_ice_and_with_a_late_car_more_cannot_be_avoided(make_scene):
    scene = make_scene(v=7.2, front=-20.0)
    man = walker(scene, 9.0, 3.5, speed=2.0)
    assert not would_meet(scene, BRAKING, Actuation(), man)
    assert would_meet(scene, 1.5, Actuation(), man)
    assert would_meet(scene, BRAKING, Actuation(delay_s=0.5, lag_s=0.3), man)


def test_whoever_comes_up_to_an_ego_that_stands_by_then_can_be_avoided(make_scene):
    """He who drives on the wrong side stops before it; sent from 30 m away he was always to blame."""
    scene = make_scene(v=8.0, front=-40.0)
    x, y, psi = (float(v) for v in scene.route.path.pose(scene.ego_s + 30.0))
    along = np.array([np.cos(psi), np.sin(psi)])
    way = np.array([[x, y], np.array([x, y]) - 40.0 * along])
    driver = Prop("driver", Kind.CAR, (5.0, 1.8), way, wanted=8.0)
    assert not would_meet(scene, BRAKING, Actuation(), driver)
    driver.travelled = 17.0
    assert would_meet(scene, BRAKING, Actuation(), driver)


def test_a_halt_on_the_way_counts(make_scene):
    scene = make_scene(v=7.2, front=-20.0)
    man = walker(scene, 5.0, 2.5)
    man.halt = Halt(1.0, 3.0)
    assert not would_meet(scene, BRAKING, Actuation(), man)  # he stops beside its way
    man.halt = Halt(2.0, 3.0)
    assert would_meet(scene, BRAKING, Actuation(), man)


def test_the_ice_ahead_counts(world):
    runs = event(
        "pedestrian_crossing",
        arm="south",
        at=9.0,
        speed=2.0,
        when={"ego_distance_to_junction": {"below": 22}},
    )
    ice = event("slippery_patch", lane="south_in_0", at=2.0, length=19.0, friction=0.08)
    for events, sudden in (((runs,), False), ((ice, runs), True)):
        plan = PlanSource(
            origin="south", turn="straight", density=0.0, speed=(8.0, 8.0), events=events, warm_up_s=0.1
        )
        world.reset(plan.plan(0))
        while not any(name.startswith("pedestrian") for name in world.scene().ids):
            world.advance(np.array([0.0, 0.0]))
        assert bool(world.stage.sudden) == sudden


@pytest.mark.parametrize(("at", "speed", "fault"), [(17.0, 3.0, "other"), (9.0, 2.0, "ego")])
def test_whoever_runs_before_the_ego_is_to_blame_only_where_it_could_not_stop(world, at, speed, fault):
    """An ego that never brakes hits both; for the second there was time to stop."""
    runs = event(
        "pedestrian_crossing",
        arm="south",
        at=at,
        speed=speed,
        when={"ego_distance_to_junction": {"below": 22}},
    )
    plan = PlanSource(origin="south", turn="straight", density=0.0, speed=(8.0, 8.0), events=(runs,))
    world.reset(plan.plan(0))
    for _ in range(80):
        advance = world.advance(np.array([0.0, 0.0]))
        if advance.collision:
            break
    assert advance.collision is not None
    assert advance.collision.fault == fault
    assert advance.collision.sudden == (fault == "other")
