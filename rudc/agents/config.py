"""`AgentConfig`: all that decides how a learnt agent sees, acts, learns and is corrected.

With the settings of training (rudc/training/config.py) it forms one tree of settings:

    algorithm, observation, action, sigma, correction, outlook, learner, training

Keys are dotted, such as `learner.n_step` or `correction.slack.gain`. They are the same in `rudc train --set
KEY=VALUE`, in config.json and agent.json, and behind an agent's name (rudc/agents/variation.py). The
layout of the observation, seeds and the schedule of the learning rates are no settings: they follow from
others.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, Literal, Self

from pydantic import Field, SerializeAsAny, ValidationInfo, field_validator, model_validator

from rudc.agents.correction import CorrectionSettings, NoCorrection
from rudc.agents.outlook import OutlookSettings
from rudc.env.action import ActionSettings, Adjustment
from rudc.env.observation import PARTS, ObservationKind
from rudc.errors import InputError
from rudc.learning.algorithms import ALGORITHMS, Algorithm, AlgorithmName
from rudc.learning.config import LearnerConfig, ObservationLayout, Problem
from rudc.settings import Settings


class AgentConfig(Settings):
    """Settings of a learnt agent."""

    algorithm: AlgorithmName = "rudc-wo-cbf"
    """algorithm by which it learns, see rudc/learning/algorithms.py"""
    observation: ObservationKind = "conflict"
    """the paper's observation, or the same with predicted conflicts"""
    action: ActionSettings = Adjustment()
    """what the two numbers of the policy's action mean, see rudc/env/action.py"""
    sigma: Literal["paper", "route"] = "paper"
    """which uncertainty it uses after training: sigma_total, as in the paper, or sigma_total compared
    with what is usual at its place on the route (rudc/agents/route_sigma.py)"""
    correction: CorrectionSettings = NoCorrection()
    """the correction of its actions, see rudc/agents/correction.py"""
    outlook: OutlookSettings = OutlookSettings()
    """how the world is shown to it, see rudc/agents/outlook.py"""
    learner: SerializeAsAny[LearnerConfig] = Field(default_factory=dict, validate_default=True)  # pyright: ignore[reportAssignmentType] -- read below
    """networks and objective: the settings of the algorithm itself"""

    @field_validator("learner", mode="before")
    @classmethod
    def _of_the_algorithm(cls, value: Any, info: ValidationInfo) -> Any:
        if "algorithm" not in info.data:  # refused already
            return LearnerConfig()
        own = ALGORITHMS[info.data["algorithm"]].config
        return value if isinstance(value, own) else own.model_validate(value)

    def without_effect(self) -> Mapping[str, str]:
        """`learner.learns_from`, without a correction: then the executed action is the proposed one."""
        if not isinstance(self.correction, NoCorrection):
            return {}
        return {"learner.learns_from": "with correction.kind=none: what is executed is what was proposed"}

    @model_validator(mode="after")
    def _states_what_is_asked(self) -> Self:
        unsaid = [what for what in self.correction.asks if what not in self.learner.offers]
        if unsaid:
            raise ValueError(
                f"the correction asks the critics for {' and '.join(unsaid)}, which those of "
                f"{self.algorithm!r} do not say"
            )
        if self.sigma == "route" and "sigma" not in self.learner.offers:
            raise ValueError(f"sigma=route: the critics of {self.algorithm!r} state no sigma")
        return self

    @property
    def entry(self) -> Algorithm:
        """The entry of its algorithm."""
        return ALGORITHMS[self.algorithm]

    def problem(self, seed: int = 0, updates: int = 1) -> Problem:
        """The problem that its learner gets: layout of the observation, number of actions, seed, updates."""
        actions = int(self.action.space().shape[0])
        return Problem(observation_layout(self.observation), actions, seed, updates)


def observation_layout(kind: ObservationKind) -> ObservationLayout:
    """The layout of a flat observation: how many numbers each part has."""
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


RENAMED = {
    "filter": "correction.kind (cbf or none)",
    "filtering": "correction.kind (cbf or none)",
    "slack_gain": "correction.slack.gain",
    "replayed": "learner.learns_from",
    "backup": "correction.last_resort",
    "backup_margin": "correction.last_resort_margin",
}
"""last part of a key of earlier versions -> what it is called now"""


def refuse_old_keys(keys: Iterable[str], what: str) -> None:
    """Raise InputError, with the present name, for a key of an earlier version."""
    for key in keys:
        new = RENAMED.get(key.rpartition(".")[2])
        if new is not None and not new.startswith(key):
            raise InputError(f"{what}: there is no setting {key!r}; it is called {new}")
