"""Worker processes: those that work, die, hang, or never start."""

import math
import multiprocessing
import signal
import subprocess
import sys
import time
import types
from contextlib import closing
from functools import partial
from unittest.mock import MagicMock

import pytest

from rudc.errors import InputError, SimulationError, SweepError
from rudc.evaluation.engine import BEGINS, _guard, _Pool, _Worker, run_local
from rudc.evaluation.limits import LONGEST_LIMIT_S
from rudc.evaluation.ray_engine import _Remote, run_ray
from rudc.evaluation.runner import EpisodeRunner
from rudc.evaluation.sweep import run_sweep


def collect(tasks, make_runner, workers=2, limit_s=60.0, engine=run_local):
    with closing(engine(tasks, workers, limit_s, make_runner)) as results:
        found = list(results)
    assert not multiprocessing.active_children(), "workers must be gone"
    return {(task.agent, task.seed): record for task, record in found}, len(found)


def test_every_task_is_answered_once(fakes, make_plan):
    tasks = make_plan(episodes=8).tasks()
    records, count = collect(tasks, fakes.Runner)
    assert count == len(tasks) == 16
    for task in tasks:
        assert records[task.agent, task.seed].row()[:16] == fakes.made_up(task).row()[:16]


def test_there_are_no_more_workers_than_tasks(fakes, make_plan):
    results = run_local(make_plan(agents=("sumo",), episodes=1).tasks(), 50, 60.0, fakes.Runner)
    next(results)
    assert len(multiprocessing.active_children()) == 1
    results.close()
    assert not multiprocessing.active_children()


def test_a_worker_that_dies_is_replaced_and_its_episode_retried(fakes, make_plan, tmp_path):
    tasks = make_plan(agents=("sumo",), episodes=4).tasks()
    records, count = collect(tasks, partial(fakes.Troubled, "die_once", tmp_path))
    assert count == 4
    assert not any(record.error for record in records.values())


@pytest.mark.parametrize(
    ("trouble", "cause"),
    [("die", "SIGKILL"), ("exit", "exit code 7"), ("told_to_end", "it ended with exit code 0")],
)
def test_an_episode_that_kills_twice_is_recorded_with_its_error(fakes, make_plan, tmp_path, trouble, cause):
    tasks = make_plan(agents=("sumo",), episodes=4).tasks()
    records, count = collect(tasks, partial(fakes.Troubled, trouble, tmp_path))
    assert count == 4
    assert [seed for (_, seed), record in records.items() if record.error] == [1]
    assert "the worker failed 2 times" in records["sumo", 1].error
    assert cause in records["sumo", 1].error


UNGUARDED = """
from pathlib import Path
from rudc.evaluation.runner import EpisodeRunner
from rudc.evaluation.sweep import run_sweep
from rudc.evaluation.tasks import SweepPlan
from rudc.scenario import find_scenarios

plan = SweepPlan(tuple(find_scenarios(["fog"])), ("follower",), episodes=1, seed=0)
run_sweep(plan, Path("out"), EpisodeRunner, workers=1)
"""


def test_a_script_without_a_main_guard_is_told(tmp_path):
    (tmp_path / "mine.py").write_text(UNGUARDED, encoding="utf-8")
    run = subprocess.run(
        [sys.executable, "mine.py"], cwd=tmp_path, capture_output=True, text=True, check=False, timeout=60
    )
    assert run.returncode == 1
    last = run.stderr.strip().splitlines()[-1]
    assert "workers cannot start: it ended with exit code 1; each imports mine.py first" in last
    assert last.endswith("A script calls run_sweep under `if __name__ == '__main__':`")


def test_only_a_script_that_sweeps_is_told_of_a_main_guard(tmp_path, monkeypatch):
    for name, text, told in (
        ("rudc", "run_sweep()", False),
        ("a.py", "main()", False),
        ("b.py", "run_sweep()", True),
    ):
        (tmp_path / name).write_text(text, encoding="utf-8")
        monkeypatch.setitem(sys.modules, "__main__", types.SimpleNamespace(__file__=str(tmp_path / name)))
        assert bool(_guard()) == told
    monkeypatch.setitem(sys.modules, "__main__", types.SimpleNamespace())
    assert _guard() == ""


def test_an_episode_that_hangs_is_given_up(fakes, make_plan, tmp_path):
    tasks = make_plan(agents=("sumo",), episodes=3).tasks()
    records, _ = collect(tasks, partial(fakes.Troubled, "hang", tmp_path), limit_s=1.0)
    assert "no result within 1 s" in records["sumo", 1].error
    assert not records["sumo", 2].error


def test_workers_that_cannot_start_say_why(fakes, make_plan):
    with pytest.raises(SimulationError, match="libsumo cannot be imported"):
        collect(make_plan().tasks(), fakes.no_runner)
    with pytest.raises(SimulationError, match="workers cannot start: it ended with exit code 3"):
        collect(make_plan().tasks(), fakes.dead_on_arrival, workers=1)
    assert not multiprocessing.active_children()


def test_an_episode_that_ends_while_a_worker_cannot_start_is_not_lost(fakes, make_plan, monkeypatch):
    tasks = make_plan(agents=("sumo",), episodes=2).tasks()
    record = fakes.made_up(tasks[0])
    said = iter([("ready", record), (BEGINS, "libsumo cannot be imported")])
    ends = []

    def start(pool):
        (ours, theirs), (sentinel, other) = multiprocessing.Pipe(), multiprocessing.Pipe()
        for message in next(said):
            theirs.send(message)
        ends.extend([theirs, other])
        process = MagicMock(sentinel=sentinel)
        process.is_alive.return_value = False
        return _Worker(process, ours)

    monkeypatch.setattr(_Pool, "_start", start)
    results = run_local(tasks, 2, 60.0, fakes.Runner)
    assert next(results) == (tasks[0], record)
    with pytest.raises(SimulationError, match="libsumo cannot be imported"):
        next(results)


def test_stopping_early_ends_busy_workers(fakes, make_plan):
    results = run_local(make_plan(episodes=20).tasks(), 2, 60.0, partial(fakes.Runner, 0.3))
    next(results)
    results.close()
    assert not multiprocessing.active_children()


def test_ray_that_is_not_installed_is_named(make_plan, fakes, monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(InputError, match=r"pip install .*\[ray\]"):
        run_sweep(make_plan(), tmp_path / "out", fakes.Runner, engine="ray")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("before", [False, True])
def test_a_connection_to_ray_is_as_it_was_before(make_plan, fakes, monkeypatch, tmp_path, before):
    """Also after a sweep of which nothing was left to do."""
    ray, is_open = _ray_in_process(), [before]
    ray.is_initialized = lambda: is_open[0]
    ray.init, ray.shutdown = (
        (lambda **_: is_open.__setitem__(0, True)),
        (lambda: is_open.__setitem__(0, False)),
    )
    monkeypatch.setitem(sys.modules, "ray", ray)
    for resume in (False, True):
        run_sweep(make_plan(), tmp_path / "out", fakes.Runner, engine="ray", resume=resume)
        assert is_open == [before]
    assert len(ray.made) == 1


class _Actor:
    """Stands for a ray actor: calls are answered when they are asked for, those of one without a core
    never."""

    def __init__(self, make, has_core):
        def call(method):
            return lambda *arguments: _Reference(lambda: getattr(make(), method)(*arguments), has_core)

        self.ready = types.SimpleNamespace(remote=call("ready"))
        self.run = types.SimpleNamespace(remote=call("run"))


class _Reference:
    """Stands for a ray object reference."""

    def __init__(self, answer, has_core):
        self.answer, self.has_core = answer, has_core


def _ray_in_process(cores=100):
    """As much of ray as the engine uses, in this process; an actor that raises counts as dead."""
    killed, made = [], []

    def decorate(**_):
        def actor(cls, factory):
            made.append(factory)
            return _Actor(lambda: cls(factory), len(made) <= cores)

        return lambda cls: types.SimpleNamespace(remote=lambda factory: actor(cls, factory))

    def get(reference, timeout):
        return reference.answer()

    def wait(references, num_returns, timeout):
        there = [reference for reference in references if reference.has_core][:num_returns]
        return there, [reference for reference in references if reference not in there]

    return types.SimpleNamespace(
        init=lambda **_: None, is_initialized=lambda: False, shutdown=lambda: None, remote=decorate, get=get,
        kill=killed.append, wait=wait, killed=killed, made=made,
    )  # fmt: skip


def test_the_ray_engine_gives_the_same_records_and_retries(make_plan, fakes, monkeypatch):
    ray = _ray_in_process()
    monkeypatch.setitem(sys.modules, "ray", ray)
    tasks = make_plan(episodes=4).tasks()
    records, count = collect(tasks, fakes.Runner, engine=run_ray)
    assert count == len(tasks)
    assert all(records[t.agent, t.seed].row()[:16] == fakes.made_up(t).row()[:16] for t in tasks)

    def fragile():
        def run(task):
            if task.seed == 1:
                raise RuntimeError("actor died")
            return fakes.made_up(task)

        return run

    records, count = collect(tasks, fragile, engine=run_ray)
    assert count == len(tasks)
    assert [key for key, record in records.items() if record.error] == [("sumo", 1), ("follower", 1)]
    assert "RuntimeError: actor died" in records["sumo", 1].error


def test_ray_episodes_travel_in_batches_and_no_actor_waits_idly(make_plan, fakes, monkeypatch):
    """Single ones at first, then as many as take a while; at the end all actors are gone, and their cores
    free for one that replaces another."""
    ray = _ray_in_process()
    monkeypatch.setitem(sys.modules, "ray", ray)
    given, real = [], _Remote.run
    monkeypatch.setattr(_Remote, "run", lambda self, tasks: given.append(tasks) or real(self, tasks))
    tasks = make_plan(episodes=200).tasks()
    _, count = collect(tasks, fakes.Runner, engine=run_ray)
    assert count == len(tasks) == sum(map(len, given)) == 400
    assert (len(given[0]), len(given[-1])) == (1, 1)
    assert max(map(len, given)) > 10
    assert len(ray.killed) == len(ray.made) == 2


def test_a_batch_that_kills_its_ray_actor_takes_no_innocent_with_it(make_plan, fakes, monkeypatch):
    monkeypatch.setitem(sys.modules, "ray", _ray_in_process())

    def fragile():
        def run(task):
            if task.seed in (120, 121):
                raise RuntimeError("actor died")
            return fakes.made_up(task)

        return run

    tasks = make_plan(agents=("sumo",), episodes=200).tasks()
    records, count = collect(tasks, fragile, engine=run_ray)
    assert count == 200
    assert sorted(seed for (_, seed), record in records.items() if record.error) == [120, 121]


def test_ray_with_fewer_cores_than_workers_gives_no_task_to_those_that_wait(make_plan, fakes, monkeypatch):
    monkeypatch.setitem(sys.modules, "ray", _ray_in_process(cores=1))
    tasks = make_plan(episodes=4).tasks()
    records, count = collect(tasks, fakes.Runner, engine=run_ray, workers=3)
    assert count == len(tasks)
    assert not any(record.error for record in records.values())


@pytest.mark.parametrize(
    ("takes_s", "told"), [(60.0, ""), (125.0, "no result within 1 s, and 120 s to load")]
)
def test_loading_has_a_time_of_its_own_also_on_ray(make_plan, fakes, monkeypatch, takes_s, told):
    """An actor answers after `takes_s` of a clock that goes on by itself; an episode has one second."""
    ray, now, asked = _ray_in_process(), [0.0], {}

    def wait(references, num_returns, timeout):
        now[0] += timeout
        there = [r for r in references if now[0] - asked.setdefault(r, now[0]) >= takes_s][:num_returns]
        return there, [r for r in references if r not in there]

    def get(reference, timeout):
        if now[0] - asked[reference] < takes_s:
            raise TimeoutError
        return reference.answer()

    ray.wait, ray.get = wait, get
    monkeypatch.setitem(sys.modules, "ray", ray)
    clock = types.SimpleNamespace(monotonic=lambda: now[0])
    monkeypatch.setattr("rudc.evaluation.ray_engine.time", clock)
    tasks = make_plan(agents=("sumo",), episodes=1).tasks()
    records, _ = collect(tasks, fakes.Runner, limit_s=1.0, engine=run_ray)
    error = records["sumo", 0].error
    assert (told in error) if told else not error


def test_ray_actors_that_cannot_start_say_why(make_plan, fakes, monkeypatch):
    monkeypatch.setitem(sys.modules, "ray", _ray_in_process())
    with pytest.raises(SimulationError, match=r"workers cannot start: .*libsumo cannot be imported"):
        collect(make_plan().tasks(), fakes.no_runner, engine=run_ray)


def test_the_limit_counts_the_episode_not_what_is_loaded_for_it(fakes, make_plan):
    tasks = make_plan(agents=("sumo",), episodes=1).tasks()
    ((_, record),) = run_local(tasks, 1, 0.5, fakes.SlowToLoad)
    assert record.error == ""


def test_as_long_a_limit_as_there_can_be_is_waited_for(fakes, make_plan, tmp_path):
    plan = make_plan(agents=("follower",), episodes=1)
    runner = partial(EpisodeRunner, limit_s=LONGEST_LIMIT_S)
    assert not run_sweep(plan, tmp_path / "most", runner, limit_s=LONGEST_LIMIT_S).errors
    for limit_s in (1.1 * LONGEST_LIMIT_S, math.nan):
        with pytest.raises(SweepError, match="--episode-limit is more than 0 and at most"):
            run_sweep(plan, tmp_path / "more", fakes.Runner, limit_s=limit_s)
    assert not (tmp_path / "more").exists()


TOLD_TWICE = """
import atexit, time
from multiprocessing import Pipe
from rudc.evaluation.engine import serve

def make_runner():
    atexit.register(time.sleep, 0.8)
    print("here", flush=True)
    return lambda task: None

ours, theirs = Pipe()
serve(ours, make_runner)
"""


def test_a_worker_that_is_told_to_end_twice_ends_without_a_word():
    """As where `timeout` ends the whole process group, and then the sweep its workers."""
    worker = subprocess.Popen(
        [sys.executable, "-c", TOLD_TWICE], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert worker.stdout is not None
    assert worker.stdout.readline() == "here\n"
    for _ in range(5):
        worker.send_signal(signal.SIGTERM)
        time.sleep(0.1)
    _, told = worker.communicate(timeout=60)
    assert (worker.returncode, told) == (0, "")
