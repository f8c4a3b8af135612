"""The scenarios with one cause each: valid, and one for every kind of event."""

from rudc.scenario import load_scenario
from rudc.scenario.events import EVENT_KINDS
from tests.benchmarks.one_cause import NETWORKS, write


def test_each_cause_is_a_scenario_and_each_kind_of_event_is_one(tmp_path):
    files = write(tmp_path)
    scenarios = [load_scenario(str(path)) for path in files]
    assert len(set(files)) == len(files) > 140
    assert {event.kind for scenario in scenarios for event in scenario.events} == set(EVENT_KINDS)
    assert all(scenario.sweep["network"] == tuple(NETWORKS) for scenario in scenarios)
