"""Agents and scenarios are added to a sweep that is there: what is driven stays, the rest is driven."""

import json

import pytest

from rudc.errors import SweepError
from rudc.evaluation.columns import TIMING
from rudc.evaluation.folder import read_sweep
from rudc.evaluation.kept import kept_plan, with_more
from rudc.evaluation.sweep import run_sweep
from rudc.evaluation.tasks import SweepPlan

FILES = ("episodes.csv", "metrics.csv", "manifest.json")


class Count:
    """Counts the episodes that are driven."""

    def __init__(self):
        self.driven = []

    def begin(self, total, finished, warnings):
        self.there = finished

    def advance(self, task, record):
        self.driven.append(str(task))


def same(one, other):
    """Whether two folders hold the same sweep, timing apart."""
    told = [read_sweep(folder) for folder in (one, other)]
    rows = [
        [{name: cell for name, cell in row.items() if name not in TIMING} for row in rows] for rows, _ in told
    ]
    manifests = [(folder / "manifest.json").read_bytes() for folder in (one, other)]
    return rows[0] == rows[1] and told[0][1] == told[1][1] and manifests[0] == manifests[1]


def plain_then_swept(fakes, make_plan, tmp_path):
    """A plan of which one scenario sweeps values, driven in `at_once`, and without that one in `grown`."""
    plain = make_plan()
    swept = make_plan(names=("dense_left_turn",)).scenarios[0]
    swept = swept.model_copy(update={"sweep": {"traffic.density": (10.0, 20.0)}})
    both = SweepPlan((*plain.scenarios, swept), plain.agents, 3, 0)
    run_sweep(both, tmp_path / "at_once", fakes.Runner)
    run_sweep(plain, tmp_path / "grown", fakes.Runner)
    return both


def test_another_agent(fakes, make_plan, tmp_path):
    both = make_plan()
    run_sweep(both, tmp_path / "at_once", fakes.Runner)
    run_sweep(SweepPlan(both.scenarios, both.agents[:1], 3, 0), tmp_path / "grown", fakes.Runner)
    count = Count()
    run_sweep(both, tmp_path / "grown", fakes.Runner, resume=True, progress=count)
    assert (count.there, len(count.driven)) == (3, 3)
    assert same(tmp_path / "grown", tmp_path / "at_once")


def test_another_scenario_with_values_that_it_sweeps(fakes, make_plan, tmp_path):
    both = plain_then_swept(fakes, make_plan, tmp_path)
    run_sweep(both, tmp_path / "grown", fakes.Runner, resume=True)
    assert same(tmp_path / "grown", tmp_path / "at_once")
    assert read_sweep(tmp_path / "grown")[1] == ("traffic.density",)


def test_a_kill_before_the_columns_are_there_costs_nothing(fakes, make_plan, tmp_path):
    both = plain_then_swept(fakes, make_plan, tmp_path)
    grown = (tmp_path / "at_once" / "manifest.json").read_text()
    (tmp_path / "grown" / "manifest.json").write_text(grown)
    count = Count()
    run_sweep(both, tmp_path / "grown", fakes.Runner, resume=True, progress=count)
    assert (count.there, len(count.driven)) == (6, 12)
    assert same(tmp_path / "grown", tmp_path / "at_once")


def test_what_is_there_may_not_be_left_out_nor_be_another(fakes, make_plan, tmp_path):
    plan = make_plan()
    run_sweep(plan, tmp_path, fakes.Runner)
    before = [(tmp_path / name).read_bytes() for name in FILES]
    left_out = SweepPlan(plan.scenarios, ("sumo", "planner"), 3, 0)
    with pytest.raises(SweepError, match="agents: follower only there\nGive"):
        run_sweep(left_out, tmp_path, fakes.Runner, resume=True)
    (other,) = plan.scenarios
    other = other.model_copy(update={"name": "dense_left_turn"})
    with pytest.raises(SweepError, match="scenarios: random_destination only there\nGive"):
        run_sweep(SweepPlan((other,), plan.agents, 3, 0), tmp_path, fakes.Runner, resume=True)
    denser = plan.scenarios[0].varied({"traffic.density": 35})
    with pytest.raises(SweepError, match="there, 35"):
        run_sweep(with_more(plan, [denser], ["planner"]), tmp_path, fakes.Runner, resume=True)
    assert [(tmp_path / name).read_bytes() for name in FILES] == before


def test_more_of_a_kept_plan(fakes, make_plan, tmp_path):
    plan = make_plan()
    run_sweep(plan, tmp_path, fakes.Runner)
    run_sweep(with_more(kept_plan(tmp_path), [], ["sumo", "planner"]), tmp_path, fakes.Runner, resume=True)
    agents = json.loads((tmp_path / "manifest.json").read_text())["configuration"]["agents"]
    assert [*agents] == ["sumo", "follower", "planner"]
    assert len(read_sweep(tmp_path)[0]) == 9
