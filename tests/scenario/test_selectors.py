"""Whom an event means, as files say it: by a word, or by an arm."""

from rudc.scenario.choices import possible
from tests.scenario.test_errors import check, problems
from tests.scenario.test_json_schema import SCHEMA, valid
from tests.scenario.test_plan import scenario

__all__ = ["problems"]

BY_ARM = {
    "kind": "hard_brake",
    "vehicle": {"from": {"choice": ["north", "east"]}, "turn": "left"},
    "when": {"relative_distance": {"vehicle": {"from": "north"}, "below": 20}},
}


def test_an_arm_may_be_named_or_drawn_and_is_in_the_file_again():
    read = scenario(events=[BY_ARM])
    said = read.data()["events"][0]
    assert said["when"]["relative_distance"]["vehicle"] == {"from": "north"}
    assert scenario(**read.data()) == read
    assert possible(read.events[0].vehicle.origin) == ("north", "east")
    drawn = {read.plan(seed).events[0].vehicle.origin for seed in range(20)}
    assert drawn == {"north", "east"}
    turns = {"from": "east", "turn": {"choice": {"values": ["left", "right"], "weights": [1, 0]}}}
    either = scenario(events=[{"kind": "hard_brake", "vehicle": turns}])
    assert {either.plan(seed).events[0].vehicle.turn for seed in range(8)} == {"left"}
    assert str(either.plan(0).events[0].vehicle) == "from east turn left"
    bus = scenario(events=[{"kind": "hard_brake", "vehicle": {"from": "east", "type": "bus"}}])
    assert str(bus.events[0].vehicle) == "from east type bus"


def test_a_swept_arm():
    swept = scenario(events=[BY_ARM], sweep={"events.0.vehicle.turn": ["left", "right"]})
    assert [one.events[0].vehicle.turn for _, one in swept.grid()] == ["left", "right"]


def test_what_is_wrong_is_said_at_its_place(problems):
    found = problems("""
        name: wrong
        events:
          - {kind: hard_brake, vehicle: {frm: north, turn: letf}}
          - {kind: hard_brake, vehicle: {turn: left}}
          - {kind: hard_brake, vehicle: [leader]}
          - {kind: hard_brake, vehicle: ledaer}
          - {kind: hard_brake, when: {time_headway: {vehicle: {from: 1.5}, below: 2}}}
        """)
    check(
        found,
        "3:34: events.0.vehicle.frm: unknown key (did you mean 'from'?)",
        "3:52: events.0.vehicle.turn: expected one of left, straight, right or {choice: ...}; got ...",
        "4:33: events.1.vehicle.from: is missing, and it is required",
        "5:33: events.2.vehicle: expected one of leader, ..., same or {from: ARM, ...}; got a list...",
        "6:33: events.3.vehicle: expected one of leader, ... 'ledaer' (did you mean 'leader'?)",
        "7:62: events.4.when.time_headway.vehicle.from: expected text or {choice: [...]}, got ...1.5",
    )


def test_editors_know_both_forms():
    assert valid({"name": "a", "events": [BY_ARM, {"kind": "hard_brake", "vehicle": "leader"}]}, SCHEMA)
    assert not valid({"name": "a", "events": [{"kind": "hard_brake", "vehicle": {"turn": "left"}}]}, SCHEMA)
