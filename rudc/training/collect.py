"""Collection in one world: decisions -> transitions.

The reward is the environment's, save that a collision costs `collision_reward`. A time-out, and an episode
broken off at a checkpoint, are not the end of anything: their value is bootstrapped from where they stopped.

A share of the episodes is driven without correction. In these, critics learn what a proposal leads to where
the filter would have corrected it. Where critics learn about the executed action, all transitions belong to
the same decision process, the uncorrected one. With the filter in every episode that is never learnt,
whichever action is replayed: the policy drives on and leaves braking to the filter.

An episode that cannot be set up (such as one in which no draw has a safe start) is left out: in a round the
next one is drawn. One that fails later is broken off: its last decision gives no transition, nor do those
before it that still wait for the rewards of later decisions. `Collected` counts both.

With `training.outlook` whoever drives sees the world as the agent's outlook shows it. The outlook also bounds
the commands, in the episodes that are corrected and in no others.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Literal, NamedTuple, TypeVar

import numpy as np

from rudc.agents.gap_acceptance import GapAcceptance
from rudc.agents.learned import Chosen, untrained
from rudc.agents.outlook import with_outlook
from rudc.agents.route_sigma import Heard
from rudc.arrays import Floats
from rudc.env.episode import Episode, StepResult
from rudc.env.observation import ObservationKind, observe_flat
from rudc.env.outcome import Outcome
from rudc.env.reward import scene_cost
from rudc.errors import SimulationError
from rudc.evaluation.record import EpisodeRecord
from rudc.evaluation.rollout import run_episode
from rudc.learning.nstep import NStep, Transition
from rudc.network.network import load_network
from rudc.scenario.plan import EpisodePlan
from rudc.training.calibration import hear
from rudc.training.config import TrainConfig
from rudc.training.curriculum import held_out, make_mixture
from rudc.world.scene import Scene
from rudc.world.world import World

By = Literal["reference", "policy"]
T = TypeVar("T")

DRAWS = 20
"""so many episodes in a row that cannot be set up or driven to their end end the training"""


class Finished(NamedTuple):
    """A training episode that has ended."""

    outcome: str
    """see rudc/env/outcome.py"""
    reward: float
    """sum of the environment's rewards"""
    cost: float
    """sum of its costs"""
    steps: int
    """decisions"""


class Collected(NamedTuple):
    """What one world gave in one round."""

    transitions: tuple[Transition, ...]
    """what to learn from"""
    finished: tuple[Finished, ...]
    """episodes that ended"""
    drawn: int
    """number of episodes that were drawn"""
    left_out: int
    """number of episodes that could not be set up or driven to their end"""


class Collector:
    """One world and whoever drives in it."""

    def __init__(self, config: TrainConfig, worker: int) -> None:
        self._config = config
        self._worker = worker
        self._training = config.training
        self._mixture = make_mixture(config.training.scenario, config.training.curriculum)
        self._held_out_on = held_out(config.training.evaluate_on)
        first = self._mixture.scenarios[0]
        self._world = World(load_network(first.network, first.junction))
        self._at = (first.network, first.junction)
        self._episode: Episode | None = None
        self._scene: Scene | None = None
        self._kind: ObservationKind = config.observation
        self._seen: Floats = np.empty(0, np.float32)
        self._cost = 0.0
        self._reference = GapAcceptance()
        self._agent = untrained(config.agent, config.training.seed)
        self._outlook = config.outlook.make() if config.training.outlook else None
        self._correcting = True
        self._steps = NStep(config.learner.n_step, config.learner.discount)
        self._failed = self._drawn = self._left_out = 0

    def load(self, arrays: Mapping[str, Floats], percentiles: tuple[float, float] | None) -> None:
        """Drive with these weights from now on."""
        self._agent.load(arrays, percentiles)

    def collect(self, round_: int, decisions: int, by: By, *, drop: bool) -> Collected:
        """Take that many `decisions`. `drop`: break the running episode off afterwards. Raises
        SimulationError after `DRAWS` episodes in a row that failed.
        """
        rng = np.random.default_rng((self._training.seed, self._worker, round_))
        new: list[Transition] = []
        finished: list[Finished] = []
        self._drawn = self._left_out = 0
        for k in range(decisions):
            episode, scene = self._running(rng)
            choice = self._choose(scene, by, rng)
            try:
                before, result = self._cost, episode.step(choice.decision.u)
            except SimulationError as error:
                self._leave_out(error)
                continue
            self._show(result.scene)
            self._cost = result.cost
            new += self._transitions(choice, result, before, cut=drop and k == decisions - 1)
            if result.outcome is not None:
                metrics = episode.metrics()
                finished.append(
                    Finished(metrics.outcome, metrics.episode_reward, metrics.episode_cost, metrics.steps)
                )
                self._episode, self._failed = None, 0
        if drop:  # a training that is resumed here counts from 0, too
            self._episode, self._failed = None, 0
        return Collected(tuple(new), tuple(finished), self._drawn, self._left_out)

    def evaluate(self, tasks: tuple[tuple[str, int], ...]) -> tuple[EpisodeRecord | None, ...]:
        """Drive the held-out episodes (scenario, seed) as the agent will; None for one that cannot be set up
        or driven to its end. The running episode is lost.
        """
        driver = with_outlook(self._agent, self._agent.name, self._config.outlook)
        return self._each(tasks, lambda plan: run_episode(Episode(self._world), plan, driver))

    def hear(self, tasks: tuple[tuple[str, int], ...]) -> tuple[Heard | None, ...]:
        """The sigmas that the agent states in these episodes, driven as deployed; None likewise."""
        return self._each(tasks, lambda plan: hear(self._world, plan, self._agent))

    def close(self) -> None:
        """End the world."""
        self._world.close()

    def _each(
        self, tasks: tuple[tuple[str, int], ...], drive: Callable[[EpisodePlan], T]
    ) -> tuple[T | None, ...]:
        found: list[T | None] = []
        for plan in self._held_out(tasks):
            try:
                found.append(drive(plan))
            except SimulationError:
                found.append(None)
                self._renew()
        return tuple(found)

    def _held_out(self, tasks: tuple[tuple[str, int], ...]) -> Iterator[EpisodePlan]:
        """The plans of episodes (scenario, seed), the world moved to each one's network; a running episode is
        lost."""
        self._episode = self._scene = None
        self._steps.clear()
        for name, seed in tasks:
            scenario = self._held_out_on[name]
            self._move_to(scenario.network, scenario.junction)
            yield scenario.plan(seed)

    def _running(self, rng: np.random.Generator) -> tuple[Episode, Scene]:
        if self._episode is None or self._scene is None:
            self._episode, plan, first = self._set_up(rng)
            if self._outlook is not None:
                self._outlook.reset(first)
            scene = self._show(first)
            self._cost = scene_cost(self._episode.truth)
            self._reference.reset(scene, plan.seed)
            self._agent.reset(scene, plan.seed)
            self._correcting = bool(rng.random() < self._training.filtered_share)
        assert self._scene is not None
        return self._episode, self._scene

    def _set_up(self, rng: np.random.Generator) -> tuple[Episode, EpisodePlan, Scene]:
        """The next episode that can be set up. Raises SimulationError as `_leave_out` does."""
        while True:
            plan = self._mixture.draw(rng)
            self._drawn += 1
            self._move_to(plan.network, plan.junction)
            episode = Episode(self._world)
            try:
                return episode, plan, episode.reset(plan)
            except SimulationError as error:
                self._leave_out(error)

    def _leave_out(self, error: SimulationError) -> None:
        """Go on in a new world after an episode that failed. Raises SimulationError if it is the last of
        `DRAWS` in a row.
        """
        self._episode = None
        self._steps.clear()
        self._failed += 1
        self._left_out += 1
        if self._failed >= DRAWS:
            raise SimulationError(
                f"{DRAWS} episodes in a row cannot be set up or driven to their end: {error}"
            ) from error
        self._renew()

    def _show(self, scene: Scene) -> Scene:
        """Take a scene in, as the outlook shows it: once a decision."""
        self._scene = scene if self._outlook is None else self._outlook.see(scene)
        self._seen = observe_flat(self._scene, self._kind)
        return self._scene

    def _move_to(self, network: str, junction: str | None) -> None:
        if (network, junction) != self._at:
            self._at = (network, junction)
            self._renew()

    def _renew(self) -> None:
        self._world.close()
        self._world = World(load_network(*self._at))

    def _choose(self, scene: Scene, by: By, rng: np.random.Generator) -> Chosen:
        if by == "policy":
            chosen = self._agent.choose(scene, rng, self._seen, correcting=self._correcting)
            return self._bounded(scene, chosen) if self._correcting else chosen
        means = self._config.action
        proposed = self._reference.act(scene)
        action = means.action_of(proposed.u, scene) + self._training.seed_noise * rng.standard_normal(2)
        action = np.clip(action, -1.0, 1.0).astype(np.float32)  # as it will be learnt from
        decision = proposed._replace(u=means.u_of(action, scene))
        return Chosen(decision, self._seen, action, action)

    def _bounded(self, scene: Scene, chosen: Chosen) -> Chosen:
        """The same choice, its action bounded by the outlook."""
        if self._outlook is None:
            return chosen
        decision = chosen.decision
        u = self._outlook.govern(scene, decision.u, onwards=decision.onwards)
        if np.array_equal(u, decision.u):
            return chosen
        executed = self._config.action.action_of(u, scene).astype(np.float32)
        return chosen._replace(decision=decision._replace(u=u), executed=executed)

    def _transitions(
        self, choice: Chosen, result: StepResult, cost_before: float, *, cut: bool
    ) -> list[Transition]:
        reward, outcome = result.reward, result.outcome
        if outcome is Outcome.COLLISION:
            reward += self._training.collision_reward - result.terms["collision"]
        return self._steps.add(
            choice.observation,
            choice.executed,
            choice.proposed,
            reward,
            result.cost,
            self._seen,
            terminal=outcome not in (None, Outcome.FROZEN),
            truncated=cut or outcome is Outcome.FROZEN,
            cost_before=cost_before,
        )
