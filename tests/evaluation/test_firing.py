"""Whether scripted events happen: counted over episodes, in what is shipped and where traffic is thin."""

import pytest
from typer.testing import CliRunner

from rudc.cli.commands import app
from rudc.evaluation.firing import Firing, count_firings
from rudc.scenario import load_scenario, shipped_scenarios

WAITING = [
    name
    for name in shipped_scenarios()
    if any(
        event.when is not None or getattr(event, "vehicle", None) is not None
        for event in load_scenario(name).events
    )
]


@pytest.mark.parametrize("name", WAITING)
def test_the_events_of_shipped_scenarios_happen(name):
    """In at least 95 % of the episodes that they are part of: here, with few episodes, in all of them."""
    for firing in count_firings(load_scenario(name), range(3)):
        assert firing.fired == firing.seen == firing.drawn, firing


@pytest.mark.parametrize("selector", ["leader", "oncoming", "crossing", "follower"])
@pytest.mark.parametrize("density", [0, 5, 40])
def test_whom_an_event_selects_is_there_whatever_the_traffic(selector, density):
    slow = {
        "kind": "slow_vehicle",
        "vehicle": selector,
        "speed": 4,
        "when": {"simulation_time": {"above": 0.5}},
    }
    scenario = load_scenario("random_destination", {"events": [slow], "traffic.density": density})
    (firing,) = count_firings(scenario, range(3))
    assert firing.fired == 3


def test_counts_say_what_probability_left_out():
    assert (
        str(Firing(2, "hard_brake", 20, 20, 20, 20))
        == "event 2 (events.1) hard_brake: happens in 20 of 20 episodes"
    )
    assert str(Firing(1, "speeding", 20, 11, 10, 9)) == (
        "event 1 (events.0) speeding: happens in 10 of 20 episodes (its probability lets it in 11), "
        "and the ego sees it in 9; in the others its trigger did not come true before gap-acceptance, which "
        "drives here, arrived, or there was nobody for it to act on"
    )


def test_validate_says_how_often_events_happen():
    result = CliRunner().invoke(app, ["scenario", "validate", "sudden_brake", "--seeds", "3"])
    assert result.exit_code == 0
    assert result.stdout.splitlines() == [
        "sudden_brake: ok (1 event)",
        "  event 1 (events.0) hard_brake: happens in 3 of 3 episodes",
    ]
