"""Events that are called by their names."""

import pytest

from tests.scenario.test_errors import check, problems
from tests.scenario.test_json_schema import SCHEMA, valid
from tests.scenario.test_plan import scenario

__all__ = ["problems"]

LORRY = {"kind": "accident", "vehicles": [{"lane": "east_out_1", "at": 12}], "duration": 5}


def waiting(event: object, **more: object) -> dict[str, object]:
    return {
        "kind": "low_friction",
        "friction": 0.5,
        "when": {"event_state": {"event": event, "state": "over"}},
        **more,
    }


def test_a_name_stands_for_the_number_whatever_is_put_before():
    named = scenario(events=[{**LORRY, "name": "lorry"}, waiting("lorry")])
    numbered = scenario(events=[LORRY, waiting(0)])
    assert named.events[1] == numbered.events[1]
    assert [event.name for event in named.events] == ["lorry", None]
    assert "name" not in numbered.data()["events"][0]
    later = scenario(events=[{"kind": "hard_brake"}, {**LORRY, "name": "lorry"}, waiting("lorry")])
    assert float(later.events[2].when.event_state.event) == 1.0
    assert scenario(**named.data()) == named
    assert named.plan(3).events[1] == numbered.plan(3).events[1]


def test_a_name_may_be_swept():
    names = {"events.2.when.event_state.event": ["a", "b"]}
    both = scenario(events=[{**LORRY, "name": "a"}, {**LORRY, "name": "b"}, waiting("a")], sweep=names)
    assert [float(one.events[2].when.event_state.event) for _, one in both.grid()] == [0.0, 1.0]


def test_every_problem_with_names_and_what_else_is_wrong(problems):
    found = problems("""
        name: wrong
        events:
          - {kind: hard_brake, name: lorry, when: {event_state: {event: van}}}
          - {kind: hard_brake, name: lorry}
          - {kind: hard_brake, name: 2nd, deceleration: hard}
          - {kind: hard_brake, when: {event_state: {event: lory}}}
          - {kind: hard_brake, when: {event_state: {event: later}}}
          - {kind: hard_brake, name: later}
        """)
    check(
        found,
        "3:65: events.0.when.event_state.event: no event before this one is called 'van'; none has a name",
        "4:30: events.1.name: events.0 is called 'lorry', too",
        "5:30: events.2.name: expected a name of letters, ... that begins with a letter; got '2nd'",
        "5:49: events.2.deceleration: expected a number in m/s2...",
        "6:52: events.3.when.event_state.event: no event before ... 'lory' (did you mean 'lorry'?)...",
        "7:52: events.4.when.event_state.event: no event before ... 'later': events.5 is, and it must ...",
    )


def test_every_mistake_about_the_same_vehicle_is_told_at_once_beside_all_others(problems):
    found = problems("""
        name: wrong
        events:
          - {kind: low_friction, friction: 0.5, name: ice}
          - {kind: hard_brake, vehicle: same, when: {event_state: {event: ice}}}
          - {kind: hard_brake, vehicle: same}
          - {kind: hard_brake, when: {event_state: {event: 3}}}
          - {kind: hard_brake, vehicle: same, when: {event_state: {event: 7}}}
          - {kind: hard_brake, deceleration: hard}
          - {kind: hard_brake, vehicle: same, when: {event_state: {event: 5}}}
          - {kind: hard_brake, when: {any: [{speed: {vehicle: same, above: 1}}]}}
        ego: {distance: far}
        """)
    check(
        found,
        "4:...: events.1.vehicle: events.0, for which this one waits, takes hold of no vehicle",
        "5:...: events.2.vehicle: `same` is the vehicle of the event that this one waits for; ...",
        "6:...: events.3.when.event_state.event: expected the number of ... (0 to 2); got 3",
        "7:...: events.4.when.event_state.event: expected the number of ... (0 to 3); got 7",
        "8:...: events.5.deceleration: expected a number in m/s2...",
        "10:...: events.7.when.any.0.speed.vehicle: `same` is the vehicle of the event that this one ...",
        "11:...: ego.distance: expected a number in m...",
    )


@pytest.mark.parametrize(
    ("events", "said"),
    [
        (
            "{kind: hard_brake, when: {event_state: {event: van}}}",
            "2:...: events.0.when.event_state.event: no event before ... 'van'; none has a name",
        ),
        (
            "{kind: low_friction, friction: 0.5, name: ice}, "
            "{kind: hard_brake, vehicle: same, when: {event_state: {event: van}}}",
            "2:...: events.1.when.event_state.event: no event before ... 'van'; there are: ice",
        ),
        (
            "{kind: hard_brake}, {kind: hard_brake, when: {event_state: {event: '0'}}}",
            "2:...: events.1.when.event_state.event: ...'0'; a number stands without quotes",
        ),
        ("{kind: hard_brake, name: ''}", "2:...: events.0.name: must not be empty"),
    ],
)
def test_a_wrong_name_is_the_only_thing_that_is_told(problems, events, said):
    check(problems(f"name: wrong\nevents: [{events}]\n"), said)


def test_names_are_compared_without_the_space_around_them(problems):
    named = scenario(events=[{**LORRY, "name": " lorry "}, waiting("lorry ")])
    assert named.events[0].name == "lorry"
    found = problems("name: wrong\nevents: [{kind: hard_brake, name: ' a'}, {kind: hard_brake, name: a}]\n")
    check(found, "2:...: events.1.name: events.0 is called 'a', too")


def test_a_name_is_no_part_of_what_an_episode_depends_on():
    assert scenario(events=[{**LORRY, "name": "lorry"}]).digest == scenario(events=[LORRY]).digest


@pytest.mark.parametrize(
    ("event", "fits"), [("lorry", True), (0, True), ({"choice": [0, 1]}, True), (True, False)]
)
def test_an_editor_takes_names(event, fits):
    assert valid({"name": "s", "events": [{**LORRY, "name": "lorry"}, waiting(event)]}, SCHEMA) is fits
