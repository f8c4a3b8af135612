"""A learnt policy at the wheel: observation -> policy -> uncertainty of the critics -> safety filter.

    a       = tanh(mean of the policy)            [-1, 1]^2; while it explores, a sample instead
    u_rl    = what a means (`DriverConfig.physical`)
    sigma   = sigma_total of the critics at (observation, a)
    w       = what the filter's prediction lacks (rudc/safety/residual.py)
    u       = filter(u_rl, slack delta(sigma), residuals w)

Needs numpy only; torch is for learning.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rudc.agents.algorithms import DriverConfig
from rudc.agents.base import Decision, EgoDriver
from rudc.agents.checkpoint import load_learnt
from rudc.agents.variation import vary
from rudc.arrays import Arrays, Floats
from rudc.env.observation import observe_flat
from rudc.learning.inference import Decider
from rudc.learning.parameters import policy_arrays
from rudc.learning.uncertainty import Uncertainty, uncertainty
from rudc.safety.filter import SafetyFilter
from rudc.safety.residual import ResidualPredictor, shipped_predictor
from rudc.safety.slack import Slack
from rudc.world.scene import Scene

RESIDUAL = "residual/"
"""what the names of the residual predictor's arrays begin with"""


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
        """`arrays` and `percentiles`: see `load`; arrays named `residual/...` are the residual predictor's,
        which stays as it is. Without them, the shipped one's are taken.
        """
        self.name = name
        self.config = config
        self._decider = Decider(config.learner, arrays)
        settings = config.filter
        self._filter = None if settings is None else SafetyFilter(settings)
        self._predictor = None
        if config.residual and self._filter is not None:
            self._predictor = ResidualPredictor(residual_arrays(arrays))
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
        self,
        scene: Scene,
        rng: np.random.Generator | None = None,
        observation: Floats | None = None,
        *,
        filtering: bool = True,
    ) -> Choice:
        """The same, and how it looks to a learner. With `rng` it explores; `observation`: that of this scene,
        where it is known already; `filtering`: False leaves out the filter.
        """
        clock = [time.perf_counter()]
        if observation is None:
            observation = observe_flat(scene, self.config.observation)
        clock.append(time.perf_counter())
        nominal = self._decider.action(observation, rng)
        u_rl = self.config.physical(nominal, scene)
        clock.append(time.perf_counter())
        unsure = self._uncertainty(observation, nominal)
        clock.append(time.perf_counter())
        if self._filter is None or not filtering:
            u, action, filtered = u_rl, nominal, None
        else:
            slack = self._slack(float(unsure.total)) if self._slack and unsure else 0.0
            residual = None
            if self._predictor is not None:
                residual = self._predictor(scene, self._filter.constraints(scene), u_rl)
            filtered = self._filter.filter(scene, u_rl, slack, residual)
            u = filtered.u
            same = np.array_equal(u, u_rl)
            action = nominal if same else self.config.normalised(u, scene).astype(np.float32)
        clock.append(time.perf_counter())
        parts = ("observation", "policy", "critic", "filter")
        timing = {part: 1000.0 * float(clock[i + 1] - clock[i]) for i, part in enumerate(parts)}
        return Choice(Decision(u, u_rl, unsure, filtered, timing), observation, action, nominal)

    def _uncertainty(self, observation: Floats, action: Floats) -> Uncertainty | None:
        if not self._critics:
            return None
        return uncertainty(self._decider.quantiles(observation, action), self.config.learner.beta)


def residual_arrays(arrays: Mapping[str, NDArray]) -> Arrays:
    """The residual predictor's among an agent's arrays; the shipped one's if there are none."""
    own = {k.removeprefix(RESIDUAL): v for k, v in arrays.items() if k.startswith(RESIDUAL)}
    return own or dict(shipped_predictor().arrays)


def untrained(config: DriverConfig) -> LearnedAgent:
    """An agent whose policy has learnt nothing yet."""
    arrays = {f"policy/{name}": value for name, value in policy_arrays(config.learner).items()}
    return LearnedAgent("untrained", config, arrays)


def load_learned(name: str, folder: Path, changes: Mapping[str, Any]) -> LearnedAgent:
    """The agent in a checkpoint's folder with `changes` of its settings as in variation.py, called `name` in
    tables. Raises AgentError.
    """
    learnt = load_learnt(folder)
    return LearnedAgent(name, vary(learnt.config, changes), learnt.arrays, learnt.percentiles)
