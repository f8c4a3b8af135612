"""Words that may be drawn: what files may say, what is drawn, and what an editor marks."""

import json
import pickle
from collections import Counter

import pytest

from rudc.scenario.choices import possible
from tests.scenario.test_errors import check, problems
from tests.scenario.test_json_schema import SCHEMA, valid
from tests.scenario.test_plan import scenario

__all__ = ["problems"]

WALKER = {"kind": "pedestrian_crossing", "arm": "north", "speed": {"uniform": [1, 2]}}


def plans(count: int, **event: object):
    drawn = scenario(events=[{**WALKER, **event}])
    return [drawn.plan(seed).events[0] for seed in range(count)]


def test_words_are_drawn_with_their_weights_anew_for_each_episode():
    arms = {"choice": {"values": ["north", "east", "south"], "weights": [3, 0, 1]}}
    drawn = plans(400, arm=arms, from_side={"choice": ["left", "right"]})
    counts = Counter((event.arm, event.from_side) for event in drawn)
    assert set(counts) == {(arm, side) for arm in ("north", "south") for side in ("left", "right")}
    north = sum(count for (arm, _), count in counts.items() if arm == "north")
    left = sum(count for (_, side), count in counts.items() if side == "left")
    assert abs(north - 300) < 35  # four standard deviations of a fair draw
    assert abs(left - 200) < 40


def test_a_word_that_is_fixed_draws_nothing():
    """Its numbers are those of an event that has no word which could be drawn."""
    surge = scenario(events=[{"kind": "density_surge", "density": WALKER["speed"]}])
    speeds = [float(event.speed) for event in plans(5, from_side="right")]
    assert speeds == [float(surge.plan(seed).events[0].density) for seed in range(5)]
    drawn = plans(5, arm={"choice": ["north", "east"]})
    assert speeds != [float(event.speed) for event in drawn]


def test_what_is_written_out_is_read_back_the_same():
    vehicles = {"choice": {"values": ["truck", "bus"], "weights": [1, 2]}}
    first = scenario(events=[{"kind": "stalled_vehicle", "lane": {"choice": ["north_in_0", 7]}, "at": 9,
                              "type": vehicles}])  # fmt: skip
    assert scenario(**json.loads(json.dumps(first.data()))) == first
    assert pickle.loads(pickle.dumps(first)) == first
    assert possible(first.events[0].type) == ("truck", "bus")
    assert possible(first.events[0].lane) == ("north_in_0", "7")
    assert possible("north_in_0") == ("north_in_0",)


def test_every_problem_with_a_choice_of_words(problems):
    found = problems("""
        name: wrong
        events:
          - {kind: pedestrian_crossing, arm: north, from_side: {choice: [left, rihgt]}}
          - {kind: pedestrian_crossing, arm: north, from_side: lefft}
          - {kind: pedestrian_crossing, arm: north, from_side: {uniform: [1, 2]}}
          - {kind: pedestrian_crossing, arm: {choice: []}}
          - {kind: wrong_way, lane: north_in_0, at: 3, type: {choice: {values: [bus, car], weights: [1]}}}
          - {kind: wrong_way, lane: north_in_0, at: 3, type: {choice: {values: [bus], wieghts: [1]}}}
          - {kind: hard_brake, vehicle: {choice: [leader, follower]}}
          - {kind: pedestrian_crossing, arm: 3.5}
          - {kind: hard_brake, when: {reach_position: {lane: {choice: [a, b]}, at: 5}}}
        """)
    check(
        found,
        "3:72: events.0.from_side.choice.1: expected one of left, right; got the text 'rihgt' (did you ...",
        "4:56: events.1.from_side: expected one of left, right or {choice: [...]}; got ...'left'?)",
        "5:56: events.2.from_side: expected one of left, right or {choice: [...]}; got a mapping",
        "6:47: events.3.arm.choice: there is nothing to choose from",
        "7:93: events.4.type.choice.weights: 1 weights for 2 values",
        "8:79: events.5.type.choice.wieghts: unknown key (did you mean 'weights'?)",
        "9:33: events.6.vehicle: expected one of leader, ...; got a mapping; a distribution cannot ...",
        "10:38: events.7.arm: expected text or {choice: [...]}, got the number 3.5",
        "11:54: events.8.when.reach_position.lane: expected text, got a mapping; a ... `sweep`",
    )


@pytest.mark.parametrize(
    ("side", "fits"),
    [
        ("left", True),
        ({"choice": ["left", "right"]}, True),
        ({"choice": {"values": ["left"], "weights": [1]}}, True),
        ({"choice": ["up"]}, False),
        ({"uniform": [0, 1]}, False),
    ],
)
def test_an_editor_marks_what_the_loader_refuses(side, fits):
    assert valid({"name": "s", "events": [{**WALKER, "from_side": side}]}, SCHEMA) is fits
