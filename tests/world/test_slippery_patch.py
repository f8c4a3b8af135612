"""A slippery patch takes the ego's grip where it lies, and only there."""

from dataclasses import replace

import numpy as np
import pytest

from rudc.drawing.view import view_of
from rudc.world.who_yields import who_yields
from tests.plans import PlanSource, event

ALONE = PlanSource(
    density=0.0, origin="south", turn="straight", distance=(30.0, 30.0), speed=(8.0, 8.0), warm_up_s=0.1
)
PATCH = {"lane": "south_in_0", "at": 8, "length": 10, "friction": 0.2}
"""from 8 to 18 m before the stop line"""
ROLL, BRAKE = np.array([0.0, 0.0]), np.array([-6.0, 0.0])


def driven(world, events, action=ROLL, seconds=3.5):
    """After each decision: m from the ego's centre to its stop line, the friction that it has, m/s2."""
    source = replace(ALONE, events=events)
    scene, found = world.reset(source.plan(0)), []
    for _ in range(int(10 * seconds)):
        world.advance(action)
        world.perceived()
        scene = world.scene()
        found.append(
            (
                scene.route.stop_line_s - scene.ego_s,
                world.stage.plant.actuation.friction,
                scene.ego.acceleration,
            )
        )
    return found


def test_the_ego_has_less_grip_while_its_centre_is_on_it(world):
    found = driven(world, (event("slippery_patch", **PATCH),))
    assert min(to_stop for to_stop, *_ in found) < 7.0, "it comes past the patch"
    for to_stop, friction, _ in found:
        assert friction == (0.2 if 8.0 < to_stop < 18.0 else None), to_stop


def test_it_brakes_no_harder_than_the_patch_lets_it(world):
    near = event("slippery_patch", **{**PATCH, "at": 20, "length": 11})
    on_it = [a for _, friction, a in driven(world, (near,), BRAKE) if friction]
    assert on_it
    assert min(on_it[2:]) == pytest.approx(-0.2 * 9.81, abs=1e-6)


def test_the_lowest_friction_counts_and_is_gone_with_its_event(world):
    wet, ice = event("low_friction", friction=0.5), event("low_friction", friction=0.1)
    patch = event("slippery_patch", **PATCH)
    second = event("slippery_patch", **{**PATCH, "at": 12, "length": 2, "friction": 0.15})
    of = {
        name: {round(to_stop): friction for to_stop, friction, _ in driven(world, events)}
        for name, events in (("wet", (wet, patch, second)), ("ice", (ice, patch)))
    }
    assert [of["wet"][at] for at in (25, 16, 13, 10, 5)] == [0.5, 0.2, 0.15, 0.2, 0.5]
    assert {of["ice"][at] for at in (25, 16, 13, 10, 5)} == {0.1}
    short = event("slippery_patch", **PATCH, duration=2.0)
    assert [friction for *_, friction, _ in driven(world, (short,))][21:] == [None] * 14


def test_only_the_ego_feels_it_and_once_it_is_there(world):
    late = event("slippery_patch", **PATCH, when={"simulation_time": {"above": 1.0}})
    before = driven(world, (late,), seconds=0.9)
    (waiting,) = world.happenings()
    assert waiting.begun_s is None
    assert {friction for _, friction, _ in before} == {None}
    found = driven(world, (late,))
    (there,) = world.happenings()
    first = next(i for i, (_, friction, _) in enumerate(found) if friction)
    assert there.begun_s == pytest.approx(1.1, abs=0.11)
    assert there.visible_s == pytest.approx(0.1 * (first + 1), abs=0.11)
    assert there.bodies == frozenset()
    assert world.stage.traffic.grip == np.inf


@pytest.mark.parametrize("at", [19.7, 20.0, 20.3, 20.6])
def test_one_shorter_than_a_decisions_way_is_felt(world, at):
    patch = event("slippery_patch", **{**PATCH, "at": at, "length": 0.5})
    world.reset(replace(ALONE, speed=(9.0, 9.0), events=(patch,)).plan(0))
    for _ in range(20):
        world.advance(ROLL)
        world.perceived()
    (felt,) = world.happenings()
    assert felt.visible_s is not None


def test_one_laid_under_the_ego_is_met_at_once(world):
    under = {**PATCH, "at": 0, "length": 60}
    patch = event("slippery_patch", **under, when={"simulation_time": {"above": 1.0}})
    driven(world, (patch,))
    (there,) = world.happenings()
    assert there.visible_s == there.begun_s == pytest.approx(1.1, abs=0.11)


@pytest.mark.parametrize("patch_first", [True, False])
def test_what_appears_is_too_near_where_a_patch_lies_before_it(world, patch_first):
    """Whichever stands first in the file, and also where the ego is not on the patch yet."""
    when = {"ego_distance_to_junction": {"below": 25}}
    car = event("stalled_vehicle", lane="south_in_0", at=5, type="car", when=when)
    for length, sudden in ((22, {"stalled_vehicle0:0", "stalled_vehicle1:0"}), (2, set())):
        patch = event("slippery_patch", **{**PATCH, "at": 0, "length": length, "friction": 0.1}, when=when)
        driven(world, (patch, car) if patch_first else (car, patch), seconds=1.0)
        assert world.stage.sudden.keys() <= sudden
        assert bool(world.stage.sudden) == bool(sudden)


def test_the_others_do_not_slip(world):
    """Nor are they shown to."""
    source = replace(ALONE, density=30.0, warm_up_s=10.0)
    scenes = {}
    for name, events in (
        ("dry", ()),
        ("patch", (event("slippery_patch", **{**PATCH, "at": 0, "length": 60, "friction": 0.05}),)),
    ):
        world.reset(replace(source, speed=(0.0, 0.0), events=events).plan(1))
        for _ in range(40):
            world.advance(ROLL)
        scenes[name] = world.scene()
    np.testing.assert_array_equal(scenes["dry"].position, scenes["patch"].position)
    assert who_yields(scenes["dry"]) == who_yields(scenes["patch"])
    assert scenes["patch"].actuation.friction == 0.05
    assert scenes["patch"].road_friction is None


def test_it_lies_on_its_lane_in_pieces_that_follow_a_bend(world_on):
    world = world_on("roundabout")
    lane = next(name for name in world.network.named_stretches if name.startswith("ring"))
    patch = event("slippery_patch", lane=lane, at=2, length=12, friction=0.3)
    network = {"network": "roundabout", "origin": world.network.arms[0].name, "turn": None}
    world.reset(replace(ALONE, **network, events=(patch,)).plan(0))
    (shown,) = view_of(world).events
    assert len(shown.patch) > 3
    half = 0.5 * world.network.stretch(lane, world.route).lane.width
    on = {
        (at, aside): world.stage.patches.least(
            np.array([world.network.place_on_lane(lane, at, aside, route=world.route)[:2]])
        )
        for at in (1.0, *np.linspace(2.1, 13.9, 60).tolist(), 15.0)
        for aside in (-half - 0.6, -half + 0.1, 0.0, half - 0.1, half + 0.6)
    }
    for (at, aside), friction in on.items():
        assert friction == (0.3 if 2.0 < at < 14.0 and abs(aside) < half else np.inf), (at, aside)
    x, y, psi = world.network.place_on_lane(lane, 8.0, route=world.route)
    world.put_ego(x, y, psi)
    world.advance(BRAKE)
    world.advance(BRAKE)
    assert world.stage.plant.actuation.friction == 0.3
