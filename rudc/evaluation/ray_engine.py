"""The ray engine: the same tasks on the actors of a ray cluster. Needs the extra `ray`.

The rows are those of the local engine; only who computes them differs. An actor gets its first episode when
it says that it is there: a cluster with fewer cores than workers leaves the others waiting, for good or until
it grows.

Episodes travel in batches, since a call to an actor costs what a short episode takes: the first ones alone,
then as many as took `BATCH_S` so far. An actor that dies or takes too long is replaced, and the episodes
that it had are tried once more, each alone: so one that kills its actor takes no other with it. An actor
does not say when it has loaded what an episode needs, so every batch has the time for that, too.
"""

from __future__ import annotations

import importlib
import math
import os
import socket
import time
from collections import Counter, deque
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any, NamedTuple

from rudc.errors import InputError, SimulationError
from rudc.evaluation.compiled import compile_kernels
from rudc.evaluation.engine import START_FAILURES, START_LIMIT_S, TRIES, Result, Runner, RunnerFactory
from rudc.evaluation.memory import return_large_blocks
from rudc.evaluation.record import EpisodeRecord
from rudc.evaluation.tasks import Task
from rudc.hints import install_command

ANSWER_S = 8.0
"""s in which a cluster's address must answer"""
BATCH_S = 2.0
"""s that a batch should take"""
RECENT = 0.2
"""weight of the last batch in the mean length of an episode: scenarios and agents come one after another"""


class _Remote:
    """What lives in an actor."""

    def __init__(self, make_runner: RunnerFactory) -> None:
        return_large_blocks()
        self._run: Runner = make_runner()

    def ready(self) -> None:
        """Answered once the actor is there."""

    def run(self, tasks: Sequence[Task]) -> list[EpisodeRecord]:
        """A batch, in its order."""
        return [self._run(task) for task in tasks]


class _Batch(NamedTuple):
    """What an actor is doing."""

    actor: Any
    tasks: Sequence[Task]
    since: float
    """s, when it was given"""


def find_ray() -> Any:
    """The module `ray`. Raises InputError where it is not installed."""
    try:
        return importlib.import_module("ray")
    except ImportError:
        raise InputError(
            f"--engine ray needs ray, which is not installed: {install_command('ray')}"
        ) from None


@contextmanager
def connected() -> Iterator[Any]:
    """In the block, the module `ray`, connected to the cluster that RAY_ADDRESS names, or that is on this
    machine; a connection that was there before is used, and stays. Raises InputError, within 10 s, without
    ray or cluster.
    """
    ray = find_ray()
    _refuse_silent(os.environ.get("RAY_ADDRESS", ""))
    was_there = ray.is_initialized()
    try:
        if not was_there:
            ray.init(log_to_driver=False)
    except (ConnectionError, RuntimeError, ValueError) as error:
        raise InputError(f"--engine ray: no cluster ({error})") from error
    try:
        yield ray
    finally:
        if not was_there:
            ray.shutdown()


def _refuse_silent(address: str) -> None:
    """Raise InputError where nobody listens at `HOST:PORT`; ray itself would ask for a minute and more."""
    host, _, port = address.removeprefix("ray://").rpartition(":")
    if not (host and port.isdigit()):
        return
    try:
        socket.create_connection((host, int(port)), timeout=ANSWER_S).close()
    except (OSError, OverflowError, ValueError) as error:  # ValueError: digits that make no number
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
    with connected() as ray:
        compile_kernels()  # here, and not in each actor
        yield from _Actors(ray, tasks, limit_s, make_runner).run(min(workers, len(tasks)))


class _Actors:
    def __init__(self, ray: Any, tasks: Sequence[Task], limit_s: float, make_runner: RunnerFactory) -> None:
        self._ray = ray
        self._make = lambda: ray.remote(num_cpus=1)(_Remote).remote(make_runner)
        self._limit_s = limit_s
        self._pending = deque(tasks)
        self._failures: Counter[int] = Counter()
        """id of a task -> how often an actor failed that had it"""
        self._starting: dict[Any, Any] = {}
        """reference to an actor's message that it has started -> the actor"""
        self._running: dict[Any, _Batch] = {}
        """reference to records -> what is running"""
        self._failed_starts = 0
        self._episode_s = math.inf
        """s that an episode takes, the last batches counting most"""

    def run(self, workers: int) -> Iterator[Result]:
        for _ in range(workers):
            self._start()
        while self._pending or self._running:
            ended, others = self._ray.wait([*self._running, *self._starting], num_returns=1, timeout=1.0)
            if others:  # all that have ended meanwhile: asking costs as much for one as for a thousand
                ended += self._ray.wait(others, num_returns=len(others), timeout=0.0)[0]
            now = time.monotonic()
            late = [ref for ref, batch in self._running.items() if now > self._deadline(batch)]
            for reference in dict.fromkeys([*ended, *late]):
                if reference in self._starting:
                    self._welcome(reference)
                else:
                    yield from self._attend(reference)

    def _deadline(self, batch: _Batch) -> float:
        """When a batch is late: it may take all the time that loading and one episode have."""
        others_s = 2.0 * BATCH_S if len(batch.tasks) > 1 else 0.0
        return batch.since + START_LIMIT_S + self._limit_s + others_s

    def _start(self) -> None:
        actor = self._make()
        self._starting[actor.ready.remote()] = actor

    def _assign(self, actor: Any) -> None:
        """Give an actor a batch; where there is none left, its core may be what another waits for."""
        if tasks := self._next():
            self._running[actor.run.remote(tasks)] = _Batch(actor, tasks, time.monotonic())
        else:
            self._ray.kill(actor)

    def _next(self) -> list[Task]:
        """The next batch: at most half of an actor's fair share, so that all end at about the same time."""
        share = len(self._pending) // (2 * (len(self._running) + len(self._starting) + 1))
        size = max(1, min(share, int(BATCH_S / self._episode_s)))
        tasks = [self._pending.popleft() for _ in range(min(size, len(self._pending)))]
        alone = next((k for k, task in enumerate(tasks) if self._failures[id(task)]), None)
        if alone is not None:
            keep = max(alone, 1)
            self._pending.extendleft(reversed(tasks[keep:]))
            return tasks[:keep]
        return tasks

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

    def _attend(self, reference: Any) -> list[Result]:
        """Take records, or replace an actor that died or is late; its episodes are tried once more."""
        batch = self._running.pop(reference)
        spent = time.monotonic() - batch.since
        try:
            records = self._ray.get(reference, timeout=0.0)
        except Exception as error:  # ray's own: the actor died, or is late
            self._ray.kill(batch.actor)
            late = time.monotonic() > self._deadline(batch)
            told = f"no result within {self._limit_s:g} s, and {START_LIMIT_S:g} s to load what it needs"
            return self._again(batch.tasks, told if late else f"{type(error).__name__}: {error}")
        each = max(spent / len(records), 1e-6)
        known = each if math.isinf(self._episode_s) else self._episode_s
        self._episode_s = (1.0 - RECENT) * known + RECENT * each
        self._assign(batch.actor)
        return list(zip(batch.tasks, records, strict=True))

    def _again(self, tasks: Sequence[Task], reason: str) -> list[Result]:
        """Have tasks tried once more, by a new actor; the records of those that were tried often enough."""
        self._failures.update(map(id, tasks))
        given_up = [task for task in tasks if self._failures[id(task)] >= TRIES]
        self._pending.extendleft(task for task in reversed(tasks) if self._failures[id(task)] < TRIES)
        if self._pending:
            self._start()
        reason = f"the worker failed {TRIES} times: {reason}"
        return [(t, EpisodeRecord.failed(t.scenario.name, t.agent, t.seed, reason)) for t in given_up]
