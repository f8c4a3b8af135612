"""Corrections that learning brings along, of what a policy proposed in [-1, 1] before that is given its
meaning: the paper's baselines USL, QPSL and Recovery RL (appendix "Safe Reinforcement Learning").
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from typing import Literal

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
    max |g| while Q_c(s, a) > d_th, g its gradient there. d_th is the limit that the agent has learnt under.
    """

    kind: Literal["usl"] = "usl"
    steps: int = Field(default=20, ge=1, le=1000)
    """K, corrections of one action at most"""
    step: float = Field(default=0.05, gt=0, le=2)
    """eta, by how much a correction changes that number of the action in [-1, 1] which counts most"""

    @property
    def asks(self) -> tuple[str, ...]:
        """Q_c - d_th and its gradient."""
        return ("excess",)

    def make(
        self, arrays: Mapping[str, NDArray], percentiles: Percentiles = None, action: ActionKind = ADJUSTMENT
    ) -> Correction:
        """The loop; of `arrays` it needs none."""
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
        """The switch; of `arrays` it needs none."""
        return RecoveryCorrection(self, action)


class QpslSettings(CorrectionKind):
    """The safety layer (paper, appendix "Safety Layer"; Dalal et al., 2018): the nearest action a to the
    policy's with c(s) + g(s) . a <= d_th, c(s) the step-wise cost of the scene and g learnt.
    """

    kind: Literal["qpsl"] = "qpsl"
    cost_limit: float = Field(default=0.2, ge=0)
    """d_th, of the next step-wise cost"""
    solver: SolverName = "planar"
    """of the QP: planar, or any that qpsolvers knows and that is installed"""

    @property
    def asks(self) -> tuple[str, ...]:
        """g."""
        return ("change",)

    def make(
        self, arrays: Mapping[str, NDArray], percentiles: Percentiles = None, action: ActionKind = ADJUSTMENT
    ) -> Correction:
        """The QP; of `arrays` it needs none."""
        return QpslCorrection(self, action)


class OfActions:
    """Corrections of what a policy proposed in [-1, 1], before that is given its meaning."""

    def __init__(self, action: ActionKind) -> None:
        self._means = action

    def load(self, arrays: Mapping[str, NDArray], percentiles: Percentiles) -> None:
        """Critics come with each question."""

    def reset(self, scene: Scene, seed: int) -> None:
        """Nothing is kept from decision to decision."""

    @abstractmethod
    def instead(
        self, scene: Scene, observation: Floats, action: Floats, critics: Critics
    ) -> tuple[Floats, str, bool] | None:
        """Another action, how it came about, and whether it is infeasible all the same; None if the proposed
        one may be taken.
        """

    def correct(self, scene: Scene, proposal: Proposal, critics: Critics | None) -> Corrected:
        """See `Correction`."""
        if proposal.action is None or proposal.observation is None or critics is None:
            raise AgentError(
                f"{type(self).__name__} asks what only an agent says that has learnt with it; "
                "it cannot stand behind another driver"
            )
        found = self.instead(scene, proposal.observation, proposal.action, critics)
        if found is None:
            return Corrected(proposal.u, np.zeros(2), "nominal")
        action, status, infeasible = found
        u = self._means.u_of(action, scene)
        return Corrected(u, u - proposal.u, status, infeasible=infeasible)


class UslCorrection(OfActions):
    """a <- psi(a), K times at most."""

    def __init__(self, settings: UslSettings, action: ActionKind = ADJUSTMENT) -> None:
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
    """a_task where Q_risk(s, a_task) <= d_th, else a_recovery."""

    def __init__(self, settings: RecoverySettings, action: ActionKind = ADJUSTMENT) -> None:
        super().__init__(action)
        self._limit = settings.cost_limit

    def instead(
        self, scene: Scene, observation: Floats, action: Floats, critics: Critics
    ) -> tuple[Floats, str, bool] | None:
        """See `OfActions`; infeasible where the recovery policy's action exceeds the limit, too."""
        if critics.cost(observation, action) <= self._limit:
            return None
        other = np.tanh(critics.seen("recovery", observation)[: action.size])
        return other, "recovery", critics.cost(observation, other) > self._limit


class QpslCorrection(OfActions):
    """argmin |a' - a|^2 / 2 with c + g . a' <= d_th, a' in [-1, 1]^2."""

    def __init__(self, settings: QpslSettings, action: ActionKind = ADJUSTMENT) -> None:
        super().__init__(action)
        self._limit, self._solver = settings.cost_limit, make_solver(settings.solver)
        self._name = settings.solver

    def instead(
        self, scene: Scene, observation: Floats, action: Floats, critics: Critics
    ) -> tuple[Floats, str, bool] | None:
        """See `OfActions`; infeasible where no action is allowed: then it is the one of the least cost."""
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
