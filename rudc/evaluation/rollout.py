"""Rolls out one episode with an agent at the wheel, and keeps what a row of `episodes.csv` says."""

from __future__ import annotations

import contextlib
import sys
import time
from collections.abc import Callable
from typing import TYPE_CHECKING

from rudc.errors import AgentFailedError
from rudc.evaluation.columns import Driven, read_off
from rudc.evaluation.record import EpisodeRecord
from rudc.world.scene import Scene

if TYPE_CHECKING:
    from rudc.agents.base import Agent, Decision
    from rudc.env.episode import Episode, StepResult
    from rudc.scenario.plan import EpisodePlan

Watcher = Callable[[Scene, "Decision", "StepResult"], None]
"""Is shown each decision: the scene it was taken in, the decision, and what came of it."""


def run_episode(
    episode: Episode,
    plan: EpisodePlan,
    agent: Agent,
    *,
    options: tuple[str, ...] = (),
    watch: Watcher | None = None,
) -> EpisodeRecord:
    """Drive the plan's episode to its end. `options` go to SUMO's command line. Raises what `World.reset`
    does, AgentError if a filter of the agent is for actions that are held for another time than the world's,
    and AgentFailedError where an agent of a user's own fails. What is printed meanwhile goes to stderr:
    stdout is for results.
    """
    from rudc.agents.correction import refuse_other_steps  # not needed to start a sweep

    refuse_other_steps(agent, episode.world.config.decision_s)
    decisions: list[Decision] = []
    spent_ms: list[float] = []
    with contextlib.redirect_stdout(sys.stderr):
        scene = episode.reset(plan, ego_driver=agent.ego_driver, options=options)
        agent.reset(scene, plan.seed)
        while episode.outcome is None:
            start = time.perf_counter()
            decision = agent.act(scene)
            spent_ms.append(1000.0 * (time.perf_counter() - start))
            decisions.append(decision)
            result = episode.step(decision.u)
            if watch is not None:
                watch(scene, decision, result)
            scene = result.scene
    truth, metrics = episode.truth, episode.metrics()
    driven = Driven(plan, agent.name, truth.vehicle, truth.route, metrics, decisions, spent_ms)
    return EpisodeRecord(read_off(driven))


def run_until_failure(
    episode: Episode,
    plan: EpisodePlan,
    agent: Agent,
    *,
    options: tuple[str, ...] = (),
    watch: Watcher,
) -> tuple[EpisodeRecord, AgentFailedError | None]:
    """As `run_episode`; where an agent of a user's own fails after its first decision, the record says so,
    and the error stands beside it. Raises AgentFailedError where it fails before.
    """
    decided = False

    def seen(scene: Scene, decision: Decision, result: StepResult) -> None:
        nonlocal decided
        decided = True
        watch(scene, decision, result)

    try:
        return run_episode(episode, plan, agent, options=options, watch=seen), None
    except AgentFailedError as error:
        if not decided:
            raise
        return EpisodeRecord.failed(plan.scenario, agent.name, plan.seed, str(error)), error
