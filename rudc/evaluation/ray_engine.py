"""The ray engine: the same tasks on the actors of a ray cluster. Needs the extra `ray`.

The rows are those of the local engine; only who computes them differs. An actor gets its first episode when
it says that it is there: a cluster with fewer cores than workers leaves the others waiting, for good or until
it grows. An actor that dies or takes too long is replaced and its episode tried once more.
"""

from __future__ import annotations

import importlib
import os
import socket
import time
from collections import deque
from collections.abc import Iterator, Sequence
from typing import Any

from rudc.errors import InputError, SimulationError
from rudc.evaluation.engine import START_FAILURES, TRIES, Result, Runner, RunnerFactory
from rudc.evaluation.record import EpisodeRecord
from rudc.evaluation.tasks import Task
from rudc.hints import install_command

ANSWER_S = 8.0
"""s in which a cluster's address must answer"""


class _Remote:
    """What lives in an actor."""

    def __init__(self, make_runner: RunnerFactory) -> None:
        self._run: Runner = make_runner()

    def ready(self) -> None:
        """Answered once the actor is there."""

    def run(self, task: Task) -> EpisodeRecord:
        return self._run(task)


def find_ray() -> Any:
    """The module `ray`. Raises InputError where it is not installed."""
    try:
        return importlib.import_module("ray")
    except ImportError:
        raise InputError(
            f"--engine ray needs ray, which is not installed: {install_command('ray')}"
        ) from None


def connect() -> Any:
    """The module `ray`, connected to the cluster that RAY_ADDRESS names, or that is on this machine; another
    call does nothing more. Raises InputError, within 10 s, without ray or cluster.
    """
    ray = find_ray()
    _refuse_silent(os.environ.get("RAY_ADDRESS", ""))
    try:
        ray.init(ignore_reinit_error=True, log_to_driver=False)
    except (ConnectionError, RuntimeError, ValueError) as error:
        raise InputError(f"--engine ray: no cluster ({error})") from error
    return ray


def _refuse_silent(address: str) -> None:
    """Raise InputError where nobody listens at `HOST:PORT`; ray itself would ask for a minute and more."""
    host, _, port = address.removeprefix("ray://").rpartition(":")
    if not (host and port.isdigit()):
        return
    try:
        socket.create_connection((host, int(port)), timeout=ANSWER_S).close()
    except (OSError, OverflowError) as error:
        raise InputError(
            f"--engine ray: no cluster at RAY_ADDRESS={address} ({error}); `ray start --head` starts one, "
            "or unset RAY_ADDRESS"
        ) from None


def run_ray(
    tasks: Sequence[Task], workers: int, limit_s: float, make_runner: RunnerFactory
) -> Iterator[Result]:
    """Run the tasks on at most `workers` actors and yield each record as its episode ends. Raises InputError
    without ray or cluster, SimulationError when no actor can be started.
    """
    ray = connect()
    try:
        yield from _Actors(ray, tasks, limit_s, make_runner).run(min(workers, len(tasks)))
    finally:
        ray.shutdown()


class _Actors:
    def __init__(self, ray: Any, tasks: Sequence[Task], limit_s: float, make_runner: RunnerFactory) -> None:
        self._ray = ray
        self._make = lambda: ray.remote(num_cpus=1)(_Remote).remote(make_runner)
        self._limit_s = limit_s
        self._pending = deque((task, 1) for task in tasks)
        self._starting: dict[Any, Any] = {}
        """reference to an actor's word that it is there -> the actor"""
        self._running: dict[Any, tuple[Any, Task, int, float]] = {}
        """reference to a record -> actor, task, which try it is, s when it was given"""
        self._failed_starts = 0

    def run(self, workers: int) -> Iterator[Result]:
        for _ in range(workers):
            self._start()
        while self._pending or self._running:
            ended, _ = self._ray.wait([*self._running, *self._starting], timeout=1.0)
            now = time.monotonic()
            late = [ref for ref, job in self._running.items() if now - job[3] > self._limit_s]
            for reference in {*ended, *late}:
                if reference in self._starting:
                    self._welcome(reference)
                elif result := self._attend(reference):
                    yield result

    def _start(self) -> None:
        actor = self._make()
        self._starting[actor.ready.remote()] = actor

    def _assign(self, actor: Any) -> None:
        if self._pending:
            task, attempt = self._pending.popleft()
            self._running[actor.run.remote(task)] = actor, task, attempt, time.monotonic()

    def _welcome(self, reference: Any) -> None:
        """Give an actor that has started its first task; start another if it could not."""
        actor = self._starting.pop(reference)
        try:
            self._ray.get(reference, timeout=0.0)
        except Exception as error:  # ray's own, with what was raised in the actor
            self._failed_starts += 1
            if self._failed_starts >= START_FAILURES:
                raise SimulationError(f"workers cannot start: {error}") from None
            self._start()
        else:
            self._failed_starts = 0
            self._assign(actor)

    def _attend(self, reference: Any) -> Result | None:
        """Take a record, or replace an actor that died or is late; its episode is tried once more."""
        actor, task, attempt, since = self._running.pop(reference)
        try:
            record = self._ray.get(reference, timeout=0.0)
        except Exception as error:  # ray's own: the actor died, or is late
            self._ray.kill(actor)
            late = time.monotonic() - since > self._limit_s
            reason = f"no result within {self._limit_s:g} s" if late else f"{type(error).__name__}: {error}"
            again = attempt < TRIES
            if again:
                self._pending.appendleft((task, attempt + 1))
            if self._pending:
                self._start()
            reason = f"the worker failed {TRIES} times: {reason}"
            name, agent, seed = task.scenario.name, task.agent, task.seed
            return None if again else (task, EpisodeRecord.failed(name, agent, seed, reason))
        self._assign(actor)
        return task, record
