"""The local engine: worker processes with a world each, fed one episode at a time.

Workers are no forks of this process: each starts clean (starting.py), without the parent's threads and
handlers and without a libsumo that is already in use.

    parent                                    worker
    starts it                            ->   makes its runner, says "ready"
    sends a task                         ->   loads what it needs, says "begins"
                                              runs it, sends the record back
    closes the pipe                      ->   ends; the pipe closes by itself when the parent dies

A worker that dies or takes too long for an episode is replaced, and its episode tried once more; then it is
recorded with its error. Workers ignore Ctrl-C and a terminal that closes: the parent decides.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import signal
import sys
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from pathlib import Path

from rudc.errors import SimulationError
from rudc.evaluation.memory import return_large_blocks
from rudc.evaluation.record import EpisodeRecord
from rudc.evaluation.starting import start
from rudc.evaluation.tasks import Task

Runner = Callable[[Task], EpisodeRecord]
RunnerFactory = Callable[[], Runner]
Result = tuple[Task, EpisodeRecord]

START_LIMIT_S = 120.0
"""s in which a worker must have started, and have loaded what an episode needs"""
LONGEST_WAIT_S = 3600.0
"""s, longest single wait: the system counts waits in ms, and takes at most 2^31 of them"""
BEGINS = "begins"
"""what a worker says when the episode itself starts: from here on its time counts"""
START_FAILURES = 3
"""workers in a row that may fail to start"""
TRIES = 2
"""how often an episode is tried whose worker dies or takes too long"""


@dataclass(eq=False)
class _Worker:
    """A worker process and what it is doing."""

    process: BaseProcess
    pipe: Connection
    ready: bool = False
    task: Task | None = None
    begun: bool = False
    """whether the episode itself runs; before, what it needs (agent, world) is loaded"""
    since: float = field(default_factory=time.monotonic)
    """s, when it was started, was given its task, or the episode began"""


def run_local(
    tasks: Sequence[Task], workers: int, limit_s: float, make_runner: RunnerFactory
) -> Iterator[Result]:
    """Run the tasks on worker processes and yield each record as its episode ends, in any order.

    Closing the iterator ends the workers. Raises SimulationError when no worker can be started.
    """
    with local_workers(min(workers, len(tasks)), limit_s, make_runner) as run:
        yield from run(tasks)


@contextlib.contextmanager
def local_workers(
    workers: int, limit_s: float, make_runner: RunnerFactory
) -> Iterator[Callable[[Sequence[Task]], Iterator[Result]]]:
    """Worker processes that stay until the block ends. The function that the block gets is called with one
    batch of tasks after another, and yields the results of each as `run_local` does.
    """
    pool = _Pool(workers, limit_s, make_runner)
    try:
        yield pool.run
    finally:
        pool.end()


class _Pool:
    def __init__(self, workers: int, limit_s: float, make_runner: RunnerFactory) -> None:
        self._size = workers
        self._pending: deque[Task] = deque()
        self._deaths: dict[int, int] = {}
        self._limit_s = limit_s
        self._make_runner = make_runner
        self._workers: list[_Worker] = []
        self._failed_starts = 0

    def run(self, tasks: Sequence[Task]) -> Iterator[Result]:
        self._pending.extend(tasks)
        self._deaths.clear()
        self._workers = self._workers or [self._start() for _ in range(self._size)]
        self._assign()
        while self._pending or any(worker.task for worker in self._workers):
            results: list[Result] = []
            failure: SimulationError | None = None
            for worker in self._await():
                try:
                    result = self._attend(worker)
                except SimulationError as error:
                    failure = error
                    continue
                if result is not None:
                    results.append(result)
            if failure is None:
                self._assign()  # before yielding: no worker waits while a row is written
            yield from results
            if failure is not None:  # after the episodes that have ended all the same
                raise failure

    def end(self) -> None:
        """End all workers: idle ones by closing their pipe, busy ones by a signal, stubborn ones by force."""
        for worker in self._workers:
            worker.pipe.close()
            if worker.task is not None or not worker.ready:
                worker.process.terminate()
        for worker in self._workers:
            worker.process.join(5.0)
            if worker.process.is_alive():
                worker.process.kill()
                worker.process.join()
        self._workers = []

    def _start(self) -> _Worker:
        ours, theirs = multiprocessing.Pipe()
        process = start(serve, theirs, self._make_runner)
        theirs.close()
        return _Worker(process, ours)

    def _assign(self) -> None:
        for worker in self._workers:
            if self._pending and worker.ready and worker.task is None:
                worker.task, worker.begun = self._pending.popleft(), False
                worker.since = time.monotonic()
                with contextlib.suppress(BrokenPipeError):  # it died just now: noticed when next awaited
                    worker.pipe.send(worker.task)

    def _await(self) -> list[_Worker]:
        """Workers that have something to say, have died, or have run out of time."""
        now = time.monotonic()
        active = [worker for worker in self._workers if worker.task is not None or not worker.ready]
        patience = min((self._deadline(worker) - now for worker in active), default=1.0)
        patience = min(max(patience, 0.0), LONGEST_WAIT_S)
        by_handle: dict[object, _Worker] = {}
        for worker in self._workers:
            by_handle[worker.pipe] = by_handle[worker.process.sentinel] = worker
        heard = wait(list(by_handle), patience)  # pyright: ignore[reportArgumentType] - handles of both kinds
        found = {id(by_handle[handle]): by_handle[handle] for handle in heard}
        late = [worker for worker in active if time.monotonic() > self._deadline(worker)]
        return list({**found, **{id(worker): worker for worker in late}}.values())

    def _deadline(self, worker: _Worker) -> float:
        return worker.since + (self._limit_s if worker.begun else START_LIMIT_S)

    def _attend(self, worker: _Worker) -> Result | None:
        try:
            message = worker.pipe.recv() if worker.pipe.poll() else None
        except (EOFError, OSError):
            return self._replace(worker, "")
        if message is None:
            if time.monotonic() > self._deadline(worker):
                late = f"no result within {self._limit_s:g} s"
                return self._replace(worker, late if worker.begun else f"not loaded in {START_LIMIT_S:g} s")
            return self._replace(worker, "") if not worker.process.is_alive() else None
        if isinstance(message, EpisodeRecord) and worker.task is not None:
            task, worker.task = worker.task, None
            return task, message
        if message == BEGINS:
            worker.begun, worker.since = True, time.monotonic()
            return None
        if message != "ready":
            raise SimulationError(f"a worker cannot start: {message}")
        worker.ready, self._failed_starts = True, 0
        return None

    def _replace(self, worker: _Worker, reason: str) -> Result | None:
        """Replace a dead or late worker; its episode is tried once more, or given up."""
        if not reason:
            worker.process.join(5.0)
        worker.process.kill()
        worker.process.join()
        worker.pipe.close()
        reason = reason or _cause(worker.process.exitcode)
        if not worker.ready:
            self._failed_starts += 1
            if self._failed_starts >= START_FAILURES:
                raise SimulationError(f"workers cannot start: {reason}{_guard()}")
        self._workers[self._workers.index(worker)] = self._start()
        task = worker.task
        if task is None:
            return None
        self._deaths[id(task)] = self._deaths.get(id(task), 0) + 1
        if self._deaths[id(task)] < TRIES:
            self._pending.appendleft(task)
            return None
        return task, EpisodeRecord.failed(
            task.scenario.name, task.agent, task.seed, f"the worker failed {TRIES} times: {reason}"
        )


def serve(pipe: Connection, make_runner: RunnerFactory) -> None:
    """What a worker process does. Ends when the pipe closes or at SIGTERM."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if hasattr(signal, "SIGHUP"):
        signal.signal(signal.SIGHUP, signal.SIG_IGN)
    return_large_blocks()
    with contextlib.suppress(_ToldToEnd):
        signal.signal(signal.SIGTERM, _end)
        _answer(pipe, make_runner)
        signal.signal(signal.SIGTERM, signal.SIG_DFL)


def _answer(pipe: Connection, make_runner: RunnerFactory) -> None:
    try:
        run = make_runner()
    except Exception as error:
        pipe.send(f"{type(error).__name__}: {error}")
        return
    pipe.send("ready")
    with contextlib.suppress(EOFError, BrokenPipeError, ConnectionResetError):
        while True:
            task = pipe.recv()
            getattr(run, "prepare", lambda _: None)(task)
            pipe.send(BEGINS)
            pipe.send(run(task))


class _ToldToEnd(BaseException):
    """Raised at SIGTERM, wherever the worker stands; unlike SystemExit, nobody takes it for a failure of an
    agent."""


def _end(*_: object) -> None:
    """Raise _ToldToEnd; a second SIGTERM changes nothing: a terminal's and the parent's may both come."""
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    raise _ToldToEnd


def _cause(exit_code: int | None) -> str:
    """Why a process ended, in words."""
    if exit_code is not None and exit_code < 0:
        name = (
            signal.Signals(-exit_code).name if -exit_code in set(signal.Signals) else f"signal {-exit_code}"
        )
        hint = " (out of memory?)" if name == "SIGKILL" else ""
        return f"it was ended by {name}{hint}"
    return f"it ended with exit code {exit_code}"


def _guard() -> str:
    """What a script that has no main guard is told: each worker imports it first."""
    main = sys.modules["__main__"]
    script = Path(str(getattr(main, "__file__", "")))
    if script.suffix != ".py" or "run_sweep" not in script.read_text(encoding="utf-8", errors="replace"):
        return ""
    return (
        f"; each imports {script.name} first: what it prints stands above. A script calls run_sweep under "
        "`if __name__ == '__main__':`"
    )
