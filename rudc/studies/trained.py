"""Trainings that a study compares: existing ones are taken, missing ones are made.

A training is called NAME-seedN, N its training seed, and is looked for in this order:

1. in the folder of trainings (`--trainings DIR`; else `trainings` in the study's own folder). One that learnt
   with other values of what the study or the preset sets is refused; what the budget sets may differ,
2. without `--trainings`, among the agents that are shipped (NAME, NAME-seedN), if it learnt with the settings
   that are wanted, with the presets as they are now, for as long as the budget says,
3. without `--trainings`, it is trained, for as long as the budget says. A training that was cut off goes on
   from its checkpoint.

With `--trainings DIR` only those of DIR count: what is not there is left out, and named with the reason. Only
trainings that reached their end are taken. A training in the study's own folder that another budget
made, with other steps, is refused. Agents are named relative to the folder of trainings, so that a sweep's
rows say nothing of the machine: sweep within `named_from`.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from rudc.agents.checkpoint import LATEST, Learnt, find_checkpoint, load_learnt, shipped_checkpoints
from rudc.errors import InputError
from rudc.files import make_folder, past_links
from rudc.hints import install_command
from rudc.studies.base import Order
from rudc.training.config import TrainConfig
from rudc.training.presets import read_preset, set_otherwise

Tell = Callable[[str], object]


@dataclass(frozen=True)
class Wanted:
    """A training that a study needs, whatever its seed."""

    name: str
    """name of its folder, before `-seedN`"""
    algorithm: str
    changes: Mapping[str, Any] = field(default_factory=dict)
    """settings of the training that differ from its preset, by dotted keys"""
    configuration: str = "default"
    """preset"""

    def __str__(self) -> str:
        return self.name

    def config(self, settings: Mapping[str, Any] | None = None) -> TrainConfig:
        """The configuration of the training, with further settings by dotted keys; its own changes come
        first."""
        return TrainConfig.of(self.algorithm, {**(settings or {}), **self.changes}, self.configuration)


@dataclass(frozen=True)
class Trained:
    """A training that is there."""

    name: str
    seed: int
    agent: str
    """what `--agent` calls it, in the folder of trainings"""
    logs: Path
    """folder of its `progress.csv` and `evaluation.csv`"""
    steps: int
    """decisions it was trained for"""


@dataclass(frozen=True)
class Trainings:
    """What was found or trained."""

    folder: Path
    """absolute; agents' names are relative to it"""
    found: tuple[Trained, ...]
    missing: tuple[str, ...]
    """NAME-seedN of each training that does not exist, and why"""

    def of(self, name: str) -> tuple[Trained, ...]:
        """Those of one name, by seed."""
        return tuple(sorted((t for t in self.found if t.name == name), key=lambda t: t.seed))

    @contextlib.contextmanager
    def named_from(self) -> Iterator[Path]:
        """Agents' names are valid inside the block, since the working folder is that of the trainings
        there."""
        with contextlib.chdir(self.folder):
            yield self.folder


def trainings_for(
    wanted: Sequence[Wanted], seeds: Sequence[int], order: Order, settings: Mapping[str, Any], tell: Tell
) -> Trainings:
    """Every training wanted with every seed. `settings`: of those that are made, by dotted keys,
    `training.steps` at least. `tell` is told what is trained, and how far it is. Raises InputError, and
    KeyboardInterrupt when a training was stopped (its checkpoint is kept).
    """
    folder = _folder(order)
    found: list[Trained] = []
    missing: list[str] = []
    there = [(want, seed, _there(folder, want, seed, order, settings)) for want in wanted for seed in seeds]
    for want, seed, training in there:
        if isinstance(training, str) and order.trainings is None:
            _train(folder, want, seed, settings, order.resume, tell)
            training = _made(folder, want, seed, order, settings)
        if isinstance(training, str):
            missing.append(f"{want.name}-seed{seed}: {training}")
        else:
            found.append(training)
    return Trainings(folder, tuple(found), tuple(missing))


def trainings_there(
    wanted: Sequence[tuple[Wanted, int]], order: Order, settings: Mapping[str, Any]
) -> Trainings:
    """The existing trainings with these training seeds; none is made. Raises InputError."""
    folder = _folder(order)
    there = {(want.name, seed): _there(folder, want, seed, order, settings) for want, seed in wanted}
    return Trainings(
        folder,
        tuple(training for training in there.values() if isinstance(training, Trained)),
        tuple(f"{name}-seed{seed}: {why}" for (name, seed), why in there.items() if isinstance(why, str)),
    )


def _folder(order: Order) -> Path:
    """The folder of trainings; the study's own is made if need be. Raises InputError."""
    if order.trainings is not None and not order.trainings.is_dir():
        raise InputError(f"no folder {order.trainings}: give that of trainings, NAME-seedN each")
    folder = past_links(order.trainings or order.out / "trainings")
    if order.trainings is None:
        make_folder(folder)
    return folder


def _there(folder: Path, want: Wanted, seed: int, order: Order, settings: Mapping[str, Any]) -> Trained | str:
    """The training in the folder of trainings; or a shipped one, if none was named; or why not."""
    training = _made(folder, want, seed, order, settings)
    steps = _steps(order, settings)
    if isinstance(training, str) and steps is not None:
        return _shipped(want, seed, steps) or training
    return training


def _steps(order: Order, settings: Mapping[str, Any]) -> int | None:
    """Steps of the trainings that are taken; None if any number will do."""
    return None if order.trainings else int(settings["training.steps"])


def _made(folder: Path, want: Wanted, seed: int, order: Order, settings: Mapping[str, Any]) -> Trained | str:
    """The training in the folder of trainings, or why it cannot be taken. Raises InputError if the folder
    holds a different training, also one with other steps in the study's own folder.
    """
    name = f"{want.name}-seed{seed}"
    checkpoint = find_checkpoint(str(folder / name))
    if checkpoint is None:
        return "no training there"
    learnt = load_learnt(checkpoint)
    if (learnt.config.algorithm, learnt.training["seed"]) != (want.algorithm, seed):
        raise InputError(
            f"{folder / name} was trained by {learnt.config.algorithm} with seed {learnt.training['seed']}, "
            f"not by {want.algorithm} with seed {seed}"
        )
    for key, there, value in _otherwise(learnt, want, settings):
        raise InputError(f"{folder / name} was trained with {key}={there}, not {value}")
    done, planned = int(learnt.trained["steps"]), int(learnt.training["steps"])
    steps = _steps(order, settings)
    if steps is not None and planned != (wanted := want.changes.get("training.steps", steps)):
        raise InputError(
            f"{folder / name} was trained for {planned} steps, not {wanted}: give another --out, or take it "
            f"as it is with --trainings {folder}"
        )
    if done < planned:
        return f"trained for {done} of {planned} steps so far"
    logs = checkpoint.parent if checkpoint.name == LATEST else checkpoint
    return Trained(want.name, seed, f"./{name}", logs, done)


def _otherwise(learnt: Learnt, want: Wanted, settings: Mapping[str, Any]) -> Iterator[tuple[str, Any, Any]]:
    """Wanted settings with which it did not learn, by the study or by its preset, those of `settings` apart:
    key, its value, the value wanted.
    """
    stored = {**learnt.config.model_dump(mode="json"), "training": learnt.training}
    wanted = want.config().model_dump(mode="json")
    preset = set_otherwise(read_preset(want.configuration), wanted, stored)
    values = {key: _at(wanted, key) for key in preset if key not in settings} | dict(want.changes)
    for key, value in values.items():
        if (there := _at(stored, key)) != value:
            yield key, there, value


def _at(tree: Any, key: str) -> Any:
    """The value at a dotted key; None where there is none."""
    for part in key.split("."):
        tree = tree.get(part) if isinstance(tree, Mapping) else None
    return tree


def _shipped(want: Wanted, seed: int, steps: int) -> Trained | str | None:
    """A shipped training of so many steps; or why it cannot be taken; None if there is none."""
    for name in (f"{want.name}-seed{seed}", want.name):
        folder = shipped_checkpoints().get(name)
        if folder is None:
            continue
        learnt = load_learnt(folder)
        done = int(learnt.trained["steps"])
        if (learnt.config.algorithm, learnt.training["seed"]) != (want.algorithm, seed):
            continue
        if learnt.config.learner != want.config().learner or any(_otherwise(learnt, want, {})):
            return f"no training, and the shipped {name} learnt with settings that are no longer the default"
        if steps == done:
            return Trained(want.name, seed, name, folder, done)
    return None


def _train(
    folder: Path, want: Wanted, seed: int, settings: Mapping[str, Any], resume: bool, tell: Tell
) -> None:
    if find_spec("torch") is None:
        raise InputError(
            f"training {want} needs torch: {install_command('train')}; or name trainings made before: "
            "--trainings DIR"
        )
    from rudc.training.trainer import train

    config = want.config(fitting({**settings, "training.seed": seed}, want))
    name = f"{want.name}-seed{seed}"
    watcher = _Watcher(name, config.rounds * config.round_steps, tell)
    if not train(config, folder / name, watcher, resume=resume):
        raise KeyboardInterrupt


def fitting(settings: Mapping[str, Any], want: Wanted) -> dict[str, Any]:
    """The settings, without those that have no effect on a learner that states no sigma."""
    states = "sigma" in want.config().learner.offers
    return {k: v for k, v in settings.items() if states or k != "training.calibration_episodes"}


class _Watcher:
    """Says what is trained, at each tenth."""

    def __init__(self, name: str, total: int, tell: Tell) -> None:
        self._name, self._total, self._tell, self._tenths = name, total, tell, -1

    def advance(self, steps: int) -> None:
        """So many decisions were taken."""
        tenths = 10 * steps // self._total
        if tenths > self._tenths:
            self._tenths = tenths
            self._tell(f"training {self._name}, {steps} of {self._total} decisions")

    def progress(self, row: Mapping[str, Any]) -> None:
        """Nothing: it stands in the training's `progress.csv`."""

    def note(self, text: str) -> None:
        """Pass it on."""
        self._tell(f"{self._name}: {text}")
