"""The seat of whatever corrects an action: a proposal goes in, an action that may be taken comes out.

    correct(scene, proposal, critics) -> Corrected

The proposal says what would be done, in physical units and, where a policy proposed it, in [-1, 1], how
unsure the driver is, and what it saw. `critics` is what a learnt agent answers about other actions; None
behind drivers that offer nothing. A correction states in `asks` what it needs of them, and only agents whose
learner offers that (`LearnerConfig.offers`) may have it. So the seat stays as it is for

    cbf         the safety filter: asks for sigma only, which the proposal carries
    usl         unrolled corrections: Q_c - d_th of an action and its gradient
    qpsl        the safety layer: g of c(s') = c(s) + g . a; its QP is rudc/safety/qp.py's
    recovery    Recovery RL: the risk of an action, and what the recovery policy does

A kind is a class of settings, whose `make` gives the correction; correction.py has them by name.
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
"""what the numbers of a proposed action mean unless it is said otherwise"""
Percentiles = tuple[float, float] | None


class Proposal(NamedTuple):
    """What a driver would do."""

    u: Array
    """(2,) acceleration m/s2, front-wheel angle rad"""
    action: Floats | None = None
    """(2,) the same in [-1, 1] as the policy chose it; None of drivers that have no such action"""
    sigma: float = math.nan
    """sigma_total, reward units; nan of drivers that state none"""
    observation: Floats | None = None
    """(size,) what a policy saw"""


class Critics(Protocol):
    """What a learnt agent answers of an action (2,) at an observation (size,): rudc/learning/inference.py."""

    def quantiles(self, observation: Floats, action: Floats) -> Floats:
        """(members, quantiles) of the return, reward units."""
        ...

    def cost(self, observation: Floats, action: Floats) -> float:
        """What the cost critics expect, the larger of them; of learners that offer `cost`."""
        ...

    def excess_at(self, observation: Floats) -> Callable[[Floats], tuple[float, Floats]]:
        """Gives Q_c - d_th of an action, and its gradient (2,); of learners that offer `excess`."""
        ...

    def seen(self, network: str, observation: Floats) -> Floats:
        """Outputs of a network of the observation alone, by its name in `LearnerConfig.observers`."""
        ...


class Correction(Protocol):
    """Corrects actions, one decision after the other."""

    def load(self, arrays: Mapping[str, NDArray], percentiles: Percentiles) -> None:
        """Take over what training has changed: weights, named as in a checkpoint, and sigma_l, sigma_h."""
        ...

    def reset(self, scene: Scene, seed: int) -> None:
        """Begin a new episode."""
        ...

    def correct(self, scene: Scene, proposal: Proposal, critics: Critics | None) -> Corrected:
        """What to do instead; `u` is the proposal's own where nothing needs correction."""
        ...


class CorrectionKind(Settings):
    """Base of the settings of all corrections; subclasses have `kind`, their name (correction.py)."""

    @property
    def asks(self) -> tuple[str, ...]:
        """What it needs of whoever drives, beyond the proposed action, by the names of
        `LearnerConfig.offers`: `sigma`, `cost`, `excess`, or a network's name.
        """
        return ()

    def arrays(self, action: ActionKind = ADJUSTMENT) -> Arrays:
        """Weights of its own that a trained agent takes along, named as in a checkpoint: others may be
        shipped one day. `action`: what the proposed numbers mean.
        """
        return {}

    @abstractmethod
    def make(
        self, arrays: Mapping[str, NDArray], percentiles: Percentiles = None, action: ActionKind = ADJUSTMENT
    ) -> Correction | None:
        """The correction; None if there is none. `arrays` and `percentiles` as for `Correction.load`,
        `action` as for `arrays`.
        """
