"""The states of an episode's events: which wait, when each began, who is involved, when the ego saw it."""

from dataclasses import replace

import numpy as np
import pytest

from rudc.errors import SimulationError
from rudc.scenario import load_scenario
from rudc.world.events import event_lines
from rudc.world.props import Prop
from tests.plans import PlanSource, event

CALM = PlanSource(density=25.0, speed=(0.0, 0.0))
"""the ego stands on its arm and watches"""
STAND = np.array([-6.0, 0.0])
LATER = {"simulation_time": {"above": 1.0}}


def test_happenings_say_what_waits_what_began_and_who_is_involved(world):
    accident = event("accident", vehicles=[{"position": [2.0, 4.0]}, {"position": [-2.0, -4.0]}])
    slow = event("slow_vehicle", vehicle="nearest", speed=1.0, duration=0.5, when=LATER)
    never = event("hard_brake", vehicle="nearest", when={"simulation_time": {"above": 500.0}})
    world.reset(replace(CALM, events=(accident, slow, never)).plan(0))
    first = world.happenings()
    assert [h.name for h in first] == ["accident0", "slow_vehicle1", "hard_brake2"]
    assert [h.begun_s for h in first] == [0.0, None, None]
    assert first[0].bodies == {"accident0:0", "accident0:1"} <= set(world.scene().ids)
    assert not first[1].bodies
    for _ in range(20):
        world.advance(STAND)
    _, after, still = world.happenings()
    assert after.begun_s == pytest.approx(1.1, abs=0.11)
    assert after.is_over
    assert len(after.bodies) == 1, "remembered although nobody is held any more"
    assert after.bodies < set(world.scene().ids)
    assert (still.begun_s, still.is_over, still.bodies) == (None, False, frozenset())


def test_when_an_event_was_seen_first(world, four_way):
    """Behind a wall, or out of range, it happens unseen; without a body it is felt at once."""
    x, y, _ = four_way.place_on_lane("south_in_0", 20.0)
    wall = event("occlusion", boxes=[{"position": [x + 8.0, y + 10.0], "heading": 90, "size": [30, 4]}])
    accident = event("accident", vehicles=[{"lane": "east_in_0", "at": 40}])
    source = replace(
        CALM, density=0.0, origin="south", turn="straight", distance=(25.0, 25.0), speed=(8.0, 8.0)
    )
    seen = {}
    for name, events in (("open", (accident,)), ("hidden", (accident, wall))):
        world.reset(replace(source, events=events).plan(0))
        world.perceived()
        for _ in range(45):
            world.advance(np.zeros(2))
            world.perceived()
        seen[name] = [happening.visible_s for happening in world.happenings()]
    assert seen["open"] == [0.0]
    assert seen["hidden"][0] > 0.5
    assert seen["hidden"][1] == 0.0
    assert event_lines(world.plan, world.happenings()) == [
        f"1 (events.0) accident: from the start, seen by the ego at {seen['hidden'][0]:.1f} s",
        "2 (events.1) occlusion: from the start",
    ]


def test_who_was_seen_is_said_to_have_been_also_when_it_has_left(world):
    runner = event("pedestrian_crossing", arm="north", speed=8.0)
    source = replace(CALM, density=0.0, origin="south", turn="straight", distance=(20.0, 20.0))
    world.reset(replace(source, events=(runner,)).plan(0))
    world.perceived()
    for _ in range(40):
        world.advance(STAND)
        world.perceived()
    (gone,) = world.happenings()
    assert not gone.bodies
    assert event_lines(world.plan, (gone,)) == [
        f"1 (events.0) pedestrian_crossing: from the start, over, seen by the ego at {gone.visible_s:.1f} s"
    ]


def test_a_fault_is_over_once_a_later_one_replaces_it(world):
    ice = event("low_friction", friction=0.2)
    noise = event("sensor_noise", position=0.5)
    melted = event("low_friction", friction=0.9, when=LATER)
    world.reset(replace(CALM, events=(ice, noise, melted)).plan(0))
    seen = []
    for _ in range(15):
        world.advance(STAND)
        seen.append([happening.is_over for happening in world.happenings()])
    assert seen[0] == [False, False, False]
    assert seen[-1] == [True, False, False]


@pytest.mark.parametrize(
    "when", [{}, {"when": {"simulation_time": {"below": 9.0}}}], ids=["at once", "later"]
)
@pytest.mark.parametrize("room", [True, False])
def test_riders_set_off_only_where_traffic_can_still_stop(world, monkeypatch, room, when):
    riders = event("vehicle_crossing", arm="north", count=2, **when)
    monkeypatch.setattr(Prop, "has_room", lambda prop, scene: room)
    world.reset(replace(CALM, events=(riders,)).plan(0))
    world.advance(STAND)
    (crossing,) = world.happenings()
    assert len(crossing.bodies) == 2 * room
    assert (crossing.begun_s is not None) is room
    (line,) = event_lines(world.plan, (crossing,))
    assert line.endswith("not there, it waits for room on the road") is not room


@pytest.mark.parametrize("when", [{}, {"when": LATER}], ids=["at once", "later"])
@pytest.mark.parametrize("lasts_s", [2.0, 25.0])
def test_what_stands_waits_until_what_stands_in_its_place_for_a_while_is_gone(world, when, lasts_s):
    """The episode ended in an error. It waits for longer than for who drives."""
    place = {"lane": "north_in_0", "at": 20}
    first = event("accident", vehicles=[place], duration=lasts_s)
    second = event("lane_closure", lane="north_in_0", at=18, length=6, duration=3.0, **when)
    source = replace(CALM, density=0.0, origin="south", turn="right", events=(first, second))
    world.reset(source.plan(0))
    while not world.happenings()[0].is_over:
        assert world.happenings()[1].begun_s is None
        world.advance(STAND)
    for _ in range(2):
        world.advance(STAND)
    assert world.happenings()[1].begun_s == pytest.approx(lasts_s, abs=0.25)


def test_what_stands_in_a_place_for_good_is_an_error_to_who_places_something_there(world):
    place = {"lane": "north_in_0", "at": 20}
    first = event("accident", vehicles=[place])
    second = event("stalled_vehicle", **place, duration=3.0, when=LATER)
    world.reset(replace(CALM, density=0.0, origin="south", turn="right", events=(first, second)).plan(0))
    with pytest.raises(SimulationError, match="would overlap or touch"):
        [world.advance(STAND) for _ in range(15)]


def test_event_lines_say_why_something_is_not_there(world):
    scenario = load_scenario("perfect_storm", {"traffic.density": 0, "events.3.when.probability": 0})
    world.reset(scenario.plan(0))
    assert event_lines(world.plan, world.happenings())[3:] == [
        "4 (events.3) hard_brake: not in this episode, its probability decided so",
        "5 (events.4) priority_violation: not there, it waits for reach_position position [-16.0, -1.75] "
        "tolerance 5 and a vehicle to act on (crossing)",
    ]


def test_a_decision_says_which_events_it_began(world):
    surge = event("density_surge", density=50, when=LATER)
    world.reset(replace(CALM, density=5.0, events=(surge,)).plan(0))
    begun = [world.advance(STAND).events for _ in range(20)]
    assert [names for names in begun if names] == [("density_surge0",)]
    assert begun.index(("density_surge0",)) == pytest.approx(11, abs=1)


def test_an_event_is_named_by_its_number_in_the_file_whatever_else_happens(world):
    never = {"kind": "hard_brake", "when": {"probability": 0}}
    given = {"events": [never, {"kind": "density_surge", "density": 9}], "traffic.density": 0}
    world.reset(load_scenario("random_destination", given).plan(0))
    assert [happening.name for happening in world.happenings()] == ["density_surge1"]
    assert event_lines(world.plan, world.happenings())[1].startswith("2 (events.1) density_surge: ")
