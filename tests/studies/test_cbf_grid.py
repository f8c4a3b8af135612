"""Grids of the filter's rates: their points and what is chosen of them; driven for real in
test_quick.py."""

import pytest

from rudc.errors import InputError
from rudc.evaluation.sweep import Silent
from rudc.studies import cbf_grid
from rudc.studies.base import Order
from rudc.studies.cbf_grid import Point, lines_of, points


def test_half_of_the_ecbf_grid_is_driven_and_the_papers_points_are_in_it():
    found = points(("follower",), "full")
    assert len(found) == 2 * (7 + 15)
    assert {
        rule: rates for p in found if p.rates == cbf_grid.PAPER[p.rule] for rule, rates in [(p.rule, p.rates)]
    } == cbf_grid.PAPER
    last = Point("follower", "all", "ecbf", (1.5, 0.3)).agent
    assert last == (
        "follower+ecbf:correction.ecbf_rate1=1.5,correction.ecbf_rate2=0.3,"
        "correction.constrained=all,correction.last_resort=off"
    )


def test_the_fewest_violations_are_chosen_then_the_most_successes():
    outcomes = {0.05: ("frozen", "frozen"), 0.1: ("success", "frozen"), 1.0: ("success", "collision")}
    by_agent = {str(rate): Point("follower", "gated", "ttcbf", (rate,)) for rate in outcomes}
    rows = [
        {"agent": str(rate), "outcome": outcome, "error": "", "mean_speed_mps": "5", "episode_reward": "0",
         "route_completion": "1", "min_dtc_m": "1", "decision_ms_mean": "1", "steps": "10"}
        for rate, ends in outcomes.items() for outcome in ends
    ]  # fmt: skip
    lines = lines_of(rows, by_agent)
    assert [line["rate1"] for line in lines if line["chosen"]] == [0.1]
    assert [line["rate1"] for line in lines if line["paper"]] == [0.1]


def test_a_point_that_could_not_be_driven_is_not_chosen():
    by_agent = {str(rate): Point("follower", "gated", "ttcbf", (rate,)) for rate in (0.05, 0.1, 0.2)}
    rows = [
        {"agent": agent, "outcome": outcome, "error": "" if outcome else "no", "mean_speed_mps": "5",
         "episode_reward": "0", "route_completion": "1", "min_dtc_m": "1", "decision_ms_mean": "1",
         "steps": "10"}
        for agent, outcome in zip(by_agent, ("", "collision", "success"), strict=True)
    ]  # fmt: skip
    assert [line["rate1"] for line in lines_of(rows, by_agent) if line["chosen"]] == [0.2]
    assert not any(line["chosen"] for line in lines_of(rows[:1], by_agent))


def test_drivers_with_a_filter_of_their_own_are_refused(tmp_path):
    for name in ("follower+ttcbf", "rudc.agents.follower:Follower+ttcbf"):
        with pytest.raises(InputError, match="one without"):
            cbf_grid.run(Order(tmp_path, agents=(name,)), lambda _: Silent())


def test_a_driver_of_ones_own_is_driven(tmp_path, monkeypatch):
    def driven(plan, *_, **__):
        raise InputError(plan.agents[0])

    monkeypatch.setattr(cbf_grid, "run_sweep", driven)
    with pytest.raises(InputError, match=r"^rudc.agents.follower:Follower\+ttcbf:"):
        cbf_grid.run(Order(tmp_path / "a", agents=("rudc.agents.follower:Follower",)), lambda _: Silent())
