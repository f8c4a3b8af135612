"""sigma_l and sigma_h of an agent as it is deployed: percentiles of sigma over its decisions in held-out
episodes.

Those of a training's last decisions do not hold afterwards: they are of a policy that explores, of critics
that still changed, on the curriculum's starts. So at the end of a training, and by `rudc agent calibrate`,
the final policy drives by its mean, corrected as it will be, and both are measured. The correction's slack
depends on them in turn: it works with the old ones meanwhile, and where it matters calibrating again
settles it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from rudc.agents.base import Agent, Decision
from rudc.agents.checkpoint import load_learnt, save_learnt
from rudc.agents.learned import LearnedAgent
from rudc.arrays import Array
from rudc.env.episode import Episode, StepResult
from rudc.errors import AgentError
from rudc.evaluation.rollout import run_episode
from rudc.learning.uncertainty import PERCENTILES
from rudc.network.network import load_network
from rudc.scenario import load_scenario
from rudc.scenario.plan import EpisodePlan
from rudc.world.scene import Scene
from rudc.world.world import World

CALIBRATION_SEED = 950_000
"""first seed of the episodes; neither training nor its evaluations use them"""
SCENARIOS = ("random_destination", "dense_left_turn")
"""that an agent is calibrated on unless told otherwise"""


class Calibration(NamedTuple):
    """What came out."""

    percentiles: tuple[float, float]
    """sigma_l and sigma_h, reward units"""
    decisions: int
    """that they are of"""
    before: tuple[float, float] | None
    """those that the agent had"""
    above: tuple[float, float] | None
    """shares of the decisions above those: 0.05 and 0.025 if they held"""


def calibration_tasks(scenarios: Sequence[str], episodes: int) -> list[tuple[str, int]]:
    """(scenario, seed) of the episodes."""
    seeds = range(CALIBRATION_SEED, CALIBRATION_SEED + episodes)
    return [(name, seed) for name in scenarios for seed in seeds]


def sigmas_of(world: World, plan: EpisodePlan, agent: Agent) -> Array:
    """sigma_total of each decision of an agent in an episode."""
    seen: list[float] = []

    def keep(_: Scene, decision: Decision, __: StepResult) -> None:
        seen.append(decision.sigma)

    run_episode(Episode(world), plan, agent, watch=keep)
    return np.array(seen)


def percentiles_of(sigmas: Sequence[Array]) -> tuple[float, float]:
    """sigma_l and sigma_h of those of all episodes."""
    low, high = np.percentile(np.concatenate(sigmas), PERCENTILES)
    return float(low), float(high)


def calibrate(
    folder: Path, scenarios: Sequence[str], episodes: int, *, write: bool, advance: Callable[[], None]
) -> Calibration:
    """Measure, and with `write` store, sigma_l and sigma_h of the agent in a checkpoint's folder. `advance`
    is told of each episode. Raises AgentError if its critics say nothing of sigma.
    """
    learnt = load_learnt(folder)
    if not learnt.config.learner.states_sigma:
        raise AgentError(
            f"{folder}: {learnt.config.algorithm} states no sigma, so there is nothing to calibrate"
        )
    agent = LearnedAgent(str(folder), learnt.config, learnt.arrays, learnt.percentiles)
    sigmas = []
    for name in scenarios:
        scenario = load_scenario(name)
        world = World(load_network(scenario.network, scenario.junction))
        try:
            for _, seed in calibration_tasks((name,), episodes):
                sigmas.append(sigmas_of(world, scenario.plan(seed), agent))
                advance()
        finally:
            world.close()
    found, everything = percentiles_of(sigmas), np.concatenate(sigmas)
    above = None
    if learnt.percentiles is not None:
        low, high = (float(np.mean(everything > limit)) for limit in learnt.percentiles)
        above = (low, high)
    if write:
        save_learnt(folder, learnt._replace(percentiles=found))
    return Calibration(found, everything.size, learnt.percentiles, above)
