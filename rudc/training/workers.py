"""Worker processes, one `Collector` each, that work while the learner learns.

They start clean (rudc/evaluation/starting.py), since torch's threads do not survive a fork, and need no torch
themselves. They ignore Ctrl-C and other signals that tell all processes to end: the main process ends them.
If a worker dies, the training ends with a message.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import signal
import traceback
from collections.abc import Mapping, Sequence
from multiprocessing.connection import Connection
from typing import Any

from rudc.agents.route_sigma import Heard
from rudc.errors import RudcError, TrainingError
from rudc.evaluation.record import EpisodeRecord
from rudc.evaluation.starting import start
from rudc.imports import Carried
from rudc.training.collect import By, Collected, Collector
from rudc.training.config import TrainConfig

Percentiles = tuple[float, float] | None


class WorkerPool:
    """`config.envs` workers; requests go to all of them, answers come in their order."""

    def __init__(self, config: TrainConfig) -> None:
        self._share = config.training.round_decisions
        self._workers: list[tuple[Any, Connection]] = []
        self._critics = bool(config.correction.asks)
        try:
            for index in range(config.training.envs):
                ours, theirs = multiprocessing.Pipe()
                process = start(_work, theirs, Carried(config), index, name=f"rudc-worker-{index}")
                theirs.close()
                self._workers.append((process, ours))
            self._answers()
        except BaseException:  # this process waits for them at its end, and they ignore SIGTERM
            self.close()
            raise

    def load(self, arrays: Mapping[str, Any], percentiles: Percentiles, *, critics: bool = False) -> None:
        """Give all workers these weights and percentiles of sigma; critics only where the correction asks
        them, or with `critics`.
        """
        critics = critics or self._critics
        wanted = {k: v for k, v in arrays.items() if critics or k.startswith("policy/")}
        self._ask([("load", (wanted, percentiles))] * len(self._workers))
        self._answers()

    def start(self, round_: int, by: By, *, drop: bool) -> None:
        """Let all workers collect a round; `finish` fetches what they got."""
        self._ask([("collect", (round_, self._share, by, drop))] * len(self._workers))

    def finish(self) -> list[Collected]:
        """What each worker collected."""
        return self._answers()

    def evaluate(self, tasks: Sequence[tuple[str, int]]) -> list[EpisodeRecord]:
        """Drive held-out episodes (scenario, seed); records in the order of the tasks, of those that could be
        set up and driven to their end.
        """
        return self._shared("evaluate", tasks)

    def hear(self, tasks: Sequence[tuple[str, int]]) -> list[Heard]:
        """The sigmas that the agent states in held-out episodes (scenario, seed), likewise."""
        return self._shared("hear", tasks)

    def _shared(self, request: str, tasks: Sequence[tuple[str, int]]) -> list[Any]:
        count = len(self._workers)
        self._ask([(request, (tuple(tasks[index::count]),)) for index in range(count)])
        parts = self._answers()
        answers = (parts[k % count][k // count] for k in range(len(tasks)))
        return [answer for answer in answers if answer is not None]

    def close(self) -> None:
        """End the workers."""
        for _, pipe in self._workers:
            with contextlib.suppress(OSError):
                pipe.send(None)
            pipe.close()
        for process, _ in self._workers:
            process.join(timeout=5.0)
            if process.is_alive():
                process.kill()
                process.join()

    def _ask(self, requests: Sequence[tuple[str, tuple[Any, ...]]]) -> None:
        for (process, pipe), request in zip(self._workers, requests, strict=True):
            try:
                pipe.send(request)
            except OSError:
                raise TrainingError(f"{process.name} has died (exit code {process.exitcode})") from None

    def _answers(self) -> list[Any]:
        results = []
        for process, pipe in self._workers:
            try:
                answer = pipe.recv()
            except (EOFError, OSError):
                process.join(timeout=1.0)
                raise TrainingError(f"{process.name} has died (exit code {process.exitcode})") from None
            if isinstance(answer, _Failure):
                raise TrainingError(f"{process.name}: {answer.reason}")
            results.append(answer)
        return results


class _Failure:
    """An answer that says why there is none."""

    def __init__(self, reason: str) -> None:
        self.reason = reason


def _work(pipe: Connection, config: TrainConfig, index: int) -> None:
    """What a worker process does, until it is told to end or the main process is gone."""
    for name in ("SIGTERM", "SIGHUP"):  # the main process gets these as well
        if hasattr(signal, name):  # no SIGHUP on Windows
            signal.signal(getattr(signal, name), signal.SIG_IGN)
    with contextlib.suppress(EOFError, BrokenPipeError, ConnectionResetError):
        try:
            collector = Collector(config, index)
            pipe.send("ready")
            while (request := pipe.recv()) is not None:
                pipe.send(_answer(collector, *request))
            collector.close()
        except (EOFError, OSError):
            raise
        except RudcError as error:
            pipe.send(_Failure(str(error)))
        except Exception as error:  # a defect of ours: the traceback says where
            pipe.send(_Failure(f"{type(error).__name__}: {error}\n{traceback.format_exc()}"))


def _answer(collector: Collector, request: str, arguments: tuple[Any, ...]) -> Any:
    if request == "load":
        return collector.load(*arguments)
    if request == "evaluate":
        return collector.evaluate(*arguments)
    if request == "hear":
        return collector.hear(*arguments)
    round_, decisions, by, drop = arguments
    return collector.collect(round_, decisions, by, drop=drop)
