"""A learnt policy at the wheel: observation -> policy -> uncertainty of the critics -> safety filter.

    a       = tanh(mean of the policy)            [-1, 1]^2; while it explores, a sample instead
    u_rl    = what a means (`DriverConfig.physical`)
    sigma   = sigma_total of the critics at (observation, a)
    u       = filter(u_rl, slack delta(sigma))

Needs numpy only; torch is for learning.
"""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rudc.agents.algorithms import DriverConfig
from rudc.agents.base import Decision, EgoDriver
from rudc.agents.checkpoint import load_learnt
from rudc.agents.learning.inference import Decider
from rudc.agents.learning.parameters import policy_arrays
from rudc.agents.learning.uncertainty import uncertainty
from rudc.env.observation import observe_flat
from rudc.safety.filter import SafetyFilter
from rudc.safety.slack import Slack
from rudc.world.scene import Scene

Floats = NDArray[np.float32]


class Choice(NamedTuple):
    """A decision, and how it looks to whoever learns from it."""

    decision: Decision
    observation: Floats
    """(size,)"""
    action: Floats
    """(2,) what is executed, after the filter, in [-1, 1]"""
    nominal: Floats
    """(2,) what the policy proposed, in [-1, 1]"""


class LearnedAgent:
    """Drives by a learnt policy."""

    ego_driver: EgoDriver = "agent"

    def __init__(
        self,
        name: str,
        config: DriverConfig,
        arrays: Mapping[str, NDArray],
        percentiles: tuple[float, float] | None = None,
    ) -> None:
        """`arrays` and `percentiles`: see `load`."""
        self.name = name
        self.config = config
        self._decider = Decider(config.learner, arrays)
        settings = config.filter
        self._filter = None if settings is None else SafetyFilter(settings)
        self.load(arrays, percentiles)

    def load(self, arrays: Mapping[str, NDArray], percentiles: tuple[float, float] | None = None) -> None:
        """Take over weights, named `policy/...` and `critic/...` as `RudcLearner.arrays` names them, and
        sigma_l and sigma_h of the slack. Without critics there is neither sigma nor slack.
        """
        self._decider.refresh(arrays)
        self._critics = any(name.startswith("critic/") for name in arrays)
        self._slack: Slack | None = None
        if self.config.slack_gain and self._critics and percentiles is not None:
            self._slack = Slack(self.config.slack_gain, *percentiles)

    def reset(self, scene: Scene, seed: int) -> None:
        """Forget the filter's last solution."""
        if self._filter is not None:
            self._filter.reset()

    def act(self, scene: Scene) -> Decision:
        """The policy's mean, corrected."""
        return self.choose(scene).decision

    def choose(
        self, scene: Scene, rng: np.random.Generator | None = None, observation: Floats | None = None
    ) -> Choice:
        """The same, and how it looks to a learner. With `rng` it explores; `observation`: that of this scene,
        where it is known already.
        """
        clock = [time.perf_counter()]
        if observation is None:
            observation = observe_flat(scene, self.config.observation)
        clock.append(time.perf_counter())
        nominal = self._decider.action(observation, rng)
        u_rl = self.config.physical(nominal, scene)
        clock.append(time.perf_counter())
        sigma = self._sigma(observation, nominal)
        clock.append(time.perf_counter())
        if self._filter is None:
            u, action, filtered = u_rl, nominal, None
        else:
            slack = self._slack(sigma) if self._slack else 0.0
            filtered = self._filter.filter(scene, u_rl, slack)
            u = filtered.u
            same = np.array_equal(u, u_rl)
            action = nominal if same else self.config.normalised(u, scene).astype(np.float32)
        clock.append(time.perf_counter())
        parts = ("observation", "policy", "critic", "filter")
        timing = {part: 1000.0 * float(clock[i + 1] - clock[i]) for i, part in enumerate(parts)}
        return Choice(Decision(u, u_rl, sigma, filtered, timing), observation, action, nominal)

    def _sigma(self, observation: Floats, action: Floats) -> float:
        if not self._critics:
            return math.nan
        quantiles = self._decider.quantiles(observation, action)
        return float(uncertainty(quantiles, self.config.learner.beta).total)


def untrained(config: DriverConfig) -> LearnedAgent:
    """An agent whose policy has learnt nothing yet."""
    arrays = {f"policy/{name}": value for name, value in policy_arrays(config.learner).items()}
    return LearnedAgent("untrained", config, arrays)


def load_learned(name: str, folder: Path) -> LearnedAgent:
    """The agent in a checkpoint's folder, which is called `name` in tables. Raises AgentError."""
    learnt = load_learnt(folder)
    return LearnedAgent(name, learnt.config, learnt.arrays, learnt.percentiles)
