"""The seat of whatever corrects an action: a proposal goes in, an action that may be taken comes out.

    correct(scene, proposal, critics) -> Corrected

The proposal says what would be done, in physical units and, where a policy proposed it, in [-1, 1], how
unsure the driver is, and what it saw. `critics` is what a learnt agent offers to be asked about other
actions; None behind drivers that offer nothing. A correction states what it asks of them as a protocol of its
own that goes beyond `Critics`, and refuses, by AgentError, an agent that does not offer it. So the seat stays
as it is for

    CBF filter             the one below: asks for sigma only, which the proposal carries
    safety layer (QPSL)    c(s') = c(s) + g(observation) . action with g learnt: g's weights come by `load`,
                           the QP is rudc/safety/qp.py's; asks `critics` for nothing
    unrolled corrections   action <- action - eta grad Q_c(observation, action) until Q_c <= d: asks for
    (USL)                  `cost(observation, actions (n, 2)) -> (n,)` and its gradient, or takes differences
                           of four actions of a batch for it; starts from `proposal.action`
    Recovery RL            where the risk of `proposal.action` exceeds epsilon, the recovery policy's action
                           instead: asks for `cost` and `recovery(observation) -> (2,)`

An entry in `CORRECTIONS` is a class of settings; its `make` gives the correction.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Mapping
from typing import Annotated, Any, Literal, NamedTuple, Protocol

from numpy.typing import NDArray
from pydantic import BeforeValidator, ConfigDict, Field, SerializeAsAny

from rudc.arrays import Array, Arrays, Floats
from rudc.env.action import ActionKind, Adjustment
from rudc.kinds import of_kind, read_kind
from rudc.safety.config import FilterConfig
from rudc.safety.corrected import Corrected
from rudc.safety.filter import SafetyFilter
from rudc.safety.residual import ResidualPredictor, shipped_predictor
from rudc.safety.slack import Slack
from rudc.settings import Settings
from rudc.world.scene import Scene

ADJUSTMENT = Adjustment()
"""what the numbers of a proposed action mean unless it is said otherwise"""
Percentiles = tuple[float, float] | None
RESIDUAL = "residual/"
"""what the names of the residual predictor's arrays begin with"""


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
    """What any learnt agent with critics answers."""

    def quantiles(self, observation: Floats, action: Floats) -> Floats:
        """(members, quantiles) of the return, reward units, of an action (2,) at an observation (size,)."""
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
    """Base of the settings of all corrections; subclasses have `kind`, their name in `CORRECTIONS`."""

    @property
    def asks(self) -> tuple[str, ...]:
        """What it needs of whoever drives, beyond the proposed action: `sigma`, or by the names of their
        methods what it asks critics for. Learners say what they offer (`LearnerConfig.offers`).
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


class NoCorrection(CorrectionKind):
    """What is proposed is done."""

    kind: Literal["none"] = "none"

    def make(
        self, arrays: Mapping[str, NDArray], percentiles: Percentiles = None, action: ActionKind = ADJUSTMENT
    ) -> None:
        """None."""


class SlackSettings(Settings):
    """The slack of the rows (rudc/safety/slack.py): delta = constant + delta(sigma)."""

    kind: Literal["level", "rate"] = "level"
    """what delta does: it is added to the rows, or multiplies the weight of h by exp(delta)"""
    gain: float = Field(default=0.0, ge=0, le=1e6, allow_inf_nan=False)
    """level: m2 of h towards vehicles that one is willing to give up at rest for each unit of sigma (reward
    units) below sigma_l; eta is this times the rows' weight of h, so that it means the same under each rule.
    rate: eta itself. 0: sigma decides nothing
    """
    constant: float = Field(default=0.0, ge=-1e6, le=1e6, allow_inf_nan=False)
    """level: m2 of h that one is willing to give up at rest whatever sigma is. rate: logarithm of the factor
    """

    def without_effect(self) -> Mapping[str, str]:
        """Where there is no slack, it has no kind."""
        return {} if self.gain or self.constant else {"kind": "with gain=0 and constant=0"}


class CbfSettings(FilterConfig, CorrectionKind):
    """The safety filter of control barrier functions, with predicted residuals and slack."""

    model_config = ConfigDict(extra="allow")  # rules and barriers bring settings of their own

    kind: Literal["cbf"] = "cbf"
    slack: SlackSettings = SlackSettings()
    """how much the rows are relaxed where the policy is sure"""
    residual: bool = False
    """whether rows take in the residuals that a learnt predictor expects (rudc/safety/residual.py)"""

    @property
    def asks(self) -> tuple[str, ...]:
        """With slack, sigma."""
        return ("sigma",) if self.slack.gain > 0 else ()

    def arrays(self, action: ActionKind = ADJUSTMENT) -> Arrays:
        """The residual predictor's for that kind of action, where it has one."""
        if not self.residual:
            return {}
        shipped = shipped_predictor(action.name)
        return {RESIDUAL + k: v for k, v in shipped.arrays.items()}

    def make(
        self, arrays: Mapping[str, NDArray], percentiles: Percentiles = None, action: ActionKind = ADJUSTMENT
    ) -> Correction:
        """The filter, with the residual predictor among `arrays` or else the shipped one for `action`."""
        own = any(name.startswith(RESIDUAL) for name in arrays)
        return CbfCorrection(self, arrays if own else self.arrays(action), percentiles)


class CbfCorrection:
    """u = filter(u_rl, slack delta(sigma), residuals w)."""

    def __init__(
        self, settings: CbfSettings, arrays: Mapping[str, NDArray], percentiles: Percentiles = None
    ) -> None:
        self.filter = SafetyFilter(settings)
        slack = settings.slack
        self._as_rate = slack.kind == "rate"
        unit = 1.0 if self._as_rate else float(settings.row_weights(road=False).h)
        self._eta, self._constant = slack.gain * unit, slack.constant * unit
        self._predictor = _predictor(arrays) if settings.residual else None
        self.load(arrays, percentiles)

    def load(self, arrays: Mapping[str, NDArray], percentiles: Percentiles) -> None:
        """Take over sigma_l and sigma_h; the residual predictor stays as it is."""
        self.slack = Slack(self._eta, *percentiles) if self._eta and percentiles is not None else None

    def reset(self, scene: Scene, seed: int) -> None:
        """Forget the last solution."""
        self.filter.reset()

    def correct(self, scene: Scene, proposal: Proposal, critics: Critics | None) -> Corrected:
        """See `Correction`; without sigma the slack is the constant alone."""
        stated = not math.isnan(proposal.sigma)
        slack = self._constant + (self.slack(proposal.sigma) if self.slack is not None and stated else 0.0)
        residual = None
        if self._predictor is not None:
            residual = self._predictor(scene, self.filter.constraints(scene), proposal.u)
        level, rate = (0.0, slack) if self._as_rate else (slack, 0.0)
        return self.filter.filter(scene, proposal.u, level, residual, rate)._replace(slack=slack)


CORRECTIONS: dict[str, type[CorrectionKind]] = {"none": NoCorrection, "cbf": CbfSettings}
"""name of a kind -> its settings"""


def read_correction(value: str | Mapping[str, Any] | CorrectionKind) -> CorrectionKind:
    """The settings that a name, or a mapping of `kind` and settings, stands for. Raises InputError."""
    return read_kind(value, CORRECTIONS, CorrectionKind, "correction")


CorrectionSettings = Annotated[
    SerializeAsAny[CorrectionKind],
    BeforeValidator(lambda value: of_kind(value, CORRECTIONS, CorrectionKind)),
]
"""a field that takes any correction's settings, as it takes a name or a mapping"""


def _predictor(arrays: Mapping[str, NDArray]) -> ResidualPredictor:
    """The residual predictor among an agent's arrays."""
    return ResidualPredictor(
        {k.removeprefix(RESIDUAL): v for k, v in arrays.items() if k.startswith(RESIDUAL)}
    )
