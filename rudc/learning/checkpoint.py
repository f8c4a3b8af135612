"""A trained agent as a folder: `agent.safetensors` (weights) and `agent.json` (everything else). No pickle.

agent.json:
    format          number of this layout
    algorithm, observation, action, correction, outlook, learner, training
                    what was set, key by key as in config.json; nothing that follows from it
    spaces          shapes and bounds of observation and action
    sigma           kind, as was set; low and high: sigma_l and sigma_h, 95th and 97.5th percentile of
                    sigma_total; null: not measured. Older files have no kind, or null
    prior           digest of the frozen prior networks, which are rebuilt from the seed and must match it
    weights         digest of the arrays in agent.safetensors: a mixture of two checkpoints is noticed
    code            version that wrote it
    trained         summary: steps, updates, whatever the trainer reports

The training state for resuming (optimisers, targets, generators, replay) stands apart, see `save_state`.
"""

from __future__ import annotations

import json
import math
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from safetensors import SafetensorError
from safetensors.numpy import load_file, save

import rudc
from rudc.arrays import Arrays
from rudc.errors import AgentError
from rudc.files import make_folder, replacing, write_atomically
from rudc.learning.parameters import fingerprint

FORMAT = 2
WEIGHTS, DESCRIPTION = "agent.safetensors", "agent.json"
SIGMA = "sigma"
SECTIONS = ("algorithm", "observation", "action", "correction", "outlook", "learner", "training")
"""sections of the settings, besides SIGMA"""


@dataclass(frozen=True)
class Checkpoint:
    """A trained agent, as stored."""

    settings: Mapping[str, Any]
    """`SECTIONS` and SIGMA, plain JSON values"""
    arrays: Arrays
    """weights, as `Learner.weights` gives them"""
    spaces: Mapping[str, Any] = field(default_factory=dict)
    """shapes and bounds of observation and action; plain JSON values"""
    sigma: tuple[float, float] | None = None
    """sigma_l and sigma_h, reward units; None where not measured"""
    prior: str = ""
    """digest of the frozen networks, which are not among the stored arrays"""
    trained: Mapping[str, Any] = field(default_factory=dict)
    """summary of its training; plain JSON values"""
    code: str = rudc.__version__
    """version of the code that wrote it"""


def save_checkpoint(folder: Path, checkpoint: Checkpoint) -> None:
    """Write a checkpoint. An older one in that folder stays as it was until both new files are on the disk.

    Raises StorageError, or InputError when there cannot be such a folder.
    """
    make_folder(folder)
    low, high = checkpoint.sigma or (None, None)
    description = {
        "format": FORMAT,
        **{name: checkpoint.settings[name] for name in SECTIONS},
        "spaces": dict(checkpoint.spaces),
        SIGMA: {"kind": checkpoint.settings[SIGMA], "low": low, "high": high},
        "prior": checkpoint.prior,
        "weights": fingerprint(checkpoint.arrays),
        "code": checkpoint.code,
        "trained": dict(checkpoint.trained),
    }
    text = json.dumps(description, indent=2, allow_nan=False) + "\n"
    with replacing(folder / WEIGHTS) as file:
        file.write(_as_bytes(checkpoint.arrays))
        file.flush()
        os.fsync(file.fileno())
        write_atomically(folder / DESCRIPTION, text)  # so that one rename follows the other


def load_checkpoint(folder: Path) -> Checkpoint:
    """Read a checkpoint. AgentError says what is missing or does not fit."""
    try:
        description = json.loads((folder / DESCRIPTION).read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        raise AgentError(f"{folder}: no checkpoint here ({DESCRIPTION} is missing)") from error
    except (OSError, ValueError, RecursionError) as error:
        raise AgentError(f"{folder / DESCRIPTION}: cannot be read: {error}") from error
    if not isinstance(description, dict) or description.get("format") != FORMAT:
        raise AgentError(f"{folder / DESCRIPTION}: is not a checkpoint of format {FORMAT}")
    arrays = load_state(folder / WEIGHTS)
    try:
        sigma: dict[str, Any] = description[SIGMA] or {"low": None}
        checkpoint = Checkpoint(
            settings={name: description[name] for name in SECTIONS} | {SIGMA: sigma.get("kind", "paper")},
            arrays=arrays,
            spaces=description["spaces"],
            sigma=None if sigma["low"] is None else (float(sigma["low"]), float(sigma["high"])),
            prior=description["prior"],
            trained=description["trained"],
            code=description["code"],
        )
        digest = description["weights"]
    except KeyError as error:
        raise AgentError(f"{folder / DESCRIPTION}: {error.args[0]} is missing") from error
    except (TypeError, ValueError, OverflowError, AttributeError) as error:
        raise AgentError(f"{folder / DESCRIPTION}: {error}") from error
    if checkpoint.sigma is not None and not 0 <= checkpoint.sigma[0] <= checkpoint.sigma[1] < math.inf:
        raise AgentError(f"{folder / DESCRIPTION}: sigma {checkpoint.sigma} is no range of an uncertainty")
    if digest != fingerprint(arrays):
        raise AgentError(f"{folder}: {WEIGHTS} and {DESCRIPTION} are not of the same checkpoint")
    return checkpoint


def save_state(path: Path, arrays: Mapping[str, NDArray]) -> None:
    """Write named arrays to a .safetensors file, whole or not at all. Raises StorageError."""
    write_atomically(path, _as_bytes(arrays))


def _as_bytes(arrays: Mapping[str, NDArray]) -> bytes:
    return save({name: np.asarray(value, order="C") for name, value in arrays.items()})


def load_state(path: Path) -> Arrays:
    """Read what `save_state` wrote. AgentError if that is not possible."""
    try:
        return load_file(path)
    except FileNotFoundError as error:
        raise AgentError(f"{path}: is missing") from error
    except (OSError, SafetensorError, LookupError, TypeError, ValueError, AttributeError) as error:
        raise AgentError(f"{path}: cannot be read: {error}") from error  # a kind of number numpy lacks
