"""A trained agent as a folder: `agent.safetensors` (weights) and `agent.json` (everything else). No pickle.

agent.json:
    format          number of this layout
    algorithm       its name, as `rudc train` takes it
    configuration   of the learner (config.py)
    spaces          shapes and bounds of observation and action
    settings        how it is used: observation kind, meaning of the action, filter; written by the trainer
    sigma           sigma_l and sigma_h, 95th and 97.5th percentile of the uncertainty; null: not measured
    prior           digest of the frozen prior networks, which are rebuilt from their seed and must match it
    weights         digest of the arrays in agent.safetensors: a mixture of two checkpoints is noticed
    code            version that wrote it
    training        summary: steps, episodes, success rate, whatever the trainer reports

The training state for resuming (optimisers, targets, generators, replay) stands apart, see `save_state`.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError
from safetensors import SafetensorError
from safetensors.numpy import load_file, save

import rudc
from rudc.arrays import Arrays
from rudc.errors import AgentError
from rudc.files import make_folder, write_atomically
from rudc.learning.config import LearnerConfig
from rudc.learning.parameters import fingerprint, prior_arrays

FORMAT = 1
WEIGHTS, DESCRIPTION = "agent.safetensors", "agent.json"


@dataclass(frozen=True)
class Checkpoint:
    """A trained agent."""

    algorithm: str
    """name, as `rudc train` takes it"""
    config: LearnerConfig
    """of the learner"""
    arrays: Arrays
    """weights, as `RudcLearner.arrays` gives them"""
    sigma: tuple[float, float] | None = None
    """sigma_l and sigma_h, reward units; None where not measured"""
    settings: Mapping[str, Any] = field(default_factory=dict)
    """how the agent is used; plain JSON values"""
    training: Mapping[str, Any] = field(default_factory=dict)
    """summary of its training; plain JSON values"""
    code: str = rudc.__version__
    """version of the code that wrote it"""


def save_checkpoint(folder: Path, checkpoint: Checkpoint) -> None:
    """Write a checkpoint; an older one in that folder is replaced file by file, never left half-written.

    Raises StorageError, or InputError when there cannot be such a folder.
    """
    make_folder(folder)
    config = checkpoint.config
    description = {
        "format": FORMAT,
        "algorithm": checkpoint.algorithm,
        "configuration": config.model_dump(mode="json"),
        "spaces": {
            "observation": {"shape": [config.layout.size]},
            "action": {"shape": [config.actions], "low": -1.0, "high": 1.0},
        },
        "settings": dict(checkpoint.settings),
        "sigma": None
        if checkpoint.sigma is None
        else dict(zip(("low", "high"), checkpoint.sigma, strict=True)),
        "prior": fingerprint(prior_arrays(config)),
        "weights": fingerprint(checkpoint.arrays),
        "code": checkpoint.code,
        "training": dict(checkpoint.training),
    }
    save_state(folder / WEIGHTS, checkpoint.arrays)
    text = json.dumps(description, indent=2, allow_nan=False) + "\n"
    write_atomically(folder / DESCRIPTION, text)


def load_checkpoint(folder: Path) -> Checkpoint:
    """Read a checkpoint. AgentError says what is missing or does not fit."""
    try:
        description = json.loads((folder / DESCRIPTION).read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        raise AgentError(f"{folder}: no checkpoint here ({DESCRIPTION} is missing)") from error
    except (OSError, ValueError) as error:
        raise AgentError(f"{folder / DESCRIPTION}: cannot be read: {error}") from error
    if not isinstance(description, dict) or description.get("format") != FORMAT:
        raise AgentError(f"{folder / DESCRIPTION}: is not a checkpoint of format {FORMAT}")
    arrays = load_state(folder / WEIGHTS)
    try:
        config = LearnerConfig.model_validate(description["configuration"])
        sigma = description["sigma"]
        checkpoint = Checkpoint(
            algorithm=description["algorithm"],
            config=config,
            arrays=arrays,
            sigma=None if sigma is None else (float(sigma["low"]), float(sigma["high"])),
            settings=description["settings"],
            training=description["training"],
            code=description["code"],
        )
        digests = description["weights"], description["prior"]
    except (ValidationError, KeyError, TypeError, ValueError) as error:
        raise AgentError(f"{folder / DESCRIPTION}: {error}") from error
    if digests[0] != fingerprint(arrays):
        raise AgentError(f"{folder}: {WEIGHTS} and {DESCRIPTION} are not of the same checkpoint")
    if digests[1] != fingerprint(prior_arrays(config)):
        raise AgentError(f"{folder}: the prior networks cannot be rebuilt as they were in training")
    return checkpoint


def save_state(path: Path, arrays: Mapping[str, NDArray]) -> None:
    """Write named arrays to a .safetensors file, whole or not at all. Raises StorageError."""
    write_atomically(path, save({name: np.asarray(value, order="C") for name, value in arrays.items()}))


def load_state(path: Path) -> Arrays:
    """Read what `save_state` wrote. AgentError if that is not possible."""
    try:
        return load_file(path)
    except FileNotFoundError as error:
        raise AgentError(f"{path}: is missing") from error
    except (OSError, SafetensorError) as error:
        raise AgentError(f"{path}: cannot be read: {error}") from error
