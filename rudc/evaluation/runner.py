"""Runs tasks one after another in one process, and keeps its world while the network stays the same."""

from __future__ import annotations

import contextlib
import os
import signal
import threading
import traceback
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from types import FrameType

from rudc.agents.base import Agent, layers
from rudc.agents.guarded import GuardedAgent
from rudc.agents.own_files import changed_files, read_late
from rudc.agents.registry import make_agent
from rudc.env.episode import Episode
from rudc.errors import AgentError, AgentFailedError, PartFailedError, RudcError
from rudc.evaluation.compiled import compile_kernels
from rudc.evaluation.manifest import agent_digest
from rudc.evaluation.record import EpisodeRecord
from rudc.evaluation.rollout import Watcher, run_episode
from rudc.evaluation.tasks import Task
from rudc.imports import in_words
from rudc.network.network import load_network
from rudc.world.world import World

SOONER = 0.95
"""share of the time limit after which an episode is stopped, and its error says where it was; a worker that
does not stop is killed at the limit, and then nobody learns where it was"""


class EpisodeRunner:
    """Task -> record. Whatever goes wrong in an episode becomes the `error` of its record."""

    def __init__(
        self,
        limit_s: float | None = None,
        folder: Path | None = None,
        watch: Callable[[Episode, Agent], Watcher] | None = None,
    ) -> None:
        """`limit_s`: s of wall time after which an episode is given up, wherever it stands. `folder`: what
        relative paths in agents' names are relative to, should this process have been started elsewhere.
        `watch`: an episode and its agent -> who is shown its decisions.
        """
        compile_kernels()
        if folder is not None and folder.is_dir():
            os.chdir(folder)
        self._limit_s = limit_s
        self._watch = watch
        self._world: World | None = None
        self._network: tuple[str, str | None] | None = None
        self._agents: dict[str, Agent] = {}

    def __call__(self, task: Task) -> EpisodeRecord:
        """Run the task's episode."""
        try:
            return self._run(task)
        except _OutOfTime as error:
            place = traceback.extract_tb(error.__traceback__)[-2]  # the last is where it was raised, `stop`
            where = f"{Path(place.filename).name}:{place.lineno}, in {place.name}"
            reason, told = f"no result within {self._limit_s:g} s; it was at {where}", _lines(error)
        except RudcError as error:
            reason, told = str(error), ""
            if isinstance(error, PartFailedError):
                told = _lines(error.__cause__ or error)
        except Exception as error:  # a defect of ours: the other episodes go on
            reason, told = in_words(error), _lines(error)
        self.close()
        return EpisodeRecord.failed(task.scenario.name, task.agent, task.seed, reason, told)

    def prepare(self, task: Task) -> None:
        """Load what the task needs, which does not count as its time; errors are reported when it is run."""
        with contextlib.suppress(Exception):
            self._load(task)

    def _load(self, task: Task) -> tuple[Agent, World]:
        if task.agent not in self._agents:
            agent = make_agent(task.agent)
            if task.agent_digest not in ("", agent_digest(task.agent)):
                raise AgentError(
                    f"agent {task.agent} is no longer what it was when the sweep began: a file of it was "
                    "replaced; put it back and --resume, or give another --out"
                )
            for own in (layer for layer in layers(agent) if isinstance(layer, GuardedAgent)):
                if task.agent_digest:
                    _hold_to(own, task.agent_reads)
                    break  # what others that it wraps open is among it
            self._agents[task.agent] = agent
        return self._agents[task.agent], self._world_of(task)

    def _run(self, task: Task) -> EpisodeRecord:
        agent, world = self._load(task)
        episode = Episode(world)
        with _time_limit(None if self._limit_s is None else SOONER * self._limit_s):
            watch = None if self._watch is None else self._watch(episode, agent)
            return run_episode(episode, task.scenario.plan(task.seed), agent, watch=watch)

    def close(self) -> None:
        """Forget everything; the next task starts afresh."""
        self._end_world()
        self._agents.clear()

    def _end_world(self) -> None:
        if self._world is not None:
            self._world.close()
        self._world = self._network = None

    def _world_of(self, task: Task) -> World:
        wanted = (task.scenario.network, task.scenario.junction)
        if self._world is None or self._network != wanted:
            network = load_network(*wanted)
            self._end_world()
            self._world, self._network = World(network), wanted
        return self._world


def _hold_to(agent: GuardedAgent, recorded: Mapping[str, str]) -> None:
    """Have an agent read only what a sweep's manifest records (name -> digest). Raises AgentError where a
    file has changed since, and AgentFailedError where it has opened one too late.
    """
    if agent.name in read_late:
        raise AgentFailedError(read_late[agent.name])
    if changed := changed_files(agent.name, recorded):
        raise AgentError(
            f"agent {agent.name} is no longer what it was when the sweep began: {changed[0]} has changed; "
            "put it back and --resume, or give another --out"
        )
    agent.recorded = frozenset(recorded)


class _OutOfTime(BaseException):
    """Raised wherever an episode stands when its time is up; no agent's `except Exception` stops it."""


@contextmanager
def _time_limit(limit_s: float | None) -> Iterator[None]:
    """Raise _OutOfTime in the block after limit_s of wall time, if this thread can receive signals."""
    main = threading.current_thread() is threading.main_thread()
    if limit_s is None or not main or not hasattr(signal, "setitimer"):
        yield
        return

    def stop(_number: int, _frame: FrameType | None) -> None:
        raise _OutOfTime

    before = signal.signal(signal.SIGALRM, stop)
    signal.setitimer(signal.ITIMER_REAL, limit_s)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


def _lines(error: BaseException) -> str:
    return "".join(traceback.format_exception(error))
