"""`AgentConfig`: all that decides how a learnt agent sees, acts, learns and is corrected.

It is a part of one tree of settings, with training (rudc/training/config.py):

    algorithm, observation, action, sigma, correction, outlook, learner, training

Keys are dotted, `learner.n_step`, `correction.slack.gain`, and the same in `rudc train --set KEY=VALUE`, in
config.json and agent.json, and behind an agent's name (rudc/agents/variation.py). What follows from the
settings is not among them: the layout of the observation, seeds, the schedule of the learning rates.
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
    """What a learnt agent is."""

    algorithm: AlgorithmName = "rudc-wo-cbf"
    """what it learns by, see rudc/learning/algorithms.py"""
    observation: ObservationKind = "conflict"
    """the paper's observation, or the same with predicted conflicts"""
    action: ActionSettings = Adjustment()
    """what the policy's numbers mean, see rudc/env/action.py"""
    sigma: Literal["paper", "route"] = "paper"
    """what it calls its uncertainty once it has learnt: sigma_total, as in the paper, or that compared with
    what is usual where it is on its route (rudc/agents/route_sigma.py)"""
    correction: CorrectionSettings = NoCorrection()
    """what corrects its actions, see rudc/agents/correction.py"""
    outlook: OutlookSettings = OutlookSettings()
    """what it is shown of the world, see rudc/agents/outlook.py"""
    learner: SerializeAsAny[LearnerConfig] = Field(default_factory=dict, validate_default=True)  # pyright: ignore[reportAssignmentType] -- read below
    """networks and objective, of the algorithm's own"""

    @field_validator("learner", mode="before")
    @classmethod
    def _of_the_algorithm(cls, value: Any, info: ValidationInfo) -> Any:
        if "algorithm" not in info.data:  # refused already
            return LearnerConfig()
        own = ALGORITHMS[info.data["algorithm"]].config
        return value if isinstance(value, own) else own.model_validate(value)

    def without_effect(self) -> Mapping[str, str]:
        """Without correction, what is executed is what was proposed."""
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
        """The algorithm that it names."""
        return ALGORITHMS[self.algorithm]

    def problem(self, seed: int = 0, updates: int = 1) -> Problem:
        """What its learner is given."""
        actions = int(self.action.space().shape[0])
        return Problem(observation_layout(self.observation), actions, seed, updates)


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
    """InputError with the present spelling, where a key is that of an earlier version."""
    for key in keys:
        new = RENAMED.get(key.rpartition(".")[2])
        if new is not None and not new.startswith(key):
            raise InputError(f"{what}: there is no setting {key!r}; it is called {new}")
