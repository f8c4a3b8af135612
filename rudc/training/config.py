"""Every choice in training, one stated option each."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any, Literal, Self, get_args

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from rudc.agents.algorithms import ALGORITHMS, DriverConfig, observation_layout
from rudc.env.observation import ObservationKind
from rudc.env.reward import COLLISION
from rudc.errors import InputError
from rudc.learning.config import LearnerConfig
from rudc.scenario.dotted import DottedKeyError, with_value


class _Model(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", use_attribute_docstrings=True)


class Curriculum(_Model):
    """Starts and traffic drawn anew for each training episode, instead of the scenario's own."""

    minor_share: float = Field(default=0.65, ge=0, le=1)
    """share of episodes that start on an arm which has to yield"""
    left_share: float = Field(default=0.35, ge=0, le=1)
    """share of left turns among those of an arm; its other turns share the rest equally"""
    density: tuple[float, float] = (10.0, 35.0)
    """veh/km of two-way road, uniform"""
    distance: tuple[float, float] = (25.0, 45.0)
    """m before the stop line, uniform"""


class TrainConfig(_Model):
    """How an agent is trained."""

    driver: DriverConfig = DriverConfig()
    """what is trained: observation, action, filter, networks, objective"""
    scenario: str = "random_destination"
    """shipped name or file"""
    curriculum: Curriculum | None = Curriculum()
    """what replaces the scenario's start and traffic; None keeps them"""
    collision_reward: float = Field(default=-75.0, le=0)
    """replaces the reward's collision term (the paper's is -50), in learning only"""
    filtered_share: float = Field(default=0.5, ge=0, le=1)
    """share of training episodes that are driven behind the filter, from the first on; the paper's is 1"""
    replayed: Literal["executed", "nominal"] = "executed"
    """which action critics learn about: what the filter made of the policy's, or the policy's itself"""
    steps: int = Field(default=100_000, ge=1)
    """decisions taken by the policy, rounded up to whole rounds like all that counts decisions below"""
    seed_steps: int = Field(default=8_000, ge=0)
    """decisions of the gap-acceptance driver that the replay starts with"""
    seed_noise: float = Field(default=0.1, ge=0)
    """standard deviation of what is added to its actions, in [-1, 1], so that neighbouring ones are known"""
    envs: int = Field(default=2, ge=1)
    """worlds, each in a process of its own"""
    round_decisions: int = Field(default=100, ge=1)
    """decisions of each world between two exchanges of weights and transitions (a round)"""
    update_every: int = Field(default=4, ge=1)
    """decisions for each gradient step"""
    replay_size: int = Field(default=100_000, ge=1)
    """transitions kept"""
    seed: int = Field(default=0, ge=0)
    """of everything drawn: episodes, exploration, batches, masks, initial weights"""
    device: str = "cpu"
    """where the learner computes: cpu, cuda, cuda:1, ..."""
    log_every: int = Field(default=1_000, ge=1)
    """decisions for each row of progress.csv; there is one at each checkpoint besides"""
    checkpoint_every: int = Field(default=5_000, ge=1)
    """decisions between checkpoints, where all worlds begin a new episode"""
    evaluate_every: int = Field(default=10_000, ge=1)
    """decisions between evaluations, which are checkpoints as well"""
    evaluate_on: tuple[str, ...] = ("random_destination", "dense_left_turn")
    """scenarios"""
    evaluation_episodes: int = Field(default=20, ge=0)
    """for each of them, always the same held-out seeds; 0 for no evaluation"""
    loss_limit: float = Field(default=1e6, gt=0)
    """largest magnitude of a loss or a value, reward units, beyond which training is stopped as failed"""

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if self.round_decisions < self.driver.learner.n_step:
            raise ValueError("a round must have n_step decisions at least")
        if self.driver.learner.seed != self.seed:
            raise ValueError("the learner's seed must be the same as that of training")
        return self

    @property
    def round_steps(self) -> int:
        """Decisions of all worlds in a round."""
        return self.envs * self.round_decisions

    @property
    def seed_rounds(self) -> int:
        """Rounds driven by the gap-acceptance driver."""
        return -(-self.seed_steps // self.round_steps)

    @property
    def rounds(self) -> int:
        """All rounds, those included."""
        return self.seed_rounds - (-self.steps // self.round_steps)

    @classmethod
    def default(
        cls, algorithm: str = "rudc-wo-cbf", *, learner: dict[str, Any] | None = None, **changes: Any
    ) -> Self:
        """The shipped configuration of an algorithm. `changes`: fields of this class, or of `DriverConfig`;
        `learner`: fields of `LearnerConfig`. Raises InputError.
        """
        return cls._made(LearnerConfig.quick, algorithm, learner or {}, changes)

    @classmethod
    def paper(
        cls, algorithm: str = "rudc-t", *, learner: dict[str, Any] | None = None, **changes: Any
    ) -> Self:
        """The paper as written: its observation, steering and acceleration chosen directly, attention
        networks of its size, five critics, one-step returns, every vehicle constrained by a filter in every
        episode that may accelerate as well and has no last resort, its rewards, episodes as the scenario
        draws them, and no driver to learn from. Arguments as for `default`. Raises InputError.
        """
        as_written: dict[str, Any] = {
            "observation": "paper",
            "action": "direct",
            "curriculum": None,
            "collision_reward": COLLISION,
            "seed_steps": 0,
            "filtered_share": 1.0,
        }
        if algorithm in ALGORITHMS and ALGORITHMS[algorithm].filter:
            as_written["filter_settings"] = {
                "constrained": "all",
                "max_added_acceleration": math.inf,
                "last_resort": False,
            }
        return cls._made(LearnerConfig.of, algorithm, learner or {}, {**as_written, **changes})

    @classmethod
    def _made(
        cls,
        make_learner: Callable[..., LearnerConfig],
        algorithm: str,
        learner: dict[str, Any],
        changes: dict[str, Any],
    ) -> Self:
        if algorithm not in ALGORITHMS:
            raise InputError(f"no algorithm {algorithm!r}; there are {', '.join(ALGORITHMS)}")
        own = ALGORITHMS[algorithm]
        of_driver: dict[str, Any] = {"residual": own.filter is not None, "slack_gain": own.slack_gain}
        of_driver |= {k: changes.pop(k) for k in tuple(changes) if k in DriverConfig.model_fields}
        steps, seed = changes.get("steps", cls.model_fields["steps"].default), changes.get("seed", 0)
        every = changes.get("update_every", cls.model_fields["update_every"].default)
        try:
            core = make_learner(
                observation_layout(of_driver.get("observation", "conflict")),
                **{"seed": seed, "schedule_updates": max(steps // every, 1)} | learner,
            )
            driver = DriverConfig(algorithm=algorithm, learner=core, **of_driver)
            return cls(driver=driver, **changes)
        except ValidationError as error:
            raise InputError(f"training: {_problems(error)}") from None

    def changed(self, settings: Mapping[str, Any]) -> Self:
        """With values changed at dotted keys as they stand in config.json, such as `driver.learner.n_step`.
        Another observation brings its layout along. Raises InputError.
        """
        values = self.model_dump()
        for key, value in settings.items():
            try:
                values, _ = with_value(values, key, value)
            except (DottedKeyError, TypeError) as error:
                raise InputError(f"training setting {key!r}: {error}") from None
        if "driver.observation" in settings and settings["driver.observation"] in get_args(ObservationKind):
            values["driver"]["learner"]["layout"] = observation_layout(values["driver"]["observation"])
        try:
            return type(self).model_validate(values)
        except ValidationError as error:
            raise InputError(f"training: {_problems(error)}") from None


def _problems(error: ValidationError) -> str:
    return "; ".join(
        f"{'.'.join(map(str, e['loc'])) or 'configuration'}: {e['msg'].removeprefix('Value error, ')}"
        for e in error.errors()
    )
