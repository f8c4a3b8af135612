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
