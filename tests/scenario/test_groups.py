"""`when: {any: [...]}`: groups of conditions, of which one must hold."""

import pytest

from tests.scenario.test_errors import check, problems
from tests.scenario.test_json_schema import SCHEMA, valid
from tests.scenario.test_plan import scenario

__all__ = ["problems"]

WET = {"kind": "low_friction", "name": "wet", "friction": 0.5, "when": {"simulation_time": {"above": 2}}}
WHEN = {
    "ego_distance_to_junction": {"below": 30},
    "any": [{"stand_still": {"above": 1}}, {"event_state": {"event": "wet", "above": {"uniform": [1, 2]}}}],
}


def test_names_in_groups_become_numbers_and_their_numbers_are_drawn():
    read = scenario(events=[WET, {"kind": "hard_brake", "when": WHEN}])
    first, second = read.events[1].when.any
    assert float(second.event_state.event) == 0.0
    assert list(first.conditions) == ["stand_still"]
    assert read.events[1].when.conditions.keys() == {"ego_distance_to_junction"}
    drawn = [float(read.plan(seed).events[1].when.any[1].event_state.above) for seed in range(4)]
    assert len(set(drawn)) == 4
    assert all(1.0 <= value <= 2.0 for value in drawn)
    assert scenario(**read.data()) == read
    assert valid({"name": "a", "events": [WET, {"kind": "hard_brake", "when": WHEN}]}, SCHEMA)
    assert not valid({"name": "a", "events": [{"kind": "hard_brake", "when": {"any": {}}}]}, SCHEMA)


def test_without_groups_a_file_says_what_it_said_before():
    assert "any" not in scenario(events=[WET]).data()["events"][0]["when"]


def test_groups_alone_are_kept_where_the_probability_is_drawn():
    only = {"any": [{"speed": {"above": 3}}], "probability": 1.0}
    (event,) = scenario(events=[{"kind": "hard_brake", "when": only}]).plan(0).events
    assert event.when is not None
    assert event.when.any is not None


@pytest.mark.parametrize("values", [["wet", 0], [0, "wet"]])
def test_what_a_group_waits_for_may_be_swept(values):
    swept = {"events.1.when.any.1.event_state.event": values}
    both = scenario(events=[WET, {"kind": "hard_brake", "when": WHEN}], sweep=swept)
    assert [float(one.events[1].when.any[1].event_state.event) for _, one in both.grid()] == [0.0, 0.0]


def test_what_is_wrong_in_a_group_is_said_at_its_place(problems):
    found = problems("""
        name: wrong
        events:
          - {kind: hard_brake, when: {any: [{stand_stil: {above: 1}}, {}, 3]}}
          - {kind: hard_brake, when: {any: []}}
          - {kind: hard_brake, when: {any: {speed: {above: 1}}}}
          - {kind: hard_brake, when: {any: [{event_state: {event: wet}}]}}
          - {kind: hard_brake, when: {any: [{speed: {above: 1}, probability: 1}]}, name: wet}
        """)
    check(
        found,
        "3:38: events.0.when.any.0.stand_stil: unknown key (did you mean 'stand_still'?)",
        "3:63: events.0.when.any.1: no condition given; ...",
        "3:67: events.0.when.any.2: expected a mapping (keys: simulation_time, ...), got the number 3",
        "4:36: events.1.when.any: expected one group of conditions at least",
        "5:36: events.2.when.any: expected a list, got a mapping",
        "6:59: events.3.when.any.0.event_state.event: no event before ... 'wet': events.4 is, and it ...",
        "7:57: events.4.when.any.0.probability: unknown key; ...",
    )


@pytest.mark.parametrize(
    ("group", "expected"),
    [
        (
            "event_state: {event: 1}",
            "2:...: events.0.when.any.0.event_state.event: expected the number of ...",
        ),
        (
            "relative_distance: {vehicle: same, below: 9}",
            "2:...: events.0.when.any.0.relative_distance.vehicle: `same` is the vehicle of the event ...",
        ),
    ],
)
def test_order_and_vehicles_are_checked_in_groups_too(problems, group, expected):
    found = problems(f"""
        name: wrong
        events: [{{kind: hard_brake, when: {{any: [{{{group}}}]}}}}, {{kind: hard_brake}}]
        """)
    check(found, expected)
