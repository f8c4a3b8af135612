"""`make soak`: thousands of episodes through the local engine. Do memory, speed and open files stay flat?

    python -m tests.benchmarks.soak [--share 0.02] [--workers 2] [--timeout S] [--agent NAME ...]

20,000 episodes of every shipped scenario on every shipped network that it fits, driven by the learnt agents,
in random order: nearly every one needs another network, and with it a new world, and often another agent.
Each is cut off after a few seconds. At 1, 10, 20, ..., 100 % the driver and its workers are looked at.
Flat means, from 10 to 100 %: no process grows by more than `GROWTH_MB`; none has more files open; no worker
was replaced; and a second of processor time gives as many decisions in the second half as in the first, up to
`SLOWER`. Exit status 1 where something is not flat, or an episode failed.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import closing
from pathlib import Path
from typing import NamedTuple

import numpy as np

from rudc.agents.checkpoint import shipped_checkpoints
from rudc.evaluation.columns import COLUMNS
from rudc.evaluation.compiled import compile_kernels
from rudc.evaluation.engine import run_local
from rudc.evaluation.runner import EpisodeRunner
from rudc.evaluation.store import RowFile
from rudc.evaluation.sweep import prepared
from rudc.evaluation.tasks import Task
from tests.benchmarks.memory import mixture

EPISODES = 20_000
GROWTH_MB = 25.0
"""between 10 and 100 %: tables of routes and agents that are met late included"""
SLOWER = 0.8
"""least ratio of the second half's decisions a second of processor time to the first's"""


class Look(NamedTuple):
    """The processes after some episodes."""

    episodes: int
    decisions: int
    memory_mb: dict[int, float]
    """process -> resident size; the driver first"""
    files: dict[int, int]
    """process -> open file handles"""
    workers_s: float
    """processor time of the workers so far"""


def look(episodes: int, decisions: int) -> Look:
    """At this process and its workers."""
    me = os.getpid()
    servers = [pid for pid in _children(me) if b"forkserver" in Path(f"/proc/{pid}/cmdline").read_bytes()]
    workers = sorted(worker for server in servers for worker in _children(server))
    pages = {pid: int(Path(f"/proc/{pid}/statm").read_text().split()[1]) for pid in (me, *workers)}
    return Look(
        episodes,
        decisions,
        {pid: 4096e-6 * count for pid, count in pages.items()},
        {pid: len(os.listdir(f"/proc/{pid}/fd")) for pid in (me, *workers)},
        sum(_cpu_s(pid) for pid in workers),
    )


def _children(pid: int) -> list[int]:
    tasks = Path(f"/proc/{pid}/task").iterdir()
    return [int(child) for task in tasks for child in (task / "children").read_text().split()]


def _cpu_s(pid: int) -> float:
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def not_flat(looks: Sequence[Look]) -> Iterator[str]:
    """What is not, in words; `looks` from 10 % on."""
    first, middle, last = looks[0], looks[len(looks) // 2], looks[-1]
    if len(last.memory_mb) < 2:
        yield "no worker was found"
        return
    if first.memory_mb.keys() != last.memory_mb.keys():
        yield "a worker was replaced"
        return
    for name, pid in zip(("driver", *(f"worker {k}" for k in range(1, 99))), first.memory_mb, strict=False):
        grown = last.memory_mb[pid] - first.memory_mb[pid]
        if grown > GROWTH_MB:
            yield f"{name} grew by {grown:.0f} MB"
        if last.files[pid] > first.files[pid]:
            yield f"{name} has {last.files[pid]} files open, {first.files[pid]} before"
    early, late = _rate(first, middle), _rate(middle, last)
    if late < SLOWER * early:
        yield f"{late:.0f} decisions a second of processor time, {early:.0f} before"


def _rate(one: Look, other: Look) -> float:
    return (other.decisions - one.decisions) / max(other.workers_s - one.workers_s, 1e-9)


def shuffled(episodes: int, agents: Sequence[str], timeout_s: float) -> list[Task]:
    """That many tasks in random order, the same ones each time."""
    scenarios, rng = mixture(timeout_s), np.random.default_rng(0)
    print(f"{len(scenarios)} pairs of a scenario and a network, {len(agents)} agents", flush=True)
    kinds = rng.permutation(np.arange(episodes) % len(scenarios))
    drivers = rng.integers(len(agents), size=episodes)
    return [
        Task(scenarios[kind], {}, agents[who], k)
        for k, (kind, who) in enumerate(zip(kinds, drivers, strict=True))
    ]


def main() -> int:
    """Run them; the exit status."""
    parser = argparse.ArgumentParser(description="Do memory, speed and open files stay flat?")
    parser.add_argument("--share", type=float, default=1.0, help=f"of {EPISODES} episodes")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--timeout", type=float, default=3.0, help="s of each episode")
    parser.add_argument("--agent", action="append", help="repeat for several; the learnt agents by default")
    asked = parser.parse_args()
    episodes = max(round(asked.share * EPISODES), 20)
    tasks = shuffled(episodes, asked.agent or list(shipped_checkpoints()), asked.timeout)
    compile_kernels()
    marks = {max(episodes // 100, 1), *(episodes * tenth // 10 for tenth in range(1, 11))}
    looks, decisions, failed = [], 0, 0
    with tempfile.TemporaryDirectory() as folder:
        rows = RowFile(Path(folder) / "episodes.csv", list(COLUMNS))
        rows.rewrite([])
        make_runner = prepared(EpisodeRunner, {task.agent for task in tasks})
        with closing(run_local(tasks, asked.workers, 300.0, make_runner)) as results:  # pyright: ignore
            for number, (task, record) in enumerate(results, 1):
                rows.append(record.row())
                failed += bool(record.error)
                decisions += 0 if record.error else int(record.number("steps"))
                if record.error:
                    print(f"failed: {task}: {record.error}", flush=True)
                if number in marks:
                    looks.append(look(number, decisions))
                    _say(looks, episodes)
        rows.close()
    found = [*([f"{failed} episodes failed"] if failed else []), *not_flat(looks[1:])]
    print("\n".join(f"not flat: {what}" for what in found) or "flat")
    return int(bool(found))


def _say(looks: Sequence[Look], episodes: int) -> None:
    last = looks[-1]
    memory = " ".join(f"{size:.0f}" for size in last.memory_mb.values())
    rate = f", {_rate(looks[-2], last):.0f} decisions/s of processor time" if len(looks) > 1 else ""
    files = " ".join(map(str, last.files.values()))
    share = 100 * last.episodes // episodes
    print(
        f"{share:3d} %, {last.episodes} episodes: driver and workers {memory} MB, {files} files{rate}",
        flush=True,
    )


if __name__ == "__main__":
    sys.exit(main())
