"""The agent that drives by a learnt policy: observation -> policy -> uncertainty of the critics ->
correction.

    a       = tanh(mean of the policy), in [-1, 1]^2; while it explores, a sample instead
    u_rl    = the nominal action that a stands for (rudc/env/action.py)
    sigma   = sigma_total of the critics at (observation, a), or that by route (rudc/agents/route_sigma.py)
    u       = u_rl after correction (rudc/agents/correction.py)

It needs numpy only; torch is for learning.
"""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rudc.agents.base import Decision, Urged
from rudc.agents.checkpoint import load_learnt
from rudc.agents.config import AgentConfig
from rudc.agents.correction import make_correction
from rudc.agents.route_sigma import RouteSigma
from rudc.agents.seat import Proposal
from rudc.agents.variation import vary
from rudc.arrays import Floats
from rudc.env.observation import observe_flat
from rudc.errors import AgentError
from rudc.learning.inference import Decider
from rudc.learning.parameters import grouped, policy_arrays
from rudc.world.config import EgoDriver
from rudc.world.scene import Scene


class Chosen(NamedTuple):
    """A decision, and what a learner needs to learn from it."""

    decision: Decision
    observation: Floats
    """(size,) the flat observation"""
    executed: Floats
    """(2,) the action after correction, in [-1, 1]"""
    proposed: Floats
    """(2,) what the policy proposed, in [-1, 1]"""


class LearnedAgent(Urged):
    """Drives by a learnt policy."""

    ego_driver: EgoDriver = "agent"

    def __init__(
        self,
        name: str,
        config: AgentConfig,
        arrays: Mapping[str, NDArray],
        percentiles: tuple[float, float] | None = None,
    ) -> None:
        """`arrays` and `percentiles`: see `load`. Arrays named `residual/...` are those of the residual
        predictor, which later calls of `load` do not change; without them, the shipped predictor is taken.
        """
        self.name = name
        self.config = config
        self._decider = Decider(config.learner, config.problem().layout, arrays)
        self.correction = make_correction(config.correction, arrays, percentiles, config.action)
        self.load(arrays, percentiles)

    def load(self, arrays: Mapping[str, NDArray], percentiles: tuple[float, float] | None = None) -> None:
        """Take over weights, named as in `Learner.weights`, among them those of sigma by route, and
        sigma_l and sigma_h of sigma_total (`percentiles`). Without critics there is no sigma, and no
        slack that depends on it. As long as sigma by route has not been fitted (in training), sigma is
        the paper's.
        """
        self._decider.refresh(arrays)
        self._route = RouteSigma.among(arrays)
        self._states: Literal["paper", "route"] = "paper"
        if self.config.sigma == "route" and self._route is not None:
            self._states, percentiles = "route", self._route.percentiles
        if self.correction is not None:
            self.correction.load(arrays, percentiles)

    def reset(self, scene: Scene, seed: int) -> None:
        """Begin a new episode."""
        if self.correction is not None:
            self.correction.reset(scene, seed)

    def act(self, scene: Scene) -> Decision:
        """The decision for the mean of the policy, corrected."""
        return self.choose(scene).decision

    def choose(
        self,
        scene: Scene,
        rng: np.random.Generator | None = None,
        observation: Floats | None = None,
        *,
        correcting: bool = True,
    ) -> Chosen:
        """As `act`, with what a learner needs. With `rng`, the action is a sample of the policy
        (exploration). `observation`: that of this scene, if it is known already; `correcting`: False
        leaves out the correction.
        """
        clock = [time.perf_counter()]
        if observation is None:
            observation = observe_flat(scene, self.config.observation)
        clock.append(time.perf_counter())
        proposed = self._decider.action(observation, rng)
        own = u_rl = self.config.action.u_of(proposed, scene)
        if self.urge is not None:
            u_rl = self.urge(scene, own)
        clock.append(time.perf_counter())
        unsure = self._decider.uncertainty(observation, proposed)
        by_route = None if unsure is None or self._route is None else self._route.of(scene, unsure)
        stated = by_route if self._states == "route" else unsure
        clock.append(time.perf_counter())
        if self.correction is None or not correcting:
            u, corrected = u_rl, None
        else:
            sigma = math.nan if stated is None else float(stated.total)
            proposal = Proposal(u_rl, proposed, sigma, observation)
            critics = self._decider if self._decider.has_critics else None
            corrected = self.correction.correct(scene, proposal, critics)
            u = corrected.u
        same = u[0] == own[0] and u[1] == own[1]
        executed = proposed if same else self.config.action.action_of(u, scene).astype(np.float32)
        clock.append(time.perf_counter())
        parts = ("observation", "policy", "critic", "correction")
        timing = {part: 1000.0 * float(clock[i + 1] - clock[i]) for i, part in enumerate(parts)}
        decision = Decision(u, u_rl, unsure, corrected, timing, by_route, self._states)
        return Chosen(decision, observation, executed, proposed)


def untrained(config: AgentConfig, seed: int = 0) -> LearnedAgent:
    """An agent whose policy has learnt nothing yet."""
    policy = policy_arrays(config.learner, config.problem(seed))
    return LearnedAgent("untrained", config, grouped(policy=policy))


def load_learned(name: str, folder: Path, changes: Mapping[str, Any]) -> LearnedAgent:
    """The agent in a checkpoint's folder with `changes` of its settings as in variation.py, called `name` in
    tables. Raises AgentError, also if `sigma` is `route` but sigma by route was never fitted.
    """
    learnt = load_learnt(folder)
    config = vary(learnt.config, changes)
    if config.sigma == "route" and RouteSigma.among(learnt.arrays) is None:
        raise AgentError(
            f"{name}: sigma=route needs what is usual along the route, which was never measured: "
            f"`rudc agent calibrate {folder} --write` does so"
        )
    return LearnedAgent(name, config, learnt.arrays, learnt.percentiles)
