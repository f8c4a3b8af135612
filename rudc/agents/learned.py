"""A learnt policy at the wheel: observation -> policy -> uncertainty of the critics -> safety filter.

    a       = tanh(mean of the policy)            [-1, 1]^2; while it explores, a sample instead
    u_rl    = what a means (`DriverConfig.physical`)
    sigma   = sigma_total of the critics at (observation, a)
    u       = filter(u_rl, slack delta(sigma))

Imports torch; the registry imports this file when such an agent is asked for.
"""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray

from rudc.agents.algorithms import DriverConfig
from rudc.agents.base import Decision, EgoDriver
from rudc.agents.checkpoint import load_agent
from rudc.agents.learning.ensemble import CriticEnsemble
from rudc.agents.learning.policy import Policy
from rudc.agents.learning.uncertainty import uncertainty
from rudc.env.observation import observe_flat
from rudc.safety.filter import SafetyFilter
from rudc.safety.slack import Slack
from rudc.world.scene import Array, Scene

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
        arrays: Mapping[str, NDArray] | None = None,
        percentiles: tuple[float, float] | None = None,
        *,
        critics: bool = True,
    ) -> None:
        """`arrays`: see `load`; `percentiles`: sigma_l and sigma_h of the slack; `critics`: whether sigma is
        wanted even where no slack needs it.
        """
        self.name = name
        self.config = config
        self._policy = Policy(config.learner)
        self._critics = CriticEnsemble(config.learner) if critics or config.slack_gain else None
        settings = config.filter
        self._filter = None if settings is None else SafetyFilter(settings)
        self._slack: Slack | None = None
        if arrays is not None:
            self.load(arrays, percentiles)

    @torch.no_grad()
    def load(self, arrays: Mapping[str, NDArray], percentiles: tuple[float, float] | None = None) -> None:
        """Take over weights, named `policy/...` and `critic/...` as `RudcLearner.arrays` names them."""
        for group, weights in self._groups().items():
            for name, tensor in weights.items():
                tensor.copy_(torch.from_numpy(arrays[f"{group}/{name}"]))
        gain = self.config.slack_gain
        known = percentiles is not None and all(math.isfinite(value) for value in percentiles)
        self._slack = Slack(gain, *percentiles) if gain and known and percentiles else None

    @property
    def needs(self) -> tuple[str, ...]:
        """Prefixes of the weights that `load` reads."""
        return tuple(self._groups())

    def reset(self, scene: Scene, seed: int) -> None:
        """Forget the filter's last solution."""
        if self._filter is not None:
            self._filter.reset()

    def act(self, scene: Scene) -> Decision:
        """The policy's mean, corrected."""
        return self.choose(scene).decision

    def choose(self, scene: Scene, noise: Array | None = None, observation: Floats | None = None) -> Choice:
        """The same, and how it looks to a learner. `noise` (2,), standard normal, explores; `observation`:
        that of this scene, where it is known already.
        """
        clock = [time.perf_counter()]
        if observation is None:
            observation = observe_flat(scene, self.config.observation)
        clock.append(time.perf_counter())
        seen = torch.from_numpy(observation)[None]
        nominal = self._draw(seen, noise)
        u_rl = self.config.physical(nominal, scene)
        clock.append(time.perf_counter())
        sigma = self._sigma(seen, nominal)
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

    @torch.no_grad()
    def _draw(self, seen: torch.Tensor, noise: Array | None) -> Floats:
        mean, log_std = self._policy.distribution(self._policy.trained, seen)
        if noise is not None:
            mean = mean + log_std.exp() * torch.from_numpy(noise.astype(np.float32))
        return mean.tanh().numpy()[0]

    def _sigma(self, seen: torch.Tensor, action: Floats) -> float:
        if self._critics is None:
            return math.nan
        quantiles = self._critics.evaluate(seen, torch.from_numpy(action)[None])
        return float(uncertainty(quantiles.numpy(), self.config.learner.beta).total[0])

    def _groups(self) -> dict[str, dict[str, torch.Tensor]]:
        groups = {"policy": self._policy.trained}
        return groups if self._critics is None else groups | {"critic": self._critics.trained}


def load_learned(name: str, folder: Path) -> LearnedAgent:
    """The agent in a checkpoint's folder, which is called `name` in tables. Raises AgentError.

    Decisions are single: more than one thread would only get in the way of other processes.
    """
    torch.set_num_threads(1)
    checkpoint = load_agent(folder)
    return LearnedAgent(name, checkpoint.config, checkpoint.arrays, checkpoint.percentiles)
