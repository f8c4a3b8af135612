"""Every choice in training, one stated option each, in the tree of settings (rudc/agents/config.py)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Self

from pydantic import Field, model_validator

from rudc.agents.config import AgentConfig, refuse_old_keys
from rudc.agents.correction import NoCorrection
from rudc.errors import InputError
from rudc.hints import there_are
from rudc.learning.algorithms import ALGORITHMS
from rudc.learning.config import Problem
from rudc.settings import Settings, changed, merged, settled
from rudc.training.presets import fitting, read_preset


class Curriculum(Settings):
    """Starts and traffic drawn anew for each training episode, instead of the scenario's own."""

    minor_share: float = Field(default=0.65, ge=0, le=1)
    """share of episodes that start on an arm which has to yield"""
    left_share: float = Field(default=0.35, ge=0, le=1)
    """share of left turns among those of an arm; its other turns share the rest equally"""
    density: tuple[float, float] = (10.0, 35.0)
    """veh/km of two-way road, uniform"""
    distance: tuple[float, float] = (25.0, 45.0)
    """m before the stop line, uniform"""


class Training(Settings):
    """How an agent is trained."""

    scenario: str = "random_destination"
    """shipped name or file; `curriculum` replaces its route, density and distance, unless it is null"""
    curriculum: Curriculum | None = Curriculum()
    """what replaces the scenario's start and traffic; None keeps them"""
    collision_reward: float = Field(default=-75.0, le=0)
    """replaces the reward's collision term (the paper's is -50), in learning only"""
    filtered_share: float = Field(default=0.5, ge=0, le=1)
    """share of training episodes that are driven with the filter, from the first episode on; the paper's is
    1"""
    outlook: bool = False
    """whether training episodes are driven with the agent's outlook, as evaluations always are; it bounds
    commands in the `filtered_share` only"""
    steps: int = Field(default=100_000, ge=1)
    """decisions taken by the policy, rounded up to whole rounds like all that counts decisions below"""
    seed_steps: int = Field(default=8_000, ge=0)
    """decisions of the gap-acceptance driver with which the replay starts"""
    seed_noise: float = Field(default=0.1, ge=0)
    """standard deviation of what is added to its actions, in [-1, 1], so that neighbouring ones are known"""
    envs: int = Field(default=2, ge=1)
    """worlds, each in a process of its own"""
    round_decisions: int = Field(default=100, ge=1)
    """decisions of each world between two exchanges of weights and transitions (a round)"""
    learning_starts: int = Field(default=2_000, ge=1)
    """decisions before learning starts, those of `seed_steps` included; priors are normalised on them"""
    update_every: int = Field(default=4, ge=1)
    """decisions for each gradient step"""
    replay_size: int = Field(default=100_000, ge=1)
    """transitions kept"""
    seed: int = Field(default=0, ge=0, lt=2**63)
    """seed of everything drawn: episodes, exploration, batches, masks, initial weights"""
    device: str = "cpu"
    """where the learner computes: cpu, cuda, cuda:1, ..."""
    log_every: int = Field(default=1_000, ge=1)
    """decisions for each row of progress.csv; there is one at each checkpoint besides"""
    checkpoint_every: int = Field(default=5_000, ge=1)
    """decisions between checkpoints, where all worlds begin a new episode"""
    evaluate_every: int = Field(default=10_000, ge=1)
    """decisions between evaluations, which are checkpoints as well"""
    evaluate_on: tuple[str, ...] = Field(default=("random_destination", "dense_left_turn"), min_length=1)
    """scenarios, none of which sweeps"""
    evaluation_episodes: int = Field(default=20, ge=0)
    """episodes for each of them, always with the same held-out seeds; 0 for no evaluation"""
    calibration_episodes: int = Field(default=50, ge=0)
    """held-out episodes for each scenario of `evaluate_on` that the final policy drives as it is deployed,
    and from which sigma_l and sigma_h are taken; 0 keeps those of the last decisions of training
    """
    loss_limit: float = Field(default=1e6, gt=0, allow_inf_nan=False)
    """largest magnitude of a loss or a value, reward units, beyond which training is stopped as failed"""

    def without_effect(self) -> Mapping[str, str]:
        """Where nobody drives first, or nothing is evaluated."""
        idle = {}
        if self.seed_steps == 0:
            idle["seed_noise"] = "with seed_steps=0"
        if self.evaluation_episodes == 0 and self.calibration_episodes == 0:
            idle["evaluate_on"] = "with evaluation_episodes=0 and calibration_episodes=0"
        return idle


class TrainConfig(AgentConfig):
    """A training: an agent, and how it is trained."""

    training: Training = Training()
    """how it is trained"""

    def without_effect(self) -> Mapping[str, str]:
        """Those of the agent, and: without correction no episode is corrected; where no sigma is stated there
        is nothing to calibrate.
        """
        idle = dict(super().without_effect())
        none = self.outlook.make() is None
        if none:
            idle["training.outlook"] = "with outlook.course=false and outlook.plant=off"
        if isinstance(self.correction, NoCorrection) and (none or not self.training.outlook):
            idle["training.filtered_share"] = "with correction.kind=none"
        if "sigma" not in self.learner.offers:
            idle["training.calibration_episodes"] = f"with {self.algorithm}, which states no sigma"
        return idle

    @model_validator(mode="after")
    def _long_enough_rounds(self) -> Self:
        if self.training.round_decisions < self.learner.n_step:
            raise ValueError("training.round_decisions must be learner.n_step at least")
        return self

    @model_validator(mode="after")
    def _learns(self) -> Self:
        training, rows = self.training, self.learner.batch_size
        starts = max(training.learning_starts, rows)
        if training.replay_size < starts:
            raise ValueError(
                f"training.replay_size {training.replay_size} must be training.learning_starts "
                f"({training.learning_starts}) and learner.batch_size ({rows}) at least"
            )
        if self.updates_until(self.rounds) == 0:
            raise ValueError(
                f"nothing is learnt in {self.rounds * self.round_steps} decisions (training.steps and "
                f"training.seed_steps): learning starts after {starts} (training.learning_starts, "
                f"learner.batch_size at least), with a gradient step every {training.update_every} "
                "(training.update_every); take more steps, or lower one of these"
            )
        return self

    @property
    def agent(self) -> AgentConfig:
        """What is trained."""
        return AgentConfig.model_validate(self.model_dump(exclude={"training"}))

    @property
    def given(self) -> Problem:
        """What the learner is given."""
        return self.problem(self.training.seed, self.updates_until(self.rounds))

    @property
    def round_steps(self) -> int:
        """Decisions of all worlds in a round."""
        return self.training.envs * self.training.round_decisions

    @property
    def seed_rounds(self) -> int:
        """Rounds driven by the gap-acceptance driver."""
        return -(-self.training.seed_steps // self.round_steps)

    @property
    def rounds(self) -> int:
        """All rounds, those of the gap-acceptance driver included."""
        return self.seed_rounds - (-self.training.steps // self.round_steps)

    def updates_until(self, rounds: int) -> int:
        """Gradient steps in the first `rounds` rounds: one every `update_every` decisions, from the round on
        before which as many decisions were taken as `learning_starts` says, and as a batch has transitions.
        """
        training, each = self.training, self.round_steps
        starts = max(training.learning_starts, self.learner.batch_size)
        first = min(-(-starts // each), rounds)
        return rounds * each // training.update_every - first * each // training.update_every

    @classmethod
    def of(cls, algorithm: str, changes: Mapping[str, Any] | None = None, preset: str = "default") -> Self:
        """The training of an algorithm that a preset describes, with values changed at dotted keys. Raises
        InputError, also where either names another algorithm.
        """
        if algorithm not in ALGORITHMS:
            raise InputError(f"there is no algorithm {algorithm!r}{there_are(algorithm, ALGORITHMS)}")
        own, changes = read_preset(preset), changes or {}
        for what, there in ((f"preset {preset!r}", own), ("training", changes)):
            if (other := there.get("algorithm", algorithm)) != algorithm:
                raise InputError(
                    f"{what}: sets algorithm to {other!r}, but {algorithm!r} is to be trained: take it out"
                )
        start = merged(ALGORITHMS[algorithm].defaults, fitting(ALGORITHMS[algorithm], own, preset))
        config = settled(cls, {"algorithm": algorithm, **start}, (), f"preset {preset!r}")
        return config.changed(changes)

    def changed(self, changes: Mapping[str, Any]) -> Self:
        """With values changed at dotted keys as they stand in config.json, such as `learner.n_step`. Raises
        InputError.
        """
        refuse_old_keys(changes, "training")
        return changed(self, changes, "training")
