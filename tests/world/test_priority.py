"""Vehicles that disregard the right of way for a while."""

from dataclasses import replace

import pytest

from tests.plans import event
from tests.world.test_events import CALM, STAND


@pytest.mark.parametrize("seed", [0, 1])
def test_who_is_in_the_junction_at_the_end_goes_on_until_it_is_out(world, seed):
    """It stopped in the middle to give way, and everybody waited for it."""
    heedless = event("priority_violation", vehicle="all", duration=2.0)
    world.reset(replace(CALM, density=35.0, origin="east", events=(heedless,)).plan(seed))
    world.advance(STAND)
    (begun,) = world.happenings()
    stage, held, left = world.stage, set(begun.bodies), 0
    while stage.unlawful:
        scene = world.scene()
        inside = held & {scene.ids[i] for i in scene.inside.nonzero()[0]}
        held &= set(scene.ids)
        world.advance(STAND)
        if scene.time_s > 1.95:
            left += len(held - inside)
            held &= inside
        assert stage.unlawful & set(scene.ids) == held
    assert left, "somebody was not in the junction"
    assert scene.time_s > 2.2, "somebody was, and went on"
    assert not any(driver.overridden or driver.heedless for driver in world.traffic.drivers.values())
    assert stage.reached[0, "over"] == pytest.approx(scene.time_s, abs=0.11)


@pytest.mark.parametrize("seed", [1, 2])
def test_it_begins_and_lasts_however_late_it_is(world, seed):
    """One that began later than its duration was over at once."""
    after = {"simulation_time": {"above": 4.0}}
    heedless = event("priority_violation", vehicle="all", duration=3.0, when=after)
    source = replace(CALM, density=30.0, origin="south", turn="straight", events=(heedless,))
    world.reset(source.plan(seed))
    while not world.stage.reached:
        world.advance(STAND)
    began = world.stage.reached[0, "begun"]
    assert began == pytest.approx(4.1, abs=0.11)
    (found,) = world.happenings()
    assert len(found.bodies) > 5
    while world.scene().time_s < began + 2.9:
        assert found.bodies & set(world.scene().ids) <= world.stage.unlawful
        world.advance(STAND)
