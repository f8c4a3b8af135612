"""Whether a sweep's rows depend on anything but its inputs.

    python -m tests.benchmarks.determinism [--rows 500] [--each] [--ray] [--agent NAME ...] [--out DIR]

Every learnt agent drives episodes of several scenarios, as many rows as asked for. The sweep runs twice. Once
plainly: one worker, in the order of the names. Once with all changed that rows must not depend on:
two workers, scenarios and agents in the opposite order, another hash seed, locale, time zone and number of
threads, ended by SIGKILL halfway and resumed. `--each` changes one thing at a time instead, to find which;
`--ray` runs the sweep on a ray cluster, too. Exit status 1 where any row differs, timing columns apart.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from rudc.agents.checkpoint import shipped_checkpoints
from rudc.evaluation.columns import IDENTITY, TIMING
from rudc.evaluation.folder import read_sweep

SCENARIOS = ("random_destination", "dense_left_turn", "perfect_storm", "jaywalkers", "roundabout_crossing")
SHOWN = 10
"""differences shown"""


@dataclass(frozen=True)
class Way:
    """How a sweep is run."""

    environment: Mapping[str, str] = field(default_factory=dict)
    workers: int = 1
    backwards: bool = False
    """scenarios and agents in the opposite order"""
    killed: bool = False
    """once, halfway, and resumed"""
    engine: str = "local"


PLAIN = Way({"PYTHONHASHSEED": "1", "LC_ALL": "C", "TZ": "UTC", "OMP_NUM_THREADS": "1"})
CHANGES = {
    "two workers": Way(workers=2),
    "the opposite order": Way(backwards=True),
    "another hash seed": Way({"PYTHONHASHSEED": "4711"}),
    "another locale": Way({"LC_ALL": "de_DE.UTF-8", "LANG": "de_DE.UTF-8"}),
    "another time zone": Way({"TZ": "Asia/Kathmandu"}),
    "more threads": Way({"OMP_NUM_THREADS": "4", "OPENBLAS_NUM_THREADS": "4", "NUMBA_NUM_THREADS": "2"}),
    "a kill and a resumption": Way(killed=True),
}
EVERYTHING = Way(
    {name: value for way in CHANGES.values() for name, value in way.environment.items()}, 2, True, True
)


Rows = dict[tuple[str, ...], list[str]]
"""identity of an episode -> its row, timing left out"""


def order(way: Way, out: Path, agents: Sequence[str], episodes: int, timeout_s: float) -> list[str]:
    """What `rudc` is told for a sweep in a way."""
    step = -1 if way.backwards else 1
    command = ["sweep", *SCENARIOS[::step]]
    command += [word for agent in agents[::step] for word in ("--agent", agent)]
    command += ["--episodes", str(episodes), "--workers", str(way.workers), "--engine", way.engine]
    return [*command, "--set", f"episode.timeout={timeout_s:g}", "--quiet", "--resume", "--out", str(out)]


def swept(way: Way, out: Path, agents: Sequence[str], episodes: int, timeout_s: float) -> Rows:
    """Run the sweep in a way, in processes of its own."""
    command = [sys.executable, "-m", "rudc", *order(way, out, agents, episodes, timeout_s)]
    environment = {**os.environ, **PLAIN.environment, **way.environment}
    if way.killed:
        _killed_halfway(command, environment, out, len(SCENARIOS) * len(agents) * episodes // 2)
    done = subprocess.run(command, env=environment, capture_output=True, text=True)
    if done.returncode != 0:
        raise SystemExit(done.stderr)
    return rows_of(out)


def rows_of(out: Path) -> Rows:
    """Of a sweep that was run."""
    rows, _ = read_sweep(out)
    return {
        tuple(row[name] for name in IDENTITY): [text for name, text in row.items() if name not in TIMING]
        for row in rows
    }


def _killed_halfway(command: Sequence[str], environment: Mapping[str, str], out: Path, enough: int) -> None:
    quiet = subprocess.DEVNULL
    process = subprocess.Popen(command, env=environment, stdout=quiet, stderr=quiet)
    rows = out / "episodes.csv"
    while process.poll() is None and not (rows.exists() and rows.read_bytes().count(b"\n") > enough):
        time.sleep(0.05)
    process.kill()
    process.wait()


def main() -> int:
    """Compare; the exit status."""
    parser = argparse.ArgumentParser(description="Do rows depend on anything but their inputs?")
    parser.add_argument("--rows", type=int, default=500)
    parser.add_argument("--each", action="store_true", help="one change at a time")
    parser.add_argument("--ray", action="store_true", help="on a ray cluster, too")
    parser.add_argument("--agent", action="append", help="repeat for several; every learnt one by default")
    parser.add_argument("--timeout", type=float, default=40.0, help="s of each episode")
    parser.add_argument("--out", type=Path, help="folder in which the sweeps are kept")
    asked = parser.parse_args()
    agents = asked.agent or list(shipped_checkpoints())
    episodes = -(-asked.rows // (len(SCENARIOS) * len(agents)))
    ways = dict(CHANGES) if asked.each else {"everything else": EVERYTHING}
    if asked.ray:
        ways["ray"] = Way(engine="ray", workers=2)
    with tempfile.TemporaryDirectory() as temporary:
        out = asked.out or Path(temporary)
        wanted = swept(PLAIN, out / "plain", agents, episodes, asked.timeout)
        print(
            f"{len(wanted)} rows: {len(SCENARIOS)} scenarios, {len(agents)} agents, {episodes} seeds",
            flush=True,
        )
        wrong = 0
        for name, way in ways.items():
            found = swept(way, out / name.replace(" ", "_"), agents, episodes, asked.timeout)
            other = [key for key in wanted if found.get(key) != wanted[key]]
            print(f"{name}: {len(other)} of {len(wanted)} rows differ", flush=True)
            for key in other[:SHOWN]:
                print(f"  {' '.join(key)}:\n    {wanted[key]}\n    {found.get(key)}")
            wrong += len(other) + (found.keys() != wanted.keys())
    return int(bool(wrong))


if __name__ == "__main__":
    sys.exit(main())
