"""Case studies: which episode is shown, and what is kept of it; the blocked left turn runs for real."""

import numpy as np
import pytest
from PIL import Image

from rudc.errors import AgentError
from rudc.evaluation.store import read_table
from rudc.evaluation.sweep import Silent
from rudc.scenario import find_scenarios
from rudc.studies import ood_case
from rudc.studies.base import Order
from rudc.studies.case import COLUMNS, Driver, chosen_seed, drive, drivers


def rows(*ends: tuple[int, str, str]):
    """Rows of a sweep: seed, agent, outcome; an error where it is empty."""
    return [{"seed": str(s), "agent": a, "outcome": o, "error": "" if o else "no"} for s, a, o in ends]


def test_the_shown_seed_is_that_in_which_the_first_alone_succeeds():
    both = [(0, "a", "success"), (0, "b", "success"), (1, "a", "success"), (1, "b", "collision")]
    worse = [(2, "a", "frozen"), (2, "b", "collision"), (3, "a", "success"), (3, "b", "frozen")]
    assert chosen_seed(rows(*both, *worse), ("a", "b")) == 1
    assert chosen_seed(rows(*both[:2], *worse[:2]), ("a", "b")) == 0
    assert chosen_seed(rows(*worse[:2]), ("a", "b")) == 2
    assert chosen_seed(rows((0, "a", "success"), (0, "b", "")), ("a", "b")) is None


def test_drivers_named_are_called_as_they_are():
    assert drivers(("sumo", "sumo"), ()) == (Driver("sumo", "sumo"),)
    with pytest.raises(AgentError):
        drivers(("nobody",), ())


def test_a_case_holds_the_episode():
    (scenario,) = find_scenarios(["blocked_left_turn"])
    case = drive(scenario, Driver("mine", "planner"), 0)
    assert tuple(case.ego) == COLUMNS
    assert np.diff(case.ego["time_s"]) == pytest.approx(0.1)
    assert sum(track.is_event for track in case.tracks) == 3
    assert np.isnan(case.ego["sigma_total"]).all()
    assert case.ego["h_m2"].min() < 25.0 < case.ego["h_m2"].max()


@pytest.mark.slow
def test_ood_case_runs_and_resumes(tmp_path, monkeypatch, trained):
    monkeypatch.setattr("rudc.evaluation.manifest.code_version", lambda: "v0")
    order = Order(tmp_path / "out", agents=(str(trained), "gap-acceptance"), episodes=1)
    report = ood_case.run(order, lambda _: Silent())
    lines = read_table(tmp_path / "out" / "ood_case.csv")
    assert {line["agent"] for line in lines} == {str(trained), "gap-acceptance"}
    assert "Shown is seed 0" in report.table
    with Image.open(tmp_path / "out" / "ood_case.png") as picture:
        assert picture.size[1] > 900
    again = Order(tmp_path / "out", agents=order.agents, episodes=1, resume=True)
    assert ood_case.run(again, lambda _: Silent()).table.splitlines()[-1] == report.table.splitlines()[-1]
