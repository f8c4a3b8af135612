"""Corrections of the two numbers in [-1, 1] that a policy proposes, before they become an acceleration and a
steering angle: the paper's baselines USL, QPSL and Recovery RL (appendix "Safe Reinforcement Learning").
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from typing import Literal, cast

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from rudc.agents.seat import ADJUSTMENT, Correction, CorrectionKind, Critics, Percentiles, Proposal
from rudc.arrays import Floats
from rudc.env.action import ActionKind
from rudc.env.reward import scene_cost
from rudc.errors import AgentError
from rudc.safety.corrected import Corrected
from rudc.safety.guarded import answer_of
from rudc.safety.qp import Problem, SolverName, make_solver
from rudc.world.scene import Scene


class UslSettings(CorrectionKind):
    """Unrolled corrections (paper, appendix "Unrolling Safety Layer"; Zhang et al., 2023): a <- a - step g /
    max |g| while Q_c(s, a) > d_th, where g is the gradient of Q_c at a. d_th is the agent's limit in
    training.
    """

    kind: Literal["usl"] = "usl"
    steps: int = Field(default=20, ge=1, le=1000)
    """K, corrections of one action at most"""
    step: float = Field(default=0.05, gt=0, le=2)
    """eta, by how much one correction changes the number of the action with the larger gradient"""

    @property
    def asks(self) -> tuple[str, ...]:
        """Q_c - d_th and its gradient."""
        return ("excess",)

    def make(
        self, arrays: Mapping[str, NDArray], percentiles: Percentiles = None, action: ActionKind = ADJUSTMENT
    ) -> Correction:
        """The correction; it needs none of `arrays`."""
        return UslCorrection(self, action)


class RecoverySettings(CorrectionKind):
    """Recovery RL (paper, appendix "Safety Recovery"; Thananjeyan et al., 2021): where the risk of the task
    policy's action exceeds a limit, the recovery policy acts instead.
    """

    kind: Literal["recovery"] = "recovery"
    cost_limit: float = Field(default=0.2, ge=0)
    """d_th, the largest Q_risk(s, a) at which the task policy acts: discounted sum of step-wise costs"""

    @property
    def asks(self) -> tuple[str, ...]:
        """Q_risk and the recovery policy."""
        return ("cost", "recovery")

    def make(
        self, arrays: Mapping[str, NDArray], percentiles: Percentiles = None, action: ActionKind = ADJUSTMENT
    ) -> Correction:
        """The correction; it needs none of `arrays`."""
        return RecoveryCorrection(self, action)


class QpslSettings(CorrectionKind):
    """The safety layer (paper, appendix "Safety Layer"; Dalal et al., 2018): the action a nearest to the
    policy's with c(s) + g(s) . a <= d_th, where c(s) is the step-wise cost of the scene and g is learnt.
    """

    kind: Literal["qpsl"] = "qpsl"
    cost_limit: float = Field(default=0.2, ge=0)
    """d_th, the largest step-wise cost that the next step may have"""
    solver: SolverName = "planar"
    """QP solver: `planar`, or any that qpsolvers knows and that is installed"""

    @property
    def asks(self) -> tuple[str, ...]:
        """g, by the name of its network."""
        return ("change",)

    def make(
        self, arrays: Mapping[str, NDArray], percentiles: Percentiles = None, action: ActionKind = ADJUSTMENT
    ) -> Correction:
        """The correction; it needs none of `arrays`."""
        return QpslCorrection(self, action)


class OfActions:
    """Base of corrections of the action in [-1, 1] that a policy proposes."""

    def __init__(self, action: ActionKind) -> None:
        self._means = action

    def load(self, arrays: Mapping[str, NDArray], percentiles: Percentiles) -> None:
        """Nothing to take over: `correct` is given the critics."""

    def reset(self, scene: Scene, seed: int) -> None:
        """Nothing to reset: nothing is kept from one decision to the next."""

    @abstractmethod
    def instead(
        self, scene: Scene, observation: Floats, action: Floats, critics: Critics
    ) -> tuple[Floats, str, bool] | None:
        """Another action (2,) in [-1, 1], the status that says how it came about, and whether the limit is
        exceeded all the same; None if the proposed `action` (2,) may be taken. `critics` answers what the
        settings' `asks` names; where that is nothing, it is None in trainings.
        """

    def correct(self, scene: Scene, proposal: Proposal, critics: Critics | None) -> Corrected:
        """See `Correction`. Raises AgentError behind a driver that is not a learnt agent."""
        if proposal.action is None or proposal.observation is None:
            raise AgentError(
                f"{type(self).__name__} asks what only an agent says that has learnt with it; "
                "it cannot stand behind another driver"
            )
        asked = cast("Critics", critics)  # there is one wherever the settings' `asks` names something
        found = self.instead(scene, proposal.observation, proposal.action, asked)
        if found is None:
            return Corrected(proposal.u, np.zeros(2), "nominal")
        action, status, infeasible = found
        u = self._means.u_of(action, scene)
        return Corrected(u, u - proposal.u, status, infeasible=infeasible)


class UslCorrection(OfActions):
    """a <- psi(a), at most K times: see `UslSettings`."""

    def __init__(self, settings: UslSettings, action: ActionKind) -> None:
        super().__init__(action)
        self._settings = settings

    def instead(
        self, scene: Scene, observation: Floats, action: Floats, critics: Critics
    ) -> tuple[Floats, str, bool] | None:
        """See `OfActions`; infeasible if Q_c still exceeds the limit after K corrections."""
        excess_at, first = critics.excess_at(observation), action
        excess, slope = excess_at(action)
        for _ in range(self._settings.steps):
            largest = float(np.abs(slope).max())
            if excess <= 0 or largest == 0:
                break
            action = (action - self._settings.step / largest * slope).clip(-1, 1)
            excess, slope = excess_at(action)
        return None if action is first else (action, "unrolled", excess > 0)


class RecoveryCorrection(OfActions):
    """a_task if Q_risk(s, a_task) <= d_th, else a_recovery: see `RecoverySettings`."""

    def __init__(self, settings: RecoverySettings, action: ActionKind) -> None:
        super().__init__(action)
        self._limit = settings.cost_limit

    def instead(
        self, scene: Scene, observation: Floats, action: Floats, critics: Critics
    ) -> tuple[Floats, str, bool] | None:
        """See `OfActions`; infeasible if the recovery policy's action exceeds the limit too."""
        if critics.cost(observation, action) <= self._limit:
            return None
        other = np.tanh(critics.seen("recovery", observation)[: action.size])
        return other, "recovery", critics.cost(observation, other) > self._limit


class QpslCorrection(OfActions):
    """argmin |a' - a|^2 / 2 with c + g . a' <= d_th, a' in [-1, 1]^2: see `QpslSettings`."""

    def __init__(self, settings: QpslSettings, action: ActionKind) -> None:
        super().__init__(action)
        self._limit, self._solver = settings.cost_limit, make_solver(settings.solver)
        self._name = settings.solver

    def instead(
        self, scene: Scene, observation: Floats, action: Floats, critics: Critics
    ) -> tuple[Floats, str, bool] | None:
        """See `OfActions`; infeasible if no action keeps the limit: then the one with the least cost is
        taken.
        """
        g = critics.seen("change", observation).astype(np.float64)
        room = self._limit - scene_cost(scene)
        if g @ action <= room:
            return None
        least = -np.sign(g)
        length = float(np.linalg.norm(g))
        if g @ least > room or length == 0:
            return least.astype(np.float32), "projected", True
        one = np.ones(2)
        row, bound = -g[None] / length, np.array([-room / length])
        problem = Problem(np.eye(2), -action.astype(float), row, bound, -one, one)
        found = answer_of(self._solver, self._name, problem, scene.time_s)
        return (found.x if found.found else least).astype(np.float32), "projected", not found.found
