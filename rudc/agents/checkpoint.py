"""Folders of learnt agents: which is meant by a name, what is in it, how a new one takes an old one's place.

The files are those of rudc/learning/checkpoint.py; `settings` holds the fields of `DriverConfig` that
its learner and its algorithm do not say already.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from pydantic import ValidationError

from rudc.agents.algorithms import ALGORITHMS, DriverConfig
from rudc.agents.variation import vary
from rudc.arrays import Arrays
from rudc.data import data_folder
from rudc.errors import AgentError
from rudc.learning.checkpoint import DESCRIPTION, Checkpoint, load_checkpoint, save_checkpoint
from rudc.learning.parameters import fingerprint

SHIPPED = "results/checkpoints"
"""where trained agents are that come with RUDC"""
LATEST = "checkpoint"
"""subfolder of a training's folder where its latest checkpoint stands"""


class Learnt(NamedTuple):
    """A learnt agent as stored."""

    config: DriverConfig
    """how it sees and acts"""
    arrays: Arrays
    """weights, as `RudcLearner.arrays` names them"""
    percentiles: tuple[float, float] | None
    """sigma_l and sigma_h, reward units; None if unknown"""
    training: Mapping[str, Any]
    """summary of how it was trained: `steps` and `seed` at least"""


def find_checkpoint(name: str) -> Path | None:
    """The folder that a name stands for: a shipped agent's, itself, or the latest checkpoint of the training
    in it.
    """
    shipped = shipped_checkpoints()
    if name in shipped:
        return shipped[name]
    for folder in (Path(name), Path(name) / LATEST):
        if (folder / DESCRIPTION).is_file():
            return folder
    return None


def shipped_checkpoints() -> dict[str, Path]:
    """Names of the trained agents that come with RUDC, and their folders."""
    return {file.parent.name: file.parent for file in sorted(data_folder(SHIPPED).glob(f"*/{DESCRIPTION}"))}


def save_learnt(folder: Path, learnt: Learnt) -> None:
    """Write an agent into a folder. Raises StorageError."""
    config = learnt.config
    settings = config.model_dump(mode="json", exclude={"learner", "algorithm"})
    checkpoint = Checkpoint(
        config.algorithm, config.learner, learnt.arrays, learnt.percentiles, settings, learnt.training
    )
    save_checkpoint(folder, checkpoint)


def load_learnt(folder: Path) -> Learnt:
    """Read an agent. Raises AgentError."""
    stored = load_checkpoint(folder)
    try:
        values = {**stored.settings, "algorithm": stored.algorithm, "learner": stored.config}
        config = DriverConfig.model_validate(values)
    except (ValidationError, TypeError) as error:
        raise AgentError(f"{folder / DESCRIPTION}: {error}") from error
    if not {"steps", "seed"} <= stored.training.keys():
        raise AgentError(f"{folder / DESCRIPTION}: does not say how the agent was trained")
    return Learnt(config, stored.arrays, stored.sigma, stored.training)


def learnt_summary(folder: Path) -> str:
    """What drives, and how it was trained, in a sentence."""
    learnt = load_learnt(folder)
    summary, training = ALGORITHMS[learnt.config.algorithm].summary, learnt.training
    return f"{summary} Learnt in {training['steps']} steps with seed {training['seed']}."


def learnt_settings(folder: Path, changes: Mapping[str, Any]) -> dict[str, Any]:
    """Everything that decides what a learnt agent does, with `changes` as in variation.py; of what can be
    written as JSON.
    """
    learnt = load_learnt(folder)
    return {
        "driver": vary(learnt.config, changes).model_dump(mode="json"),
        "weights": fingerprint(learnt.arrays),
        "sigma_percentiles": learnt.percentiles,
        "training": dict(learnt.training),
    }
