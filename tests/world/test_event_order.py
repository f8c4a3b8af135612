"""Events that wait for others: `event_state`."""

from dataclasses import replace

import pytest

from rudc.errors import ScenarioError
from rudc.scenario import load_scenario
from rudc.world.events import event_lines
from tests.plans import event
from tests.world.test_events import CALM, STAND

FILE = """
name: one_after_the_other
events:
  - {{kind: low_friction, friction: 0.5, when: {first}}}
  - {{kind: low_friction, friction: 0.3, when: {second}}}
"""


def begun(world, source, seconds):
    """s, when each event began, by its name; None for those that did not."""
    world.reset(source.plan(0))
    for _ in range(round(10 * seconds)):
        world.advance(STAND)
    return {happening.name: happening.begun_s for happening in world.happenings()}


def test_an_event_waits_until_another_has_begun_or_is_over(world):
    after = {"event": 0, "state": "over", "above": 0.55}
    events = (
        event("density_surge", density=30.0, duration=1.0, when={"simulation_time": {"above": 0.95}}),
        event("actuator_delay", delay=0.1, when={"event_state": {"event": 0}}),
        event("low_friction", friction=0.5, when={"event_state": after}),
        event("sensor_noise", position=1.0, when={"event_state": {**after, "above": 0.0, "below": 0.05}}),
    )
    found = begun(world, replace(CALM, events=events), 4.0)
    times = [None if s is None else round(s, 1) for s in found.values()]
    assert times[:3] == [1.0, 1.1, 2.6]
    line = event_lines(world.plan, world.happenings())[3]
    assert line.endswith("it waits for event_state event 0 state over above 0 below 0.05")
    assert times[3] is None, "it is over for 0 s at one decision, and for 0.1 s at the next"


def test_one_that_is_replaced_is_over(world):
    ice = [
        event("low_friction", friction=0.2),
        event("low_friction", friction=0.5, when={"simulation_time": {"above": 0.95}}),
    ]
    then = event("actuator_delay", delay=0.1, when={"event_state": {"event": 0, "state": "over"}})
    assert round(begun(world, replace(CALM, events=(*ice, then)), 2.0)["actuator_delay2"], 1) == 1.1


@pytest.mark.parametrize("state", ["begun", "over"])
def test_who_waits_for_what_does_not_happen_waits_for_good(world, tmp_path, state):
    """The numbers are those of the file, also where an event before does not happen."""
    path = tmp_path / "a.yaml"
    path.write_text(
        FILE.format(first="{probability: 0}", second=f"{{event_state: {{event: 0, state: {state}}}}}")
        + "  - {kind: low_friction, friction: 0.4, when: {event_state: {event: 1}}}\n"
        + "  - {kind: actuator_delay, delay: 0.1}\n"
        + "  - {kind: density_surge, density: 30, when: {event_state: {event: 3}}}\n"
    )
    found = begun(world, load_scenario(str(path)), 2.0)
    assert found["low_friction1"] is None
    assert found["low_friction2"] is None
    assert found["density_surge4"] == pytest.approx(0.1)


@pytest.mark.parametrize(
    ("first", "second", "said"),
    [
        ("{event_state: {event: 0}}", "{simulation_time: {above: 1}}", r"events\.0.*none before the first"),
        ("{simulation_time: {above: 1}}", "{event_state: {event: 1}}", r"events\.1.*only 0\); got 1"),
        ("{simulation_time: {above: 1}}", "{event_state: {event: {choice: [0, 7]}}}", r"events\.1.*got 7"),
        ("{simulation_time: {above: 1}}", "{event_state: {event: 0, state: ended}}", "begun, over"),
        ("{simulation_time: {above: 1}}", "{event_state: {event: 0.5}}", "whole number"),
    ],
)
def test_only_events_before_in_the_file_can_be_waited_for(tmp_path, first, second, said):
    path = tmp_path / "a.yaml"
    path.write_text(FILE.format(first=first, second=second))
    with pytest.raises(ScenarioError, match=said):
        load_scenario(str(path))
