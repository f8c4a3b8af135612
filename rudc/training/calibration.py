"""sigma_l and sigma_h of an agent as it is deployed, and the usual sigma along the route, measured over its
decisions in held-out episodes.

Values from a training's last decisions do not hold afterwards: they come from a policy that explores, from
critics that still changed, and from the curriculum's starts. So at the end of a training, and by `rudc agent
calibrate`, the final policy drives with its mean action, with its outlook and its correction as in use, and
all of this is measured then.

Only episodes that succeed count as usual: an episode that freezes has four times as many decisions as
another, all at one place, and a single one in a hundred would move sigma_l more than all others (measured:
the share of decisions above it fell from 5 to 0.1 %).

The correction's slack depends on sigma_l and sigma_h in turn: during the measurement it works with the old
values. Where that matters, calibrate again.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from rudc.agents.base import Decision
from rudc.agents.checkpoint import Learnt, load_learnt
from rudc.agents.learned import LearnedAgent
from rudc.agents.outlook import with_outlook
from rudc.agents.route_sigma import ROUTE, Heard, Place, RouteSigma, explained, fit, place_of
from rudc.arrays import Array, Arrays
from rudc.env.episode import Episode
from rudc.env.outcome import Outcome
from rudc.errors import AgentError, SimulationError
from rudc.evaluation.rollout import run_episode
from rudc.learning.uncertainty import PERCENTILES
from rudc.network.network import Network, load_network
from rudc.scenario.plan import EpisodePlan
from rudc.training.curriculum import held_out
from rudc.world.config import EgoDriver
from rudc.world.scene import Scene
from rudc.world.world import World

CALIBRATION_SEED = 950_000
"""first seed of the episodes; neither training nor its evaluations use them"""
SCENARIOS = ("random_destination", "dense_left_turn")
"""scenarios that an agent is calibrated on unless others are named"""


class Measured(NamedTuple):
    """What held-out episodes say about sigma."""

    percentiles: tuple[float, float]
    """sigma_l and sigma_h of sigma_total, reward units"""
    arrays: Arrays
    """what is usual along the route, named as in a checkpoint"""


class Limits(NamedTuple):
    """sigma_l and sigma_h of one kind of sigma."""

    found: tuple[float, float]
    """reward units"""
    before: tuple[float, float] | None
    """those that the agent had"""
    above: tuple[float, float] | None
    """shares of the decisions above those: 0.05 and 0.025 if they held"""


class Calibration(NamedTuple):
    """What came out."""

    kinds: Mapping[str, Limits]
    """`paper` and `route`"""
    decisions: int
    """number of decisions that were measured"""
    episodes: int
    """number of their episodes: those that succeeded, or all if none did"""
    succeeded: bool
    """whether any did"""
    explained: float
    """share of the variance of log sigma_total that the place on the route explains, out of sample"""
    learnt: Learnt
    """the agent with what was found, not stored yet"""
    left_out: int = 0
    """number of episodes that could not be set up, or driven to their end"""


class Noting:
    """An agent, and a note of where it was and how unsure it was at each decision since it was reset."""

    ego_driver: EgoDriver = "agent"

    def __init__(self, agent: LearnedAgent) -> None:
        self.name = agent.name
        self.inner = agent

    def reset(self, scene: Scene, seed: int) -> None:
        """Reset the agent and forget."""
        self._places: list[Place] = []
        self._sigmas: list[tuple[float, ...]] = []
        self.inner.reset(scene, seed)

    def act(self, scene: Scene) -> Decision:
        """The agent's decision."""
        decision = self.inner.act(scene)
        assert decision.uncertainty is not None
        self._places.append(place_of(scene))
        self._sigmas.append(tuple(float(value) for value in decision.uncertainty))
        return decision

    @property
    def heard(self) -> Heard:
        """The episode so far."""
        return Heard(np.array(self._places, dtype=float), np.array(self._sigmas))


def calibration_tasks(scenarios: Sequence[str], episodes: int) -> list[tuple[str, int]]:
    """(scenario, seed) of the episodes."""
    seeds = range(CALIBRATION_SEED, CALIBRATION_SEED + episodes)
    return [(name, seed) for name in scenarios for seed in seeds]


def hear(world: World, plan: EpisodePlan, agent: LearnedAgent) -> Heard:
    """An agent in an episode, driven as it is deployed: with its outlook."""
    noting = Noting(agent)
    record = run_episode(Episode(world), plan, with_outlook(noting, agent.name, agent.config.outlook))
    return noting.heard._replace(succeeded=record.outcome == Outcome.SUCCESS)


def usual(episodes: Sequence[Heard]) -> list[Heard]:
    """Those that succeeded; all if none did."""
    return [heard for heard in episodes if heard.succeeded] or list(episodes)


def measured(episodes: Sequence[Heard]) -> Measured:
    """sigma_l, sigma_h and what is usual along the route, of these episodes."""
    episodes = usual(episodes)
    low, high = np.percentile(np.concatenate([heard.sigmas for heard in episodes])[:, 2], PERCENTILES)
    arrays = {f"{ROUTE}/{name}": value for name, value in fit(episodes).items()}
    return Measured((float(low), float(high)), arrays)


def calibrate(
    folder: Path, scenarios: Sequence[str], episodes: int, *, advance: Callable[[], object]
) -> Calibration:
    """Measure sigma_l and sigma_h of the agent in a checkpoint's folder, of sigma_total and by route.
    `advance` is told of each episode; those that fail are left out. Raises AgentError if its critics say
    nothing of sigma or if all episodes fail, and InputError for scenarios that `held_out` refuses.
    """
    learnt = load_learnt(folder)
    if "sigma" not in learnt.config.learner.offers:
        raise AgentError(
            f"{folder}: {learnt.config.algorithm} states no sigma, so there is nothing to calibrate"
        )
    agent = LearnedAgent(str(folder), learnt.config, learnt.arrays, learnt.percentiles)
    heard, left_out = [], []
    for name, scenario in held_out(scenarios).items():
        plans = [scenario.plan(seed) for _, seed in calibration_tasks((name,), episodes)]
        for one in _each(plans, load_network(scenario.network, scenario.junction), agent):
            (left_out if isinstance(one, SimulationError) else heard).append(one)
            advance()
    if not heard:
        raise AgentError(f"{folder}: none of {len(left_out)} episodes can be driven: {left_out[0]}")
    new, old, heard = measured(heard), RouteSigma.among(learnt.arrays), usual(heard)
    total = np.concatenate([one.sigmas[:, 2] for one in heard])
    route = None if old is None else np.concatenate([old.of_heard(one)[:, 2] for one in heard])
    by_route = RouteSigma.among(new.arrays)
    assert by_route is not None
    kinds = {
        "paper": _limits(new.percentiles, learnt.percentiles, total),
        "route": _limits(by_route.percentiles, None if old is None else old.percentiles, route),
    }
    succeeded = any(one.succeeded for one in heard)
    found = learnt._replace(percentiles=new.percentiles, arrays=learnt.arrays | new.arrays)
    return Calibration(kinds, total.size, len(heard), succeeded, explained(heard), found, len(left_out))


def _each(
    plans: Sequence[EpisodePlan], network: Network, agent: LearnedAgent
) -> Iterator[Heard | SimulationError]:
    """What is heard in each episode on a network, or why it failed; after that, the world is a new one."""
    world = World(network)
    try:
        for plan in plans:
            try:
                one = hear(world, plan, agent)
            except SimulationError as error:
                one = error
                world.close()
                world = World(network)
            yield one
    finally:
        world.close()


def _limits(found: tuple[float, float], before: tuple[float, float] | None, sigmas: Array | None) -> Limits:
    """`sigmas`: (n,) by the values that the agent had."""
    if before is None or sigmas is None:
        return Limits(found, before, None)
    low, high = (float(np.mean(sigmas > limit)) for limit in before)
    return Limits(found, before, (low, high))
