"""Learning algorithms by name, and `DriverConfig`: all that decides how a learnt policy drives.

What a policy's action (2,) in [-1, 1] means, by `action`:

    direct       -1 and 1 are the vehicle's limits on both axes, as in rudc/env/action.py
    adjustment   acceleration: a_max x for x >= 0, -a_min x below, so that 0 coasts;
                 steering: that of a driver who follows the path (rudc/agents/tracking.py) + adjustment y

The second leaves to learning what is hard, when to go, and lets it deviate from the path where that helps.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, Self

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, field_serializer, field_validator, model_validator

from rudc.agents.tracking import steering
from rudc.arrays import Array, Floats
from rudc.env.action import to_normalised, to_physical
from rudc.env.observation import PARTS, Kind, observation_size
from rudc.errors import InputError
from rudc.learning.config import LearnerConfig, ObservationLayout
from rudc.safety.config import FilterConfig
from rudc.world.scene import Scene

FilterSettings = dict[str, bool | int | float | str]


@dataclass(frozen=True, slots=True)
class Algorithm:
    """What sets one learning algorithm apart from the others."""

    summary: str
    """in a sentence"""
    filter: Literal["ttcbf", "ecbf"] | None
    """safety filter behind the policy, in training and after"""
    slack_gain: float = 0.0
    """eta of delta(sigma) that its training starts from, see `DriverConfig`"""


ALGORITHMS = {
    "rudc-t": Algorithm("RUDC with truncated Taylor control barrier functions.", "ttcbf", 0.05),
    "rudc-e": Algorithm("RUDC with exponential control barrier functions.", "ecbf", 0.04),
    "rudc-wo-cbf": Algorithm("RUDC without a safety filter.", None),
}
"""name -> what it is"""


def observation_layout(kind: Kind) -> ObservationLayout:
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
    observation: Kind = "conflict"
    """the paper's observation, or the same with predicted conflicts"""
    action: Literal["direct", "adjustment"] = "adjustment"
    """what the policy's two numbers mean, see above"""
    adjustment: float = Field(default=0.1, gt=0)
    """rad, largest change of the path follower's steering (`adjustment` only)"""
    filtering: bool = True
    """whether the algorithm's filter is at work; False takes it away"""
    filter_settings: FilterSettings = {}
    """fields of `FilterConfig` that differ from the preset; infinity is written "inf", which JSON lacks"""
    residual: bool = False
    """whether the filter gets the residuals that a learnt predictor expects (rudc/safety/residual.py)"""
    slack_gain: float = Field(default=0.0, ge=0)
    """eta of delta(sigma), m2 per step over reward units; 0 leaves the slack out"""
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
            _ = self.filter  # evaluated once, so that bad settings are refused here
        except InputError as error:
            raise ValueError(str(error)) from None
        return self

    @property
    def filter(self) -> FilterConfig | None:
        """Settings of the safety filter behind the policy; None without one."""
        kind = ALGORITHMS[self.algorithm].filter
        if kind is None or not self.filtering:
            return None
        return FilterConfig.preset(kind, **self.filter_settings)

    def physical(self, action: Array | Floats, scene: Scene) -> Array:
        """(2,) acceleration m/s2 and front-wheel angle rad that an action (2,) stands for, within limits."""
        body = scene.vehicle
        if self.action == "direct":
            return to_physical(np.asarray(action, dtype=float), body)
        x, y = (min(max(float(value), -1.0), 1.0) for value in action)
        delta = steering(scene) + self.adjustment * y
        delta = min(max(delta, -body.delta_max), body.delta_max)
        return np.array([(body.a_max if x >= 0 else -body.a_min) * x, delta])

    def normalised(self, u: Array, scene: Scene) -> Array:
        """(2,) the action in [-1, 1] that stands for u (2,), or for the nearest that any action reaches."""
        body = scene.vehicle
        if self.action == "direct":
            return to_normalised(u, body)
        a = float(u[0])
        x = a / (body.a_max if a >= 0 else -body.a_min)
        y = (float(u[1]) - steering(scene)) / self.adjustment
        return np.array([min(max(x, -1.0), 1.0), min(max(y, -1.0), 1.0)])
