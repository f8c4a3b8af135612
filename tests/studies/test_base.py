"""Agents and scenarios that studies take."""

from pathlib import Path

import pytest

from rudc.errors import InputError
from rudc.studies import base
from rudc.studies.base import Order, chosen_agents, family, in_distribution, out_of_distribution


@pytest.mark.parametrize(
    ("agent", "shared"),
    [
        ("rudc-t", "rudc-t"),
        ("rudc-t-seed12", "rudc-t"),
        ("out/mine-seed1/", "out/mine"),
        ("rudc-t-seed1:correction.slack.gain=0.2", "rudc-t:correction.slack.gain=0.2"),
        ("rudc-wo-cbf-seed2+ttcbf", "rudc-wo-cbf+ttcbf"),
        ("seed1", "seed1"),
    ],
)
def test_agents_that_differ_in_their_training_seed_are_of_one_family(agent, shared):
    assert family(agent) == shared


def test_shipped_agents_are_taken_when_none_are_named(monkeypatch):
    shipped = ["rudc-e", "rudc-t", "rudc-t-paper", "rudc-t-seed1", "rudc-wo-cbf"]
    monkeypatch.setattr(base, "shipped_checkpoints", lambda: dict.fromkeys(shipped, Path()))
    assert chosen_agents(Order(Path())) == ("rudc-e", "rudc-t", "rudc-t-seed1")
    assert len(chosen_agents(Order(Path(), budget="quick"))) == 1
    assert chosen_agents(Order(Path(), agents=("sumo", "sumo"))) == ("sumo",)
    monkeypatch.setattr(base, "shipped_checkpoints", dict)
    with pytest.raises(InputError, match="--agent"):
        chosen_agents(Order(Path()))


def test_scenarios_are_split_into_tasks_and_the_others():
    tasks = {scenario.name for scenario in in_distribution()}
    others = {scenario.name for scenario in out_of_distribution("full")}
    assert tasks == {"random_destination", "dense_left_turn"}
    assert not tasks & others
    assert {"fog", "perfect_storm", "roundabout_crossing"} <= others
    assert "density_sweep" not in others
    assert {s.name for s in out_of_distribution("quick")} < others
