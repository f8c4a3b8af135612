"""Sweeps of agents that are not RUDC's: workers find them; one that fails costs its own episodes only."""

import json
import pickle
import sys

import pytest

from rudc.agents import drivers
from rudc.agents.registry import make_agent
from rudc.errors import InputError, SweepError
from rudc.evaluation.folder import read_sweep
from rudc.evaluation.rerun import find_episode
from rudc.evaluation.runner import EpisodeRunner
from rudc.evaluation.sweep import prepared, run_sweep
from rudc.evaluation.tasks import SweepPlan, Task
from rudc.scenario import load_scenario

SOURCE = """
import time

class Steady:
    def __init__(self, speed=8.0):
        self.speed = speed
    def reset(self, scene, seed):
        pass
    def act(self, scene):
        return self.speed - scene.ego.v, 0.0

class Raises(Steady):
    def act(self, scene):
        if scene.time_s > 0.5:
            raise ValueError("I am lost")
        return 0.0, 0.0

class Nan(Steady):
    def act(self, scene):
        return float("nan"), 0.0

class Slow(Steady):
    def act(self, scene):
        try:
            time.sleep(60.0)
        except Exception:
            pass

class Long(Steady):
    def act(self, scene):
        raise ValueError('it said "' + "x" * 200_000)

class NoText(Steady):
    def act(self, scene):
        raise ValueError("no file \\udcff")
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [*sys.path])
    (tmp_path / "mine.py").write_text(SOURCE, encoding="utf-8")
    return tmp_path


def plan_of(agents, episodes=1):
    return SweepPlan((load_scenario("random_destination"),), tuple(agents), episodes, 0)


def test_the_others_go_on(folder):
    agents = ["mine.py:Steady(speed=6)", "mine.py:Raises", "mine.py:Nan", "follower"]
    plan = plan_of(agents, 2)
    result = run_sweep(plan, folder / "out", EpisodeRunner)
    by_agent = {name: [row for row in result.rows if row["agent"] == name] for name in agents}
    assert all(row["outcome"] for name in ("follower", "mine.py:Steady(speed=6)") for row in by_agent[name])
    for row, file in zip(by_agent["mine.py:Raises"], ("3", "4"), strict=True):
        assert row["error"] == (
            "agent mine.py:Raises at 0.6 s: act raised ValueError: I am lost (mine.py:15); "
            f"traceback in errors/{file}.txt"
        )
        text = (folder / "out/errors" / f"{file}.txt").read_text()
        assert text.startswith("random_destination, mine.py:Raises, seed ")
        assert "raise ValueError" in text
        assert 'mine.py", line 15, in act' in text
    assert all("act answered (nan, 0.0)" in row["error"] for row in by_agent["mine.py:Nan"])
    assert "act answered (nan, 0.0)" in (folder / "out/errors/5.txt").read_text()
    settings = json.loads((folder / "out/manifest.json").read_text())["configuration"]["agents"]
    assert len(settings["mine.py:Raises"]["source"]) == 16

    (folder / "mine.py").write_text(SOURCE.replace("time_s > 0.5", "time_s > 99"), encoding="utf-8")
    with pytest.raises(SweepError, match=r"agents\.mine\.py:Raises\.source"):
        run_sweep(plan, folder / "out", EpisodeRunner, resume=True)


def test_errors_that_are_long_or_no_text_leave_a_table_that_can_be_read(folder):
    run_sweep(plan_of(["mine.py:Long", "mine.py:NoText"]), folder / "out", EpisodeRunner)
    long, no_text = read_sweep(folder / "out")[0]
    assert 'it said "xxx' in long["error"]
    assert len(long["error"]) < 2_100
    assert "x" * 200_000 in (folder / "out" / "errors" / "1.txt").read_text(encoding="utf-8")
    assert r"no file \udcff" in no_text["error"]
    assert r"no file \udcff" in (folder / "out" / "errors" / "2.txt").read_text(encoding="utf-8")


def test_tracebacks_of_episodes_that_are_run_again_go(folder):
    plan = plan_of(["mine.py:Raises"])
    run_sweep(plan, folder / "out", EpisodeRunner)
    stale = folder / "out/errors/7.txt"
    stale.touch()
    result = run_sweep(plan, folder / "out", EpisodeRunner, resume=True)
    assert result.errors[0]["error"].endswith("traceback in errors/1.txt")
    assert not stale.exists()


def test_too_slow_is_said_with_the_place(folder):
    run = EpisodeRunner(limit_s=1.0)
    scenario = load_scenario("random_destination")
    record = run(Task(scenario, {}, "mine.py:Slow", 0))
    assert "no result within 1 s; it was at mine.py:25, in act" in record.error
    assert "time.sleep(60.0)" in record.traceback
    run.close()


class Registered:
    """Goes straight on."""

    def reset(self, scene, seed):
        pass

    def act(self, scene):
        return 0.5, 0.0


def test_workers_know_registered_agents(folder, monkeypatch):
    monkeypatch.setattr(drivers, "_registered", {})
    drivers.register_agent("straight-on", Registered)
    plan = plan_of(["straight-on"])
    assert not run_sweep(plan, folder / "out", EpisodeRunner).errors


def test_workers_know_an_agent_that_anothers_file_registers(folder, monkeypatch):
    monkeypatch.setattr(drivers, "_registered", {})
    more = "import rudc\nrudc.register_agent('second', Steady)\n"
    (folder / "two.py").write_text(SOURCE + more, encoding="utf-8")
    make_agent("two.py:Steady")
    assert not run_sweep(plan_of(["second"]), folder / "out", EpisodeRunner).errors
    assert find_episode(folder / "out", "1").changes == ()


def test_an_agent_that_no_worker_can_import_is_refused_where_it_is_used(folder, monkeypatch):
    monkeypatch.setattr(drivers, "_registered", {})
    drivers.register_agent("mine", lambda: Registered())
    assert pickle.loads(pickle.dumps(prepared(EpisodeRunner, ["follower"])))()
    with pytest.raises(InputError, match="agent 'mine' is registered here, and worker processes cannot"):
        run_sweep(plan_of(["mine+ttcbf:d_safe=0.3"]), folder / "out", EpisodeRunner)
    assert not (folder / "out").exists()


def test_an_agent_that_this_worker_cannot_import_ends_what_uses_it_alone(monkeypatch):
    monkeypatch.setattr(drivers, "_registered", {})
    drivers.register_agent("straight-on", Registered)
    used, unused = (pickle.dumps(prepared(EpisodeRunner, [name])) for name in ("straight-on", "follower"))
    monkeypatch.delattr(f"{__name__}.Registered")  # as for a class of a notebook
    assert pickle.loads(unused)()
    with pytest.raises(InputError, match=r"cannot import it \(AttributeError: .*'Registered'"):
        pickle.loads(used)()
