"""A slippery patch takes the ego's grip where it lies, and only there."""

from dataclasses import replace

import numpy as np
import pytest

from rudc.drawing.view import view_of
from tests.plans import PlanSource, event

ALONE = PlanSource(
    density=0.0, origin="south", turn="straight", distance=(30.0, 30.0), speed=(8.0, 8.0), warm_up_s=0.1
)
PATCH = {"lane": "south_in_0", "at": 8, "length": 10, "friction": 0.2}
"""from 8 to 18 m before the stop line"""
ROLL, BRAKE = np.array([0.0, 0.0]), np.array([-6.0, 0.0])


def driven(world, events, action=ROLL, seconds=3.5):
    """Of each decision: m from the ego's centre to its stop line, the friction that it had, m/s2."""
    source = replace(ALONE, events=events)
    scene, found = world.reset(source.plan(0)), []
    for _ in range(int(10 * seconds)):
        to_stop = scene.route.stop_line_s - scene.ego_s
        world.advance(action)
        world.perceived()
        scene = world.scene()
        found.append((to_stop, world.stage.plant.actuation.friction, scene.ego.acceleration))
    return found


def test_the_ego_has_less_grip_while_its_centre_is_on_it(world):
    found = driven(world, (event("slippery_patch", **PATCH),))
    assert min(to_stop for to_stop, *_ in found) < 7.0, "it comes past the patch"
    for to_stop, friction, _ in found:
        if min(abs(to_stop - 8.0), abs(to_stop - 18.0)) > 0.1:
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


def test_it_lies_on_its_lane_in_pieces_that_follow_a_bend(world_on):
    world = world_on("roundabout")
    lane = next(name for name in world.network.named_stretches if name.startswith("ring"))
    patch = event("slippery_patch", lane=lane, at=2, length=12, friction=0.3)
    network = {"network": "roundabout", "origin": world.network.arms[0].name, "turn": None}
    world.reset(replace(ALONE, **network, events=(patch,)).plan(0))
    (shown,) = view_of(world).events
    assert len(shown.patch) > 3
    middles = [corners.mean(axis=0) for corners in shown.patch]
    for at, middle in zip(np.linspace(2, 14, 2 * len(middles) + 1)[1::2], middles, strict=True):
        place = world.network.place_on_lane(lane, float(at), route=world.route)[:2]
        assert np.hypot(*(middle - place)) < 0.05
    x, y, psi = world.network.place_on_lane(lane, 8.0, route=world.route)
    world.put_ego(x, y, psi)
    world.advance(BRAKE)
    world.advance(BRAKE)
    assert world.stage.plant.actuation.friction == 0.3
