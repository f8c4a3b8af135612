"""Folders of learnt agents: which folder a name means, and what is in it.

The files are those of rudc/learning/checkpoint.py; settings are the tree of rudc/agents/config.py. Frozen
networks are not stored: they are rebuilt from the seed of the training.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from pydantic import ValidationError

import rudc
from rudc.agents.config import AgentConfig
from rudc.agents.variation import vary
from rudc.arrays import Arrays
from rudc.data import data_folder
from rudc.errors import AgentError
from rudc.learning.checkpoint import DESCRIPTION, Checkpoint, load_checkpoint, save_checkpoint
from rudc.learning.config import Problem
from rudc.learning.fits import misfits
from rudc.learning.parameters import fingerprint, frozen_arrays, group
from rudc.settings import problems

SHIPPED = "results/checkpoints"
"""folder of the trained agents that come with RUDC"""
LATEST = "checkpoint"
"""subfolder of a training's folder that holds its latest checkpoint"""

OF_THE_CAR = {"half_length": 2.5, "half_width": 1.0}
"""the ego's ellipse in files from before it followed the vehicle: that of a car of 5 x 1.8 m"""


class Learnt(NamedTuple):
    """A learnt agent as stored."""

    config: AgentConfig
    """its settings: how it observes, acts, learns and is corrected"""
    arrays: Arrays
    """weights, as `Learner.weights` names them"""
    percentiles: tuple[float, float] | None
    """sigma_l and sigma_h, reward units; None if unknown"""
    training: Mapping[str, Any]
    """how it was trained: settings, `seed` at least"""
    trained: Mapping[str, Any]
    """summary of its training: `steps` at least"""


def find_checkpoint(name: str) -> Path | None:
    """The checkpoint's folder that a name means: that of a shipped agent, or the folder of this name, or the
    latest checkpoint of the training in that folder; None if there is none.
    """
    shipped = shipped_checkpoints()
    if name in shipped:
        return shipped[name]
    return checkpoint_in(Path(name))


def checkpoint_in(folder: Path) -> Path | None:
    """The folder if it is a checkpoint, else the latest checkpoint of the training in it; None without
    one.
    """
    for place in (folder, folder / LATEST):
        if os.path.isfile(place / DESCRIPTION):  # unlike pathlib's, no error for names that are too long
            return place
    return None


def shipped_checkpoints() -> dict[str, Path]:
    """Name -> folder of each trained agent that comes with RUDC."""
    return {file.parent.name: file.parent for file in sorted(data_folder(SHIPPED).glob(f"*/{DESCRIPTION}"))}


def save_learnt(folder: Path, learnt: Learnt) -> None:
    """Write an agent into a folder. Raises StorageError."""
    config, seed = learnt.config, int(learnt.training["seed"])
    problem = config.problem(seed)
    save_checkpoint(
        folder,
        Checkpoint(
            settings={**config.model_dump(mode="json"), "training": dict(learnt.training)},
            arrays={k: v for k, v in learnt.arrays.items() if not k.startswith("prior/")},
            spaces=_spaces(config, problem),
            sigma=learnt.percentiles,
            prior=fingerprint(group(frozen_arrays(config.learner, problem, learnt.arrays), "prior")),
            trained=learnt.trained,
        ),
    )


def load_learnt(folder: Path) -> Learnt:
    """Read an agent. Raises AgentError."""
    stored = load_checkpoint(folder)
    settings = dict(stored.settings)
    training, correction = settings.pop("training"), settings["correction"]
    if isinstance(correction, dict) and OF_THE_CAR.items() <= correction.items():
        settings["correction"] = {k: v for k, v in correction.items() if k not in OF_THE_CAR}
    try:
        config = AgentConfig.model_validate(settings)
    except ValidationError as error:
        raise AgentError(
            problems(error, str(folder / DESCRIPTION), ()) + _from_where(error, stored)
        ) from error
    problem = config.problem(_seed(folder, training, stored))
    _check(folder, config, problem, stored)
    frozen = frozen_arrays(config.learner, problem, stored.arrays)
    if stored.prior != fingerprint(group(frozen, "prior")):
        raise AgentError(f"{folder}: the prior networks cannot be rebuilt as they were in training")
    return Learnt(config, stored.arrays | frozen, stored.sigma, training, stored.trained)


def _from_where(error: ValidationError, stored: Checkpoint) -> str:
    """The end of a message about an unknown setting: which version of RUDC it may come from."""
    if all(e["type"] != "extra_forbidden" for e in error.errors()):
        return ""
    other = stored.code != rudc.__version__
    which = f": it says {stored.code!r}, and this is {rudc.__version__}" if other else ""
    return f"; the checkpoint may be from another version of RUDC{which}"


def _seed(folder: Path, training: Any, stored: Checkpoint) -> int:
    told = isinstance(training, dict) and isinstance(stored.trained, dict) and "steps" in stored.trained
    seed = training.get("seed") if told else None
    if not isinstance(seed, int) or isinstance(seed, bool) or not 0 <= seed < 2**63:
        raise AgentError(f"{folder / DESCRIPTION}: does not say how the agent was trained (steps, seed)")
    return seed


def _check(folder: Path, config: AgentConfig, problem: Problem, stored: Checkpoint) -> None:
    """Raise AgentError if weights or spaces are not what the configuration needs; builds no networks."""
    wrong = list(misfits(config.learner, problem, stored.arrays))
    if wrong:
        more = f", and {len(wrong) - 3} more" if len(wrong) > 3 else ""
        raise AgentError(
            f"{folder}: its weights do not fit its settings (observation, networks): "
            f"{'; '.join(wrong[:3])}{more}"
        )
    if stored.spaces != _spaces(config, problem):
        raise AgentError(f"{folder / DESCRIPTION}: its spaces are not those of its observation and action")


def _spaces(config: AgentConfig, problem: Problem) -> dict[str, Any]:
    box = config.action.space()
    return {
        "observation": {"shape": [problem.layout.size]},
        "action": {"shape": list(box.shape), "low": float(box.low[0]), "high": float(box.high[0])},
    }


def learnt_summary(folder: Path) -> str:
    """What the agent is, and how long and with which seed it was trained, in two sentences."""
    learnt = load_learnt(folder)
    summary, trained = learnt.config.entry.summary, learnt.trained
    return f"{summary} Learnt in {trained['steps']} steps with seed {learnt.training['seed']}."


def learnt_settings(folder: Path, changes: Mapping[str, Any]) -> dict[str, Any]:
    """Everything that decides what a learnt agent does, with `changes` as in variation.py; it can be
    written as JSON.
    """
    learnt = load_learnt(folder)
    return {
        **vary(learnt.config, changes).model_dump(mode="json"),
        "training": dict(learnt.training),
        "weights": fingerprint(learnt.arrays),
        "sigma_percentiles": learnt.percentiles,
        "trained": dict(learnt.trained),
    }
