"""A small finished sweep, and an engine without worker processes: what fuzzers of its folder start from."""

from __future__ import annotations

import multiprocessing
import shutil
from collections.abc import Iterator, Sequence
from pathlib import Path

from rudc.evaluation.engine import Result, RunnerFactory
from rudc.evaluation.sweep import ENGINES, Engine
from rudc.evaluation.tasks import Task
from rudc.network.network import shipped_networks
from tests.fuzz.fuzzer import Command

SCENARIO = (
    "name: own\nextends: random_destination\nnetwork: own.net.xml\ntraffic: {density: 5}\n"
    "sweep: {ego.speed: [5, 8]}\nepisode: {timeout: 0.3}\n"
)
AGENT = (
    "class Fails:\n    def reset(self, scene, seed):\n        pass\n\n    def act(self, scene):\n"
    "        return 'no action'\n"
)
SWEEP: Command = (
    "sweep", "own.yaml", "--agent", "follower", "--agent", "gap-acceptance+ttcbf", "--agent",
    "fails.py:Fails", "--episodes",
    "2", "--out", "swept",
)  # fmt: skip


def run_here(
    tasks: Sequence[Task], _workers: int, _limit_s: float, make_runner: RunnerFactory
) -> Iterator[Result]:
    """An engine: one episode after another in this process."""
    run = make_runner()
    for task in tasks:
        yield task, run(task)


def finished_sweep(folder: Path) -> Path:
    """A folder with a scenario, its network, an agent that fails, and `swept`, made by SWEEP. From here on
    sweeps of this process, and of its forks, run in it.
    """
    ENGINES["local"] = Engine(run_here)
    made = folder / "made"
    made.mkdir()
    shutil.copy(shipped_networks()["t_junction"], made / "own.net.xml")
    (made / "own.yaml").write_text(SCENARIO)
    (made / "fails.py").write_text(AGENT)
    process = multiprocessing.get_context("fork").Process(target=_sweep, args=(made,))
    process.start()  # libsumo stays out of this process
    process.join()
    if not (made / "swept" / "metrics.csv").exists():
        raise AssertionError(f"no sweep to damage: exit code {process.exitcode}")
    return made


def _sweep(made: Path) -> None:
    import os
    import sys

    from rudc.cli.main import main

    os.chdir(made)
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    os.dup2(1, 2)
    sys.argv = ["rudc", *SWEEP]
    main()
