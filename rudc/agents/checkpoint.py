"""Checkpoint folders: `agent.safetensors` (weights) and `agent.json` (all else that the agent is).

Nothing in them is code. Frozen priors are not stored: they are rebuilt from the seed and recognised by their
fingerprint. A folder is written aside and then takes its place under its name, so that whoever reads it, or
comes back after a kill, finds a whole one. Torch is imported only to rebuild priors.
"""

from __future__ import annotations

import json
import os
import shutil
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError
from safetensors import SafetensorError
from safetensors.numpy import load_file, save_file

import rudc
from rudc.agents.algorithms import ALGORITHMS, DriverConfig
from rudc.agents.learning.config import LearnerConfig
from rudc.agents.learning.parameters import fingerprint
from rudc.errors import AgentError, StorageError

WEIGHTS, DESCRIPTION = "agent.safetensors", "agent.json"
LATEST = "checkpoint"
"""subfolder of a training's folder where its latest checkpoint stands"""


class Checkpoint(NamedTuple):
    """What a folder holds."""

    config: DriverConfig
    arrays: dict[str, NDArray]
    """weights by name, as `RudcLearner.arrays` names them"""
    percentiles: tuple[float, float] | None
    """sigma_l and sigma_h, reward units; None if unknown"""
    training: dict[str, Any]
    """summary of how it was trained"""


def find_checkpoint(name: str) -> Path | None:
    """The folder that a name stands for: itself, or the latest checkpoint of a training in it."""
    for folder in (Path(name), Path(name) / LATEST):
        if (folder / DESCRIPTION).is_file():
            return folder
    return None


def save_agent(folder: Path, checkpoint: Checkpoint) -> None:
    """Write the agent's two files into a folder."""
    description = {
        "rudc": rudc.__version__,
        "driver": checkpoint.config.model_dump(mode="json"),
        "observation": checkpoint.config.learner.layout.size,
        "prior": _prior_fingerprint(checkpoint.config.learner),
        "sigma_percentiles": checkpoint.percentiles,
        "training": checkpoint.training,
    }
    try:
        folder.mkdir(parents=True, exist_ok=True)
        save_file({k: np.ascontiguousarray(v) for k, v in checkpoint.arrays.items()}, folder / WEIGHTS)
        (folder / DESCRIPTION).write_text(json.dumps(description, indent=2) + "\n", encoding="utf-8")
    except OSError as error:
        raise StorageError(f"{folder}: the checkpoint could not be written: {error}") from error


def load_agent(folder: Path) -> Checkpoint:
    """Read a checkpoint folder. Raises AgentError."""
    try:
        description = json.loads((folder / DESCRIPTION).read_text(encoding="utf-8"))
        arrays = load_file(folder / WEIGHTS)
        config = DriverConfig.model_validate(description["driver"])
        percentiles = description["sigma_percentiles"]
        prior, training = description["prior"], description["training"]
    except (OSError, ValueError, KeyError, TypeError, SafetensorError) as error:
        what = (
            f"{error.error_count()} settings are wrong" if isinstance(error, ValidationError) else str(error)
        )
        raise AgentError(f"{folder} is not a checkpoint that can be read: {what}") from error
    if prior != _prior_fingerprint(config.learner):
        raise AgentError(f"{folder}: the priors rebuilt from the seed are not those trained with")
    return Checkpoint(config, arrays, None if percentiles is None else tuple(percentiles), training)


def replace_folder(new: Path, old: Path) -> None:
    """Let the folder `new` take the place of `old`; at any time one of them stands there or aside."""
    aside = aside_of(old)
    try:
        if old.exists():
            shutil.rmtree(aside, ignore_errors=True)
            os.replace(old, aside)
        os.replace(new, old)
        shutil.rmtree(aside, ignore_errors=True)
    except OSError as error:
        raise StorageError(f"{old}: the checkpoint could not be put in place: {error}") from error


def aside_of(folder: Path) -> Path:
    """Where the old folder stands while it is being replaced."""
    return folder.with_name(folder.name + ".old")


def learnt_summary(folder: Path) -> str:
    """What drives, and how it was trained, in a sentence."""
    checkpoint = load_agent(folder)
    algorithm, training = checkpoint.config.algorithm, checkpoint.training
    return (
        f"{ALGORITHMS[algorithm].summary} Learnt in {training['steps']} steps with seed {training['seed']}."
    )


def learnt_settings(folder: Path) -> dict[str, Any]:
    """Everything that decides what a learnt agent does; of what can be written as JSON."""
    checkpoint = load_agent(folder)
    return {
        "driver": checkpoint.config.model_dump(mode="json"),
        "weights": fingerprint(checkpoint.arrays),
        "sigma_percentiles": checkpoint.percentiles,
        "training": checkpoint.training,
    }


def _prior_fingerprint(config: LearnerConfig) -> str:
    from rudc.agents.learning.ensemble import prior_arrays

    return fingerprint(prior_arrays(config))
