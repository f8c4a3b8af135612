"""Learning algorithms by name, and `DriverConfig`: all that decides how a learnt policy drives."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, Self

from pydantic import BaseModel, ConfigDict, Field, field_serializer, field_validator, model_validator

from rudc.agents.correction import CbfSettings, CorrectionKind, NoCorrection
from rudc.env.action import ActionKind, Adjustment, Direct
from rudc.env.observation import PARTS, ObservationKind, observation_size
from rudc.errors import InputError
from rudc.learning.config import LearnerConfig, ObservationLayout
from rudc.safety.config import FilterConfig

FilterSettings = dict[str, bool | int | float | str]


@dataclass(frozen=True, slots=True)
class Algorithm:
    """What sets one learning algorithm apart from the others."""

    summary: str
    """in a sentence"""
    filter: Literal["ttcbf", "ecbf"] | None
    """safety filter behind the policy, in training and after"""
    slack_gain: float = 0.0
    """gain of the slack that its training starts from, see `SlackSettings`"""


ALGORITHMS = {
    "rudc-t": Algorithm("RUDC with truncated Taylor control barrier functions.", "ttcbf", 0.5),
    "rudc-e": Algorithm("RUDC with exponential control barrier functions.", "ecbf", 0.5),
    "rudc-wo-cbf": Algorithm("RUDC without a safety filter.", None),
}
"""name -> what it is"""


def observation_layout(kind: ObservationKind) -> ObservationLayout:
    """Where each part of an observation stands."""
    vehicles, vehicle = PARTS["others"]
    waypoints, waypoint = PARTS["waypoints"]
    conflict = PARTS["conflict"][0] if kind == "conflict" else 0
    return ObservationLayout(
        ego=PARTS["ego"][0],
        vehicles=vehicles,
        vehicle=vehicle,
        waypoints=waypoints,
        waypoint=waypoint,
        task=PARTS["task"][0],
        conflict=conflict,
    )


class DriverConfig(BaseModel):
    """What is seen, what an action means, what was learnt with, what corrects it."""

    model_config = ConfigDict(frozen=True, extra="forbid", use_attribute_docstrings=True)

    algorithm: str = "rudc-wo-cbf"
    """name in `ALGORITHMS`"""
    observation: ObservationKind = "conflict"
    """the paper's observation, or the same with predicted conflicts"""
    action: Literal["direct", "adjustment"] = "adjustment"
    """what the policy's two numbers mean, see rudc/env/action.py"""
    adjustment: float = Field(default=0.1, gt=0)
    """rad, largest change of the path follower's steering (`adjustment` only)"""
    filtering: bool = True
    """whether the algorithm's filter is at work; False takes it away"""
    filter_settings: FilterSettings = {}
    """fields of `FilterConfig` that differ from the preset; infinity is written "inf", which JSON lacks"""
    residual: bool = False
    """whether the filter gets the residuals that a learnt predictor expects (rudc/safety/residual.py)"""
    slack_gain: float = Field(default=0.0, ge=0)
    """gain of the slack, m2 at rest over reward units, see `SlackSettings`; 0 leaves the slack out"""
    learner: LearnerConfig = LearnerConfig.quick()
    """networks and objective"""

    @field_validator("filter_settings")
    @classmethod
    def _read_infinity(cls, settings: FilterSettings) -> FilterSettings:
        return {key: math.inf if value == "inf" else value for key, value in settings.items()}

    @field_serializer("filter_settings", when_used="json")
    def _write_infinity(self, settings: FilterSettings) -> FilterSettings:
        return {key: "inf" if value == math.inf else value for key, value in settings.items()}

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if self.algorithm not in ALGORITHMS:
            raise ValueError(f"algorithm {self.algorithm!r} is not known; there are {', '.join(ALGORITHMS)}")
        if self.learner.layout.size != observation_size(self.observation):
            raise ValueError(f"the learner's layout does not fit observation {self.observation!r}")
        needing = [name for name in ("filter_settings", "residual", "slack_gain") if getattr(self, name)]
        if needing and ALGORITHMS[self.algorithm].filter is None:
            raise ValueError(f"{needing[0]} needs a filter, and {self.algorithm!r} has none")
        try:
            _ = self.correction  # evaluated once, so that bad settings are refused here
        except InputError as error:
            raise ValueError(str(error)) from None
        return self

    @property
    def correction(self) -> CorrectionKind:
        """What corrects the policy's actions."""
        rule = ALGORITHMS[self.algorithm].filter
        if rule is None or not self.filtering:
            return NoCorrection()
        slack = {"gain": self.slack_gain}
        return CbfSettings.preset(rule, **self.filter_settings, slack=slack, residual=self.residual)

    @property
    def filter(self) -> FilterConfig | None:
        """The same, None without a filter."""
        return self.correction if isinstance(self.correction, CbfSettings) else None

    @property
    def action_kind(self) -> ActionKind:
        """What the policy's two numbers mean."""
        return Direct() if self.action == "direct" else Adjustment(adjustment=self.adjustment)
