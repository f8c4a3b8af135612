"""Runners for tests of sweeps: episodes that take no time or go wrong. Workers can import them."""

import os
import random
import signal
import sys
import time
from functools import partial
from pathlib import Path

from rudc.errors import SimulationError
from rudc.evaluation.record import EpisodeRecord
from rudc.evaluation.tasks import SweepPlan, Task
from rudc.imports import ask_own
from rudc.scenario import find_scenarios


def made_up(task: Task) -> EpisodeRecord:
    """A record that depends on the task only, timing apart."""
    rng = random.Random(repr((task.scenario.name, sorted(task.swept.items()), task.agent, task.seed)))
    outcome = rng.choice(["success", "success", "frozen", "collision"])
    collided = outcome == "collision"
    return EpisodeRecord(
        {
            "scenario": task.scenario.name,
            "agent": task.agent,
            "seed": task.seed,
            "outcome": outcome,
            "steps": rng.randrange(50, 400),
            "duration_s": round(rng.uniform(5, 40), 6),
            "route_completion": 1.0 if outcome == "success" else round(rng.random(), 6),
            "mean_speed_mps": round(rng.uniform(2, 9), 6),
            "episode_reward": round(rng.gauss(50, 40), 6),
            "min_dtc_m": round(rng.uniform(0, 4), 6),
            "interventions": rng.randrange(5),
            "mean_correction": round(rng.random(), 6),
            "infeasible_steps": 0,
            "decision_ms_mean": time.perf_counter() % 1,
            "decision_ms_max": time.perf_counter() % 2,
            "fault": rng.choice(["ego", "other"]) if collided else "",
            "origin": "south",
            "priority": rng.choice(["major", "minor"]),
        }
    )


class Runner:
    """Answers every task; `delay_s` makes it slow, even seeds more so: results come out of order."""

    def __init__(self, delay_s: float = 0.0) -> None:
        self._delay_s = delay_s

    def __call__(self, task: Task) -> EpisodeRecord:
        time.sleep(self._delay_s * (1.5 - task.seed % 2))
        return made_up(task)


class SlowToLoad(Runner):
    """Takes its time to load what an episode needs, not for the episode."""

    def prepare(self, task: Task) -> None:
        time.sleep(0.8)


class Troubled:
    """Goes wrong at seed 1: `die`, `die_once`, `told_to_end`, `exit`, `hang`, `fail`; answers all others."""

    def __init__(self, trouble: str, folder: Path) -> None:
        self._trouble = trouble
        self._mark = folder / "tried"

    def __call__(self, task: Task) -> EpisodeRecord:
        if task.seed == 1:
            first = not self._mark.exists()
            self._mark.touch()
            if self._trouble == "die" or (self._trouble == "die_once" and first):
                os.kill(os.getpid(), signal.SIGKILL)
            if self._trouble == "told_to_end":
                ask_own("agent mine", 0.0, "act", lambda: os.kill(os.getpid(), signal.SIGTERM))
            if self._trouble == "exit":
                os._exit(7)
            if self._trouble == "hang":
                time.sleep(60.0)
            if self._trouble == "fail":
                return EpisodeRecord.failed(task.scenario.name, task.agent, 1, "SUMO\nfailed,  badly")
        return made_up(task)


def no_runner() -> Runner:
    """A worker that cannot start."""
    raise SimulationError("libsumo cannot be imported")


def dead_on_arrival() -> Runner:
    """A worker that dies while it starts."""
    os._exit(3)


def slow_plan() -> SweepPlan:
    """What `main` sweeps."""
    return SweepPlan(tuple(find_scenarios(["density_sweep"])), ("sumo", "follower"), 4, 10)


def main() -> None:
    """Run a slow sweep, as something to kill. Arguments: folder, delay (s), workers."""
    from rudc.evaluation import starting
    from rudc.evaluation.sweep import run_sweep

    starting.PRELOADED = "rudc.evaluation.engine"  # these runners need no kernels, which take long to load
    make_runner = partial(Runner, float(sys.argv[2]))
    run_sweep(slow_plan(), Path(sys.argv[1]), make_runner, workers=int(sys.argv[3]), resume=True)


if __name__ == "__main__":
    main()
