"""Corrections by name. seat.py says what a correction is given and what it returns.

An entry in `CORRECTIONS` is a class of settings; its `make` gives the correction. Algorithms may bring
further corrections (`Algorithm.corrections`); those of the paper's baselines are in of_actions.py.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any, Literal, Self

from numpy.typing import NDArray
from pydantic import BeforeValidator, ConfigDict, Field, SerializeAsAny, model_validator

from rudc.agents.base import Agent, layers
from rudc.agents.guarded import GuardedCorrection
from rudc.agents.seat import ADJUSTMENT, Correction, CorrectionKind, Critics, Percentiles, Proposal
from rudc.arrays import Arrays
from rudc.env.action import ActionKind
from rudc.errors import AgentError
from rudc.imports import is_own
from rudc.kinds import Kinds, of_kind, read_kind
from rudc.learning.algorithms import ALGORITHMS
from rudc.safety.barrier import STEP
from rudc.safety.config import FilterConfig
from rudc.safety.corrected import Corrected
from rudc.safety.filter import SafetyFilter
from rudc.safety.residual import ResidualPredictor, shipped_predictor
from rudc.safety.slack import Slack
from rudc.settings import Settings
from rudc.world.scene import Scene

RESIDUAL = "residual/"
"""beginning of the names of the residual predictor's arrays"""


class NoCorrection(CorrectionKind):
    """No correction: the proposed action is applied."""

    kind: Literal["none"] = "none"

    def make(
        self, arrays: Mapping[str, NDArray], percentiles: Percentiles = None, action: ActionKind = ADJUSTMENT
    ) -> None:
        """None: there is no correction."""


class SlackSettings(Settings):
    """The slack of the rows (rudc/safety/slack.py): delta = constant + delta(sigma)."""

    kind: Literal["level", "rate"] = "level"
    """what delta does: it is added to the rows, or multiplies the weight of h by exp(delta)"""
    gain: float = Field(default=0.0, ge=0, le=1e6, allow_inf_nan=False)
    """gain of delta(sigma); with 0, sigma has no effect. With `level`: m2 of h towards vehicles that may
    be lost at rest for each unit of sigma (reward units) below sigma_l; eta is this times the rows'
    weight of h, so that it means the same with each rule. With `rate`: eta itself
    """
    constant: float = Field(default=0.0, ge=-1e6, le=1e6, allow_inf_nan=False)
    """slack that does not depend on sigma. With `level`: m2 of h towards vehicles that may be lost at
    rest. With `rate`: logarithm of the factor on the weight of h
    """

    def without_effect(self) -> Mapping[str, str]:
        """`kind`, where there is no slack."""
        return {} if self.gain or self.constant else {"kind": "with gain=0 and constant=0"}


class CbfSettings(FilterConfig, CorrectionKind):
    """The safety filter of control barrier functions, with predicted residuals and slack."""

    model_config = ConfigDict(extra="allow")  # rules and barriers bring settings of their own

    kind: Literal["cbf"] = "cbf"
    slack: SlackSettings = SlackSettings()
    """how much the rows are relaxed where the policy is sure"""
    residual: bool = False
    """whether rows contain the residuals w that a learnt predictor gives (rudc/safety/residual.py)"""

    @model_validator(mode="after")
    def _residuals_are_of_its_steps(self) -> Self:
        if self.residual and self.dt != STEP:
            raise ValueError(
                f"residuals are predicted for steps of {STEP:g} s, not of dt={self.dt:g}; add residual=off"
            )
        return self

    @property
    def asks(self) -> tuple[str, ...]:
        """sigma, if the slack depends on it."""
        return ("sigma",) if self.slack.gain > 0 else ()

    def arrays(self, action: ActionKind = ADJUSTMENT) -> Arrays:
        """The arrays of the shipped residual predictor for that kind of action, if `residual` is on."""
        if not self.residual:
            return {}
        shipped = shipped_predictor(action.name)
        return {RESIDUAL + k: v for k, v in shipped.arrays.items()}

    def make(
        self, arrays: Mapping[str, NDArray], percentiles: Percentiles = None, action: ActionKind = ADJUSTMENT
    ) -> Correction:
        """The filter; its residual predictor, if any, is the one in `arrays`, else the shipped one."""
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
        """Take over sigma_l and sigma_h (`percentiles`); the residual predictor stays as it is."""
        self.slack = Slack(self._eta, *percentiles) if self._eta and percentiles is not None else None

    def reset(self, scene: Scene, seed: int) -> None:
        """Begin a new episode."""
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


CORRECTIONS: dict[str, type[CorrectionKind]] = {
    "none": NoCorrection,
    "cbf": CbfSettings,
}
"""name of a kind of correction (`correction.kind=NAME`) -> class of its settings"""


def known_corrections() -> Kinds[CorrectionKind]:
    """`CORRECTIONS`, and the corrections that algorithms bring; these are imported only when they are
    used.
    """
    brought = {kind: place for a in ALGORITHMS.values() for kind, place in a.corrections.items()}
    return {**CORRECTIONS, **brought, **CORRECTIONS}  # ours first, and not replaced by what is brought


def read_correction(value: str | Mapping[str, Any] | CorrectionKind) -> CorrectionKind:
    """The settings that a name, or a mapping of `kind` and settings, stands for. Raises InputError."""
    return read_kind(value, known_corrections(), CorrectionKind, "correction")


def make_correction(
    settings: CorrectionKind,
    arrays: Mapping[str, NDArray],
    percentiles: Percentiles = None,
    action: ActionKind = ADJUSTMENT,
) -> Correction | None:
    """The correction that `settings.make` gives, its answers checked if it is not RUDC's; None without
    one.
    """
    made = settings.make(arrays, percentiles, action)
    if made is None or not is_own(made):
        return made
    return GuardedCorrection(made, type(settings).model_fields["kind"].default)


def refuse_other_steps(agent: Agent, held_s: float) -> None:
    """Raise AgentError if a filter of the agent is for actions that are held for another time than `held_s`
    s.
    """
    for layer in layers(agent):
        made = getattr(layer, "correction", None)
        if isinstance(made, CbfCorrection):
            refuse_other_step(made.filter.config.dt, held_s, agent.name, "correction.dt")


def refuse_other_step(dt: float, held_s: float, who: str, key: str) -> None:
    """Raise AgentError if a filter is for actions that are held for `dt` s, but the world holds them for
    `held_s` s. `who` and `key` are for the message: whose filter it is, and which setting `dt` is.
    """
    if not math.isclose(dt, held_s):
        raise AgentError(
            f"{who}: the filter expects actions that are held for dt={dt:g} s, but this world holds them "
            f"for {held_s:g} s; give {key}={held_s:g}"
        )


CorrectionSettings = Annotated[
    SerializeAsAny[CorrectionKind],
    BeforeValidator(lambda value: of_kind(value, known_corrections(), CorrectionKind)),
]
"""type of a field for the settings of any correction; it takes a name or a mapping, too"""


def _predictor(arrays: Mapping[str, NDArray]) -> ResidualPredictor:
    """The residual predictor among an agent's arrays."""
    return ResidualPredictor(
        {k.removeprefix(RESIDUAL): v for k, v in arrays.items() if k.startswith(RESIDUAL)}
    )
