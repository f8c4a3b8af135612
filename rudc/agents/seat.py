"""The interface of corrections: a proposal goes in, and an action that may be taken comes out.

    correct(scene, proposal, critics) -> Corrected

The proposal contains the action, in physical units and, if a policy proposed it, in [-1, 1]; how unsure the
driver is; and what it observed. `critics` answers questions about other actions; it is None behind drivers
that are not learnt, and in trainings with a correction that asks nothing. A correction states in `asks` what
it needs from the critics, and only agents whose learner offers that (`LearnerConfig.offers`) can have it. So
one interface serves

    cbf         the safety filter: it needs only sigma, which the proposal contains
    usl         unrolled corrections: they need Q_c - d_th of an action, and its gradient
    qpsl        the safety layer: it needs g of c(s') = c(s) + g . a; rudc/safety/qp.py solves its QP
    recovery    Recovery RL: it needs the risk of an action, and the action of the recovery policy

A kind of correction is a class of settings, whose `make` gives the correction; correction.py lists the
kinds by name.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Callable, Mapping
from typing import NamedTuple, Protocol

from numpy.typing import NDArray

from rudc.arrays import Array, Arrays, Floats
from rudc.env.action import ActionKind, Adjustment
from rudc.safety.corrected import Corrected
from rudc.settings import Settings
from rudc.world.scene import Scene

ADJUSTMENT = Adjustment()
"""default meaning of the two numbers of a proposed action"""
Percentiles = tuple[float, float] | None


class Proposal(NamedTuple):
    """What a driver proposes."""

    u: Array
    """(2,) acceleration m/s2, front-wheel angle rad"""
    action: Floats | None = None
    """(2,) the same in [-1, 1] as the policy chose it; None for drivers without such an action"""
    sigma: float = math.nan
    """sigma_total, reward units; nan for drivers that state none"""
    observation: Floats | None = None
    """(size,) what the policy observed; None for drivers without a policy"""


class Critics(Protocol):
    """What a learnt agent tells about an action (2,) at an observation (size,):
    rudc/learning/inference.py.
    """

    def quantiles(self, observation: Floats, action: Floats) -> Floats:
        """(members, quantiles) quantiles of the return from each critic of the ensemble, reward units."""
        ...

    def cost(self, observation: Floats, action: Floats) -> float:
        """The larger of the two cost critics' expected costs; for learners that offer `cost`."""
        ...

    def excess_at(self, observation: Floats) -> Callable[[Floats], tuple[float, Floats]]:
        """A function from an action (2,) to Q_c - d_th and its gradient (2,); for learners that offer
        `excess`.
        """
        ...

    def seen(self, network: str, observation: Floats) -> Floats:
        """Outputs of a network that takes the observation alone, by its name in `LearnerConfig.observers`."""
        ...


class Correction(Protocol):
    """Corrects actions, one decision after the other."""

    def load(self, arrays: Mapping[str, NDArray], percentiles: Percentiles) -> None:
        """Take over what training has changed: weights, named as in a checkpoint, and (sigma_l, sigma_h)."""
        ...

    def reset(self, scene: Scene, seed: int) -> None:
        """Begin a new episode."""
        ...

    def correct(self, scene: Scene, proposal: Proposal, critics: Critics | None) -> Corrected:
        """The corrected action; its `u` is that of the proposal if nothing needs correction."""
        ...


class CorrectionKind(Settings):
    """Base of the settings of all corrections; subclasses have `kind`, their name (correction.py)."""

    @property
    def asks(self) -> tuple[str, ...]:
        """What the correction needs from the driver besides the proposed action, by the names in
        `LearnerConfig.offers`: `sigma`, `cost`, `excess`, or the name of a network.
        """
        return ()

    def arrays(self, action: ActionKind = ADJUSTMENT) -> Arrays:
        """Weights of the correction that are stored with a trained agent, named as in a checkpoint, since the
        shipped weights may change in later versions. `action`: the agent's kind of action.
        """
        return {}

    @abstractmethod
    def make(
        self, arrays: Mapping[str, NDArray], percentiles: Percentiles = None, action: ActionKind = ADJUSTMENT
    ) -> Correction | None:
        """The correction; None if there is none. `arrays` and `percentiles` as for `Correction.load`,
        `action` as for `arrays`.
        """
