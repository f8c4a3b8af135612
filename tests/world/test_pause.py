"""Those who cross an arm may stop on their way, and go on."""

from dataclasses import replace

import numpy as np
import pytest

from rudc.errors import ScenarioError
from rudc.evaluation.preflight import never_happening
from rudc.scenario import Scenario, load_scenario
from rudc.scenario.events.stage import Halt
from rudc.world.props import LONG_S, Prop
from rudc.world.scene import Kind
from tests.plans import event
from tests.world.test_events import CALM

STRAIGHT = np.array([[0.0, 0.0], [20.0, 0.0]])
BACK = {"after": 4, "duration": 1.5, "then": "back"}
EMPTY = replace(CALM, density=0.0, origin="south", turn="straight", speed=(0.0, 0.0))


def test_it_stops_where_it_should_and_goes_on_after_its_time():
    walker = Prop("walker", Kind.PEDESTRIAN, (0.5, 0.5), STRAIGHT, wanted=1.5)
    walker.halt = Halt(3.0, 2.0)
    places = []
    for _ in range(80):
        walker.step(0.1)
        places.append(walker.travelled)
    moved = np.diff(places)
    stands = np.flatnonzero(moved == 0.0)
    assert 3.0 <= places[stands[0]] < 3.4, "as far as it needs to stop"
    assert len(stands) * 0.1 == pytest.approx(2.0, abs=0.11)
    assert moved[: stands[0] - 3] == pytest.approx(0.15)
    assert moved[-20:] == pytest.approx(0.15)


def test_who_turns_back_walks_to_where_they_appeared_and_is_gone():
    bend = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 20.0]])
    walker = Prop("walker", Kind.PEDESTRIAN, (0.5, 0.5), bend, wanted=1.5)
    walker.travelled = walker.appeared_m = -1.0
    walker.halt = Halt(5.0, 1.0, turns_back=True)
    places, headings = [], []
    while not walker.finished:
        walker.step(0.1)
        x, y, heading = walker.pose()
        places.append((x, y))
        headings.append(round(heading, 2))
    assert max(y for _, y in places) == pytest.approx(2.1, abs=0.2), "1 m before its way and 4 m along it"
    assert places[-1] == pytest.approx((-1.0, 0.0), abs=0.16)
    assert list(dict.fromkeys(headings)) == [0.0, 1.57, -1.57, 3.14]
    gone = Prop("walker", Kind.PEDESTRIAN, (0.5, 0.5), bend, wanted=0.1)
    gone.halt = Halt(0.0, 0.2, turns_back=True)
    for _ in range(4):
        gone.step(0.1)
    assert gone.finished, "it has not set out at all"


def test_people_turn_back_all_at_once_and_riders_do_not(world):
    back = event("pedestrian_crossing", arm="north", at=6, count=2, speed=1.5, pause=BACK)
    world.reset(replace(EMPTY, events=(back,)).plan(0))
    ways = {0: [], 1: []}
    for _ in range(100):
        world.advance(np.zeros(2))
        scene = world.scene()
        for k, way in ways.items():
            if (name := f"pedestrian_crossing0:{k}") in scene.ids:
                way.append(scene.position[scene.ids.index(name)])
    for way in ways.values():
        away = np.hypot(*(np.array(way) - way[0]).T)
        assert away.max() == pytest.approx(4.0, abs=0.4)
        assert away[-1] < 0.3
    with pytest.raises(ScenarioError, match=r"pause\.then"):
        load_scenario(
            "random_destination", {"events": [{"kind": "vehicle_crossing", "arm": "north", "pause": BACK}]}
        )


def test_standing_on_purpose_is_not_being_held_up():
    """Who is held up for so long goes back."""
    rider = Prop("rider", Kind.BICYCLE, (1.8, 0.6), STRAIGHT, wanted=4.0)
    rider.halt = Halt(5.0, 2.0 * LONG_S)
    for _ in range(round(10.0 * (2.0 * LONG_S + 8.0))):
        rider.step(0.1)
        assert rider.speed >= 0.0
    assert rider.finished


@pytest.mark.parametrize(
    ("kind", "more"),
    [("pedestrian_crossing", {"speed": 1.5}), ("vehicle_crossing", {"type": "bicycle", "speed": 3})],
)
def test_all_stop_at_once_when_the_first_is_there(world, kind, more):
    crossing = event(kind, arm="north", at=6, count=2, pause={"after": 4, "duration": 1.5}, **more)
    world.reset(replace(EMPTY, events=(crossing,)).plan(0))
    ways = {0: [], 1: []}
    for _ in range(60):
        world.advance(np.zeros(2))
        scene = world.scene()
        for k, way in ways.items():
            name = f"{kind}0:{k}"
            way.append(scene.position[scene.ids.index(name)] if name in scene.ids else (np.nan, np.nan))
    first, second = (np.hypot(*np.diff(way, axis=0).T) for way in ways.values())
    stands = np.flatnonzero(first == 0.0)
    assert (np.diff(stands) == 1).all()
    assert 1.0 <= 0.1 * len(stands) <= 1.6
    assert (second[stands] == 0.0).all()
    start = np.array(ways[0][0])
    assert np.hypot(*(np.array(ways[0][stands[0]]) - start)) == pytest.approx(4.0, abs=0.8)
    assert first[-1] == pytest.approx(0.1 * more["speed"]) or np.isnan(first[-1])


def file(**pause):
    crossing = {"kind": "pedestrian_crossing", "arm": "ego_in", "at": 5, "pause": pause}
    return Scenario.model_validate({"name": "s", "ego": {"route": {"from": "south"}}, "events": [crossing]})


def test_a_pause_that_begins_beyond_the_way_is_warned_of():
    (said,) = never_happening(file(after=25, duration=2))
    assert "its pause begins after 25 m (pause.after), and those who cross have arrived after" in said
    assert not never_happening(file(after={"uniform": [3, 25]}, duration=2))


def test_a_vehicle_also_moves_before_and_beyond_its_way():
    """A bus that pauses after 20 m stands with its rear over the road, and leaves it."""
    bus = {"kind": "vehicle_crossing", "arm": "north", "at": 6, "type": {"choice": ["bicycle", "bus"]}}
    for after, warned in ((20, False), (30, True)):
        crossing = {**bus, "pause": {"after": after, "duration": 2}}
        scenario = Scenario.model_validate({"name": "s", "events": [crossing]})
        assert bool(never_happening(scenario)) == warned


def test_both_numbers_are_drawn():
    drawn = {
        (float(plan.events[0].pause.after), float(plan.events[0].pause.duration))
        for plan in map(file(after={"uniform": [3, 6]}, duration={"choice": [1, 2]}).plan, range(8))
    }
    assert len({after for after, _ in drawn}) == 8
    assert {duration for _, duration in drawn} == {1.0, 2.0}
    assert all(3.0 <= after <= 6.0 for after, _ in drawn)


def test_a_file_without_a_pause_says_what_it_said_before():
    plain = {"kind": "vehicle_crossing", "arm": "north"}
    (told,) = Scenario.model_validate({"name": "s", "events": [plain]}).data()["events"]
    assert "pause" not in told
