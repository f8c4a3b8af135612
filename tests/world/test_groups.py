"""An event whose `when` has groups of conditions happens once its own conditions hold, and one group."""

from dataclasses import replace

import numpy as np
import pytest

from rudc.evaluation.preflight import never_happening
from rudc.scenario import load_scenario
from rudc.world.events.account import event_lines
from tests.plans import PlanSource, event

STAND = np.array([-6.0, 0.0])
STILL = PlanSource(density=10.0, speed=(0.0, 0.0))
LATER = {"simulation_time": {"above": 1.0}}


def surge(when):
    return event("density_surge", density=5, when=when)


@pytest.mark.parametrize(
    ("when", "begun_s"),
    [
        ({"any": [{"speed": {"above": 9}}, {"stand_still": {"above": 0.5}}]}, 0.6),
        ({**LATER, "any": [{"speed": {"above": 9}}, {"stand_still": {"above": 0.5}}]}, 1.1),
        ({"any": [{"speed": {"above": 9}}, {"stand_still": {"above": 0.5}, **LATER}]}, 1.1),
        ({"any": [{"speed": {"above": 9}}]}, None),
        ({"speed": {"above": 9}, "any": [{"stand_still": {"above": 0.5}}]}, None),
    ],
)
def test_when_it_happens(world, when, begun_s):
    world.reset(replace(STILL, events=(surge(when),)).plan(0))
    for _ in range(20):
        world.advance(STAND)
    (happening,) = world.happenings()
    assert happening.begun_s == (None if begun_s is None else pytest.approx(begun_s, abs=0.11))


def test_what_it_waits_for_is_said(world):
    groups = [{"speed": {"above": 9}, "stand_still": {"below": 1}}, {"traveled_distance": {"above": 50}}]
    by_arm = {"relative_distance": {"vehicle": {"from": "north"}, "below": 1}}
    world.reset(replace(STILL, events=(surge({**by_arm, "any": groups}),)).plan(0))
    (line,) = event_lines(world.plan, world.happenings())
    assert line.endswith(
        "it waits for relative_distance below 1 vehicle from north and (speed above 9 and stand_still "
        "below 1 or traveled_distance above 50)"
    )


def test_what_can_never_come_true_is_warned_of_only_if_no_group_can():
    never, ever = {"simulation_time": {"above": 500}}, {"speed": {"above": 1}}

    def said(*groups):
        file = {"events": [{"kind": "density_surge", "density": 5, "when": {"any": [*groups]}}]}
        return never_happening(load_scenario("random_destination", file))

    assert said(never, ever) == []
    (why,) = said(never, {"speed": {"above": 50}})
    assert "can never happen: it waits for simulation_time above 500 s" in why
    assert " and it waits for speed above 50 m/s" in why
    (why,) = said({"ego_distance_to_junction": {"below": -900}})
    assert "can never happen: it waits for ego_distance_to_junction below -900 m" in why
