"""The ray engine: the same tasks on the actors of a ray cluster. Needs `pip install 'rudc[ray]'`.

The rows are those of the local engine; only who computes them differs. An actor that dies or takes too long
is replaced and its episode tried once more.
"""

from __future__ import annotations

import importlib
import time
from collections import deque
from collections.abc import Iterator, Sequence
from typing import Any

from rudc.errors import InputError
from rudc.evaluation.engine import TRIES, Result, Runner, RunnerFactory
from rudc.evaluation.record import EpisodeRecord
from rudc.evaluation.tasks import Task


class _Remote:
    """What lives in an actor."""

    def __init__(self, make_runner: RunnerFactory) -> None:
        self._run: Runner = make_runner()

    def run(self, task: Task) -> EpisodeRecord:
        return self._run(task)


def find_ray() -> Any:
    """The module `ray`. Raises InputError where it is not installed."""
    try:
        return importlib.import_module("ray")
    except ImportError:
        raise InputError("--engine ray needs ray, which is not installed: pip install 'rudc[ray]'") from None


def run_ray(
    tasks: Sequence[Task], workers: int, limit_s: float, make_runner: RunnerFactory
) -> Iterator[Result]:
    """Run the tasks on `workers` actors and yield each record as its episode ends. Raises InputError without
    ray.
    """
    ray = find_ray()
    ray.init(ignore_reinit_error=True, log_to_driver=False)
    remote = ray.remote(num_cpus=1)(_Remote)
    pending = deque((task, 1) for task in tasks)
    idle = [remote.remote(make_runner) for _ in range(min(workers, len(tasks)))]
    running: dict[Any, tuple[Any, Task, int, float]] = {}
    try:
        while pending or running:
            while idle and pending:
                actor, (task, attempt) = idle.pop(), pending.popleft()
                running[actor.run.remote(task)] = actor, task, attempt, time.monotonic()
            ended, _ = ray.wait(list(running), timeout=1.0)
            late = [ref for ref, job in running.items() if time.monotonic() - job[3] > limit_s]
            for reference in {*ended, *late}:
                actor, task, attempt, _ = running.pop(reference)
                try:
                    record = ray.get(reference, timeout=0.0)
                except Exception as error:  # ray's own: the actor died, or is late
                    ray.kill(actor)
                    idle.append(remote.remote(make_runner))
                    if attempt < TRIES:
                        pending.appendleft((task, attempt + 1))
                        continue
                    reason = f"the worker failed {TRIES} times: {type(error).__name__}: {error}"
                    record = EpisodeRecord.failed(task.scenario.name, task.agent, task.seed, reason)
                else:
                    idle.append(actor)
                yield task, record
    finally:
        ray.shutdown()
