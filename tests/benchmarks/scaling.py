"""How sweeps scale: what was measured on this machine, and what follows from it for a thousand cores.

    python -m tests.benchmarks.scaling --out results/scaling [--episodes 160] [--rows 1000000]

Measured: real episodes on one and on two workers of the local engine and, where ray is installed, of a ray
cluster on this machine; episodes that take no time (stubs), for the most rows a second that the driver takes
in; a finished sweep of a million made-up rows, for what `rudc table` and the driver hold in memory. Each in a
process of its own. From these `tests/benchmarks/scaling_page.py` says how many rows a second so many cores
give, and what stops them first. DIR gets `scaling.csv`, `model.csv` and `README.md`.
"""

from __future__ import annotations

import argparse
import importlib.util
import json
import multiprocessing
import os
import pickle
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable
from concurrent.futures import ProcessPoolExecutor
from contextlib import closing
from functools import partial
from pathlib import Path

from rudc.evaluation.columns import COLUMNS
from rudc.evaluation.compiled import compile_kernels
from rudc.evaluation.folder import SweepFolder, read_sweep
from rudc.evaluation.manifest import processor
from rudc.evaluation.record import EpisodeRecord
from rudc.evaluation.runner import EpisodeRunner
from rudc.evaluation.store import RowFile, format_row
from rudc.evaluation.sweep import ENGINES, Silent, prepared, run_sweep
from rudc.evaluation.tasks import SweepPlan, Task
from rudc.scenario import find_scenarios
from tests.benchmarks.scaling_page import write_page

SCENARIOS, AGENTS = ("dense_left_turn", "random_destination"), ("rudc-t", "gap-acceptance+ttcbf")


class Clock(Silent):
    """Notes when each row is on the disk."""

    def __init__(self) -> None:
        self.times: list[float] = []

    def advance(self, task: Task, record: EpisodeRecord) -> None:
        """Note it."""
        if record.error:
            raise SystemExit(f"{task}: {record.error}")
        self.times.append(time.perf_counter())


class Stub:
    """A runner that answers at once, with what an episode said before."""

    def __init__(self, values: dict[str, str]) -> None:
        self._values = values

    def __call__(self, task: Task) -> EpisodeRecord:
        told = {"scenario": task.scenario.name, "agent": task.agent, "seed": task.seed}
        return EpisodeRecord({**self._values, **told})


def driven(engine: str, workers: int, episodes: int, folder: Path) -> dict[str, float]:
    """Real episodes: rows a second from the first row to the last."""
    plan = SweepPlan(tuple(find_scenarios(SCENARIOS)), AGENTS, max(episodes // 4, 2), 0)
    compile_kernels()
    clock, begun = Clock(), time.perf_counter()
    run_sweep(plan, folder, EpisodeRunner, workers=workers, engine=engine, progress=clock)
    return {**_rates(clock, begun), "bytes": _row_bytes(folder)}


def stubbed(engine: str, workers: int, episodes: int, folder: Path, row: str) -> dict[str, float]:
    """Episodes that take no time: rows a second, processor time of the driver for a row."""
    plan = SweepPlan(tuple(find_scenarios(SCENARIOS[:1])), AGENTS[1:], episodes, 0)
    clock, begun = Clock(), time.perf_counter()
    mine = _cpu_s()
    with SweepFolder(folder, plan) as opened:
        opened.open(False)
        run = ENGINES[engine].run
        factory = prepared(partial(Stub, json.loads(row)), plan.agents)
        with closing(run(opened.tasks, workers, 60.0, factory)) as results:  # pyright: ignore
            for task, record in results:
                if not clock.times:
                    mine = _cpu_s()
                clock.advance(task, opened.add(task, record))
    driver_ms = 1e3 * (_cpu_s() - mine) / len(clock.times)
    batch = opened.tasks[:100]
    return {
        **_rates(clock, begun),
        "driver_ms": driver_ms,
        "task_bytes": len(pickle.dumps(batch)) / len(batch),
        "alone_bytes": float(len(pickle.dumps(batch[0]))),
        "record_bytes": float(len(pickle.dumps(record))),
    }


def finished(rows: int, folder: Path, row: str) -> dict[str, float]:
    """Write a sweep that is finished, resume it, and say what the driver took."""
    plan = SweepPlan(tuple(find_scenarios(SCENARIOS[:1])), AGENTS[1:], rows, 0)
    made = json.loads(row)
    with SweepFolder(folder, plan) as opened:
        opened.open(False)
    cells = [made[name] for name in COLUMNS]
    at, reward = list(COLUMNS).index("seed"), list(COLUMNS).index("episode_reward")
    first = (plan.scenarios[0].name, plan.agents[0])

    def lines() -> Iterable[str]:
        for seed in range(rows):
            cells[:2], cells[at], cells[reward] = first, str(seed), f"{(seed * 7919) % 100003 / 1e3:.6f}"
            yield format_row(cells)

    RowFile(folder / "episodes.csv", list(COLUMNS)).rewrite(lines())
    before, mine, begun = _peak_mb(), _cpu_s(), time.perf_counter()
    run_sweep(plan, folder, EpisodeRunner, resume=True)
    spent = time.perf_counter() - begun
    return {"rows": rows, "s": spent, "cpu_s": _cpu_s() - mine, "mb": _peak_mb(), "before_mb": before}


def tabulated(folder: Path) -> dict[str, float]:
    """`rudc table` on a folder: s of wall and of processor time, MB."""
    begun = time.perf_counter()
    subprocess.run(
        [sys.executable, "-m", "rudc", "table", str(folder), "--format", "csv"],
        check=True,
        capture_output=True,
    )
    spent = time.perf_counter() - begun
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return {"s": spent, "cpu_s": used.ru_utime + used.ru_stime, "mb": used.ru_maxrss / 1e3}


def _rates(clock: Clock, begun: float) -> dict[str, float]:
    times = clock.times
    return {
        "first_s": times[0] - begun,
        "rate": (len(times) - 1) / (times[-1] - times[0]),
    }


def _cpu_s() -> float:
    used = resource.getrusage(resource.RUSAGE_SELF)
    return used.ru_utime + used.ru_stime


def _peak_mb() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3


def _row_bytes(folder: Path) -> float:
    data = (folder / "episodes.csv").read_bytes()
    head, *rows = data.splitlines(keepends=True)
    return (len(data) - len(head)) / len(rows)


def alone(deed: Callable[..., dict[str, float]], *arguments: object) -> dict[str, float]:
    """What a deed says, done in a process of its own."""
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as pool:
        found = pool.submit(deed, *arguments).result()
    told = ", ".join(f"{name} {value:.4g}" for name, value in found.items())
    print(f"{deed.__name__} {' '.join(str(a)[:30] for a in arguments[:3])}: {told}", flush=True)
    return found


def measured(asked: argparse.Namespace, folder: Path) -> dict[str, dict[str, float]]:
    """Everything, by what it is of."""
    engines = [name for name in ENGINES if name != "ray" or asked.ray]
    found = {
        f"{engine} {workers}": alone(driven, engine, workers, asked.episodes, folder / f"{engine}{workers}")
        for engine in engines
        for workers in (1, 2)
    }
    row = json.dumps(next(row for row in read_sweep(folder / "local1")[0] if not row["error"]))
    for engine in engines:
        found[f"stubs {engine}"] = alone(stubbed, engine, 2, asked.stubs, folder / f"stubs-{engine}", row)
    found["finished"] = alone(finished, asked.rows, folder / "finished", row)
    found["table"] = {"rows": asked.rows, **alone(tabulated, folder / "finished")}
    return found


def main() -> None:
    """Measure, and write what came out."""
    parser = argparse.ArgumentParser(description="How sweeps scale.")
    parser.add_argument("--out", type=Path, required=True, metavar="DIR")
    parser.add_argument("--episodes", type=int, default=160, help="real ones of each run")
    parser.add_argument("--stubs", type=int, default=20_000, help="episodes that take no time, of each run")
    parser.add_argument("--rows", type=int, default=1_000_000, help="of the sweep that is tabulated")
    asked = parser.parse_args()
    asked.ray = importlib.util.find_spec("ray") is not None
    load, _, _ = os.getloadavg()
    compile_kernels()
    with tempfile.TemporaryDirectory() as folder:
        found = measured(asked, Path(folder))
    write_page(asked.out, found, f"{processor()}, {os.cpu_count()} cores, load {load:.1f} when it began")


if __name__ == "__main__":
    from tests.benchmarks import scaling  # what workers unpickle has this name for them, too

    scaling.main()
