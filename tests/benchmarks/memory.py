"""What a sweep's worker holds in memory, and whether it grows.

    python -m tests.benchmarks.memory [--episodes N] [--agent NAME] [--timeout S] [--ordered]

One process does what a worker does, over episodes of all shipped scenarios on all shipped networks (where a
scenario fits), cut off after a few seconds. They come in random order, so that nearly every episode needs
another network, and with it a new world; `--ordered` has them come as in a sweep. A target, from the issue:
below 400 MB, and no growth over 2,000 episodes.
"""

from __future__ import annotations

import argparse
import contextlib
import time
from pathlib import Path

import numpy as np

from rudc.errors import ScenarioError
from rudc.evaluation.memory import return_large_blocks
from rudc.evaluation.preflight import try_out
from rudc.evaluation.runner import EpisodeRunner
from rudc.evaluation.tasks import Task
from rudc.network.network import shipped_networks
from rudc.scenario import Scenario, load_scenario, shipped_scenarios
from rudc.world.fitting import misfits


def resident_mb() -> float:
    """MB this process holds in memory."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * 4096 / 1e6


def mixture(timeout_s: float) -> list[Scenario]:
    """Every shipped scenario on every shipped network that it fits."""
    found = []
    for name in shipped_scenarios():
        for network in shipped_networks():
            changes = {"network": network, "episode.timeout": timeout_s}
            with contextlib.suppress(ScenarioError):  # it names a lane that is not there, say
                scenario = load_scenario(name, changes, misfits)
                if not try_out(scenario):
                    found.append(scenario)
    return found


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--episodes", type=int, default=2000)
    parser.add_argument("--agent", default="gap-acceptance+ttcbf")
    parser.add_argument("--timeout", type=float, default=3.0, help="s of each episode")
    parser.add_argument("--ordered", action="store_true", help="scenario by scenario, as in a sweep")
    asked = parser.parse_args()
    return_large_blocks()
    scenarios = mixture(asked.timeout)
    kinds = np.arange(asked.episodes) * len(scenarios) // asked.episodes
    if not asked.ordered:
        kinds = np.random.default_rng(0).permutation(kinds)
    networks = {scenario.network for scenario in scenarios}
    print(f"{len(scenarios)} pairs of a scenario and one of {len(networks)} networks", flush=True)
    run = EpisodeRunner()
    marks = sorted({max(round(asked.episodes * k / 8), 1) for k in range(9)})
    start, failed = time.perf_counter(), 0
    for number, kind in enumerate(kinds, 1):
        record = run(Task(scenarios[kind], {}, asked.agent, number))
        failed += bool(record.error)
        if number in marks:
            spent = time.perf_counter() - start
            print(f"{number:5d} episodes: {resident_mb():.0f} MB, {spent:.0f} s", flush=True)
    run.close()
    print(f"{failed} of them failed")


if __name__ == "__main__":
    main()
