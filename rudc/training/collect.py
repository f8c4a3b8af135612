"""Collection in one world: decisions -> transitions over up to n steps.

After the n decisions k = 0..n-1 from s_0 (fewer where the episode ends)

    reward = sum_k gamma^k r_k,   discount = gamma^n,   next observation = that of s_n

An episode that ends in an outcome other than a time-out is terminal. A time-out, and an episode broken off at
a checkpoint, are not: their value is bootstrapped from where they stopped.

The reward is the environment's, save that a collision costs `collision_reward`. Learnt from is the action
that was executed, after the filter, since that is what the reward followed; the policy's own is kept beside
it.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rudc.agents.gap_acceptance import GapAcceptance
from rudc.agents.learned import Choice, untrained
from rudc.env.episode import Episode, Outcome, StepResult
from rudc.env.observation import Kind, observe_flat
from rudc.evaluation.record import EpisodeRecord
from rudc.evaluation.rollout import run_episode
from rudc.scenario import load_scenario
from rudc.training.config import TrainConfig
from rudc.training.curriculum import make_mixture
from rudc.world.network import load_network
from rudc.world.scene import Scene
from rudc.world.world import World

Floats = NDArray[np.float32]
By = Literal["reference", "policy"]


class Transitions(NamedTuple):
    """T transitions over k >= 1 decisions each, in the order in which they were completed."""

    observation: Floats
    """(T, size)"""
    action: Floats
    """(T, 2) executed"""
    nominal: Floats
    """(T, 2) proposed"""
    reward: Floats
    """(T,)"""
    discount: Floats
    """(T,)"""
    next_observation: Floats
    """(T, size)"""
    terminal: NDArray[np.bool_]
    """(T,)"""


class Finished(NamedTuple):
    """A training episode that has ended."""

    outcome: str
    """see rudc/env/episode.py"""
    reward: float
    """sum of the environment's rewards"""
    steps: int
    """decisions"""


class Collected(NamedTuple):
    """What one world gave in one round."""

    transitions: Transitions
    """what to learn from"""
    finished: tuple[Finished, ...]
    """episodes that ended"""


class _Taken(NamedTuple):
    observation: Floats
    action: Floats
    nominal: Floats
    reward: float


class StepsAhead:
    """Turns decisions into transitions over n steps."""

    def __init__(self, n_step: int, discount: float) -> None:
        self._n = n_step
        self._powers = discount ** np.arange(n_step + 1)
        self._window: deque[_Taken] = deque()
        self._rows: list[tuple[Floats, Floats, Floats, float, float, Floats, bool]] = []

    def add(self, taken: _Taken, after: Floats, *, terminal: bool, last: bool) -> None:
        """One decision that led to `after`; `last` if no other of this episode follows."""
        self._window.append(taken)
        if last:
            self.end(after, terminal=terminal)
        elif len(self._window) == self._n:
            self._emit(after, terminal)

    def end(self, after: Floats, *, terminal: bool) -> None:
        """The episode ends, or is broken off, at `after`."""
        while self._window:
            self._emit(after, terminal)

    def take(self) -> Transitions:
        """The transitions completed since the last call, of which there must be one at least."""
        rows, self._rows = self._rows, []
        observation, action, nominal, reward, discount, after, terminal = zip(*rows, strict=True)
        return Transitions(
            np.stack(observation),
            np.stack(action),
            np.stack(nominal),
            np.array(reward, dtype=np.float32),
            np.array(discount, dtype=np.float32),
            np.stack(after),
            np.array(terminal),
        )

    def _emit(self, after: Floats, terminal: bool) -> None:
        length = len(self._window)
        reward = float(sum(p * taken.reward for p, taken in zip(self._powers, self._window, strict=False)))
        first = self._window.popleft()
        bootstrap = float(self._powers[length])
        self._rows.append(
            (first.observation, first.action, first.nominal, reward, bootstrap, after, terminal)
        )


class Collector:
    """One world and whoever drives in it."""

    def __init__(self, config: TrainConfig, worker: int) -> None:
        self._config = config
        self._worker = worker
        self._mixture = make_mixture(config.scenario, config.curriculum)
        first = self._mixture.scenarios[0]
        self._world = World(load_network(first.network, first.junction))
        self._at = (first.network, first.junction)
        self._episode: Episode | None = None
        self._scene: Scene | None = None
        self._kind: Kind = config.driver.observation
        self._seen: Floats = np.empty(0, np.float32)
        self._reference = GapAcceptance()
        self._agent = untrained(config.driver)
        learner = config.driver.learner
        self._steps = StepsAhead(learner.n_step, learner.discount)

    def load(self, arrays: Mapping[str, Floats], percentiles: tuple[float, float] | None) -> None:
        """Drive with these weights from now on."""
        self._agent.load(arrays, percentiles)

    def collect(self, round_: int, decisions: int, by: By, *, drop: bool) -> Collected:
        """Take so many decisions. `drop`: break the running episode off afterwards."""
        rng = np.random.default_rng((self._config.seed, 1, self._worker, round_))
        finished: list[Finished] = []
        for _ in range(decisions):
            episode, scene = self._running(rng)
            choice = self._choose(scene, by, rng)
            result = episode.step(choice.decision.u)
            self._scene, self._seen = result.scene, observe_flat(result.scene, self._kind)
            self._learn_from(choice, result)
            if result.outcome is not None:
                metrics = episode.metrics()
                finished.append(Finished(metrics.outcome, metrics.episode_reward, metrics.steps))
                self._episode = None
        if drop:
            self._drop()
        return Collected(self._steps.take(), tuple(finished))

    def evaluate(self, tasks: tuple[tuple[str, int], ...]) -> tuple[EpisodeRecord, ...]:
        """Drive the held-out episodes (scenario, seed) by the policy's mean."""
        self._drop()
        records = []
        for name, seed in tasks:
            scenario = load_scenario(name)
            self._move_to(scenario.network, scenario.junction)
            records.append(run_episode(Episode(self._world), scenario.plan(seed), self._agent))
        return tuple(records)

    def close(self) -> None:
        """End the world."""
        self._world.close()

    def _running(self, rng: np.random.Generator) -> tuple[Episode, Scene]:
        if self._episode is None or self._scene is None:
            plan = self._mixture.draw(rng)
            self._move_to(plan.network, plan.junction)
            self._episode = Episode(self._world)
            self._scene = self._episode.reset(plan)
            self._seen = observe_flat(self._scene, self._kind)
            self._reference.reset(self._scene, plan.seed)
            self._agent.reset(self._scene, plan.seed)
        return self._episode, self._scene

    def _move_to(self, network: str, junction: str | None) -> None:
        if (network, junction) != self._at:
            self._world.close()
            self._world, self._at = World(load_network(network, junction)), (network, junction)

    def _choose(self, scene: Scene, by: By, rng: np.random.Generator) -> Choice:
        if by == "policy":
            return self._agent.choose(scene, rng, self._seen)
        driver = self._config.driver
        proposed = self._reference.act(scene)
        action = driver.normalised(proposed.u, scene) + self._config.seed_noise * rng.standard_normal(2)
        action = np.clip(action, -1.0, 1.0).astype(np.float32)  # as it will be learnt from
        decision = proposed._replace(u=driver.physical(action, scene))
        return Choice(decision, self._seen, action, action)

    def _learn_from(self, choice: Choice, result: StepResult) -> None:
        reward = result.reward
        if result.outcome is Outcome.COLLISION:
            reward += self._config.collision_reward - result.terms["collision"]
        last = result.outcome is not None
        terminal = last and result.outcome is not Outcome.FROZEN
        taken = _Taken(choice.observation, choice.action, choice.nominal, reward)
        self._steps.add(taken, self._seen, terminal=terminal, last=last)

    def _drop(self) -> None:
        if self._episode is not None:
            self._steps.end(self._seen, terminal=False)
        self._episode = self._scene = None
