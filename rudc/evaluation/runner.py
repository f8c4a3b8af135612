"""Runs tasks one after another in one process, and keeps its world while the network stays the same."""

from __future__ import annotations

import traceback
from collections.abc import Callable
from pathlib import Path

from rudc.agents.base import Agent
from rudc.agents.registry import make_agent
from rudc.env.episode import Episode
from rudc.errors import RudcError
from rudc.evaluation.record import EpisodeRecord
from rudc.evaluation.rollout import run_episode
from rudc.evaluation.tasks import Task
from rudc.network.network import load_network
from rudc.world.world import World


class EpisodeRunner:
    """Task -> record. Whatever goes wrong in an episode becomes the `error` of its record."""

    def __init__(self, make: Callable[[str], Agent] = make_agent) -> None:
        """`make`: an agent's name -> the agent."""
        self._make = make
        self._world: World | None = None
        self._network: tuple[str, str | None] | None = None
        self._agents: dict[str, Agent] = {}

    def __call__(self, task: Task) -> EpisodeRecord:
        """Run the task's episode."""
        try:
            if task.agent not in self._agents:
                self._agents[task.agent] = self._make(task.agent)
            episode = Episode(self._world_of(task))
            return run_episode(episode, task.scenario.plan(task.seed), self._agents[task.agent])
        except RudcError as error:
            reason = str(error)
        except Exception as error:  # a defect of ours or of a user's agent: the other episodes go on
            last = traceback.extract_tb(error.__traceback__)[-1]
            reason = f"{type(error).__name__}: {error} ({Path(last.filename).name}:{last.lineno})"
        self.close()
        return EpisodeRecord.failed(task.scenario.name, task.agent, task.seed, reason)

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
