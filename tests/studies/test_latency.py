"""The latency study: parts of a decision add up, and the stopwatch leaves no trace; it runs
for real in test_quick.py."""

import time
from contextlib import closing

import numpy as np
import pytest

from rudc.evaluation.tasks import Task
from rudc.safety.qp import PlanarSolver
from rudc.scenario import load_scenario
from rudc.studies import latency
from rudc.studies.step_files import steps_file
from rudc.studies.stopwatch import Stopwatch, timing


def busy(seconds: float) -> None:
    """Take the processor's time."""
    end = time.thread_time() + seconds
    while time.thread_time() < end:
        pass


def test_time_of_an_inner_part_is_not_the_outers():
    watch = Stopwatch()
    inner = watch.timed("inner", lambda: busy(0.03))

    def outer() -> None:
        busy(0.01)
        inner()

    watch.timed("outer", outer)()
    spent = watch.take()
    assert spent["inner"] == pytest.approx(30, abs=5)
    assert spent["outer"] == pytest.approx(10, abs=5)
    assert watch.take() == {}


def test_stopwatch_is_taken_away():
    before = PlanarSolver.solve
    with timing(Stopwatch(), latency.PLACES):
        assert PlanarSolver.solve is not before
    assert PlanarSolver.solve is before
    with (
        pytest.raises(AttributeError, match="no such function"),
        timing(Stopwatch(), {"rudc.safety.qp:X": ""}),
    ):
        pass


def test_shares_are_of_the_mean():
    spent = np.zeros((100, len(latency.PARTS) + 1))
    spent[:, latency.PARTS.index("QP")] = 1.0
    spent[:, latency.PARTS.index("policy")] = 3.0
    spent[7, latency.PARTS.index("policy")] = 103.0
    lines = {line["part"]: line for line in latency.lines_of("mine", "fog", spent)}
    assert lines["all"]["mean_ms"] == pytest.approx(5.0)
    assert lines["all"]["peak_ms"] == 104.0
    assert lines["QP"]["share_percent"] == lines["HOCBF"]["share_percent"] == pytest.approx(20.0)
    assert "critics" not in lines


MINE = """
import pathlib

class Mine:
    def reset(self, scene, seed):
        pass

    def act(self, scene):
        if pathlib.Path("{broken}").exists():
            raise ValueError("broken")
        return 0.0, 0.0

class Other(Mine):
    pass
"""


def test_an_episode_that_fails_warms_nobody_up(tmp_path):
    """The runner makes agents anew after it, also those that had driven well: their next episode warms up."""
    broken, file = tmp_path / "broken", tmp_path / "mine.py"
    file.write_text(MINE.format(broken=broken), encoding="utf-8")
    scenario = load_scenario("random_destination", {"episode.timeout": 1.0, "traffic.warm_up": 1.0})
    runner, seeds = latency.LatencyRunner(tmp_path / "steps"), iter(range(10))

    def counts(name):
        agent, seed = f"{file}:{name}", next(seeds)
        if runner(Task(scenario, {}, agent, seed)).error:
            return None
        (found,) = set(np.load(steps_file(tmp_path / "steps", agent, scenario.name, seed))["counts"])
        return bool(found)

    with closing(runner._run):
        broken.touch()
        assert counts("Mine") is None
        broken.unlink()
        assert [counts(name) for name in ("Mine", "Mine", "Other", "Other")] == [False, True] * 2
        broken.touch()
        assert counts("Mine") is None
        broken.unlink()
        assert [counts(name) for name in ("Other", "Other", "Mine", "Mine")] == [False, True] * 2
