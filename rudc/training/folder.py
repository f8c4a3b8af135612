"""A training's folder. It belongs to one training alone, which may go on only from what it began with.

config.json      every choice that was made
scenarios.json   of each scenario that is trained or evaluated on: a digest of its content, and where
                 the file lies, if it is one of the user's own
code.json        digests of the code that is not RUDC's: what `--import` named, and installed packages that
                 offer events, algorithms or barriers
checkpoint/, progress.csv, evaluation.csv    see trainer.py and log.py
"""

from __future__ import annotations

import contextlib
import json
import os
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, TypeAdapter, ValidationError

from rudc.errors import InputError
from rudc.files import aside_of, make_folder, take_lock, write_atomically
from rudc.hints import listed
from rudc.imports import plugins, sources_digests
from rudc.learning.checkpoint import DESCRIPTION, SECTIONS
from rudc.scenario import load_scenario, shipped_scenarios
from rudc.settings import problems
from rudc.training.config import TrainConfig
from rudc.training.log import read_log

CONFIG, SCENARIOS, CODE = "config.json", "scenarios.json", "code.json"


class Source(BaseModel, frozen=True):
    """A scenario that a training names."""

    digest: str
    """digest of all that an episode depends on"""
    file: str | None = None
    """absolute path; None for a shipped one"""


Sources = dict[str, Source]
"""by the names that stand in the configuration"""
_SOURCES = TypeAdapter(Sources)
Code = dict[str, dict[str, dict[str, str]]]
"""`imported` and `plugins`: name -> digests, as in a sweep's manifest"""
_CODE = TypeAdapter(Code)

T = TypeVar("T")


@contextlib.contextmanager
def held(folder: Path, tell: Callable[[str], object]) -> Iterator[None]:
    """Hold a folder so that no other process writes to it; it is made if there is none. Raises InputError if
    it cannot be made or is in use; `tell` gets a warning where it cannot be locked.
    """
    make_folder(folder)
    warnings: list[str] = []
    lock = take_lock(folder, warnings)
    for text in warnings:
        tell(text)
    try:
        yield
    finally:
        if lock is not None:
            os.close(lock)


def check_folder(config: TrainConfig, folder: Path, sources: Sources, *, resume: bool) -> None:
    """Raise InputError unless the folder is empty, or holds this very training and it is to be resumed."""
    path = folder / CONFIG
    if not path.exists():
        present = sorted(entry.name for entry in folder.iterdir() if not entry.name.startswith("."))
        if present:
            raise InputError(
                f"{folder} is not empty ({', '.join(present[:4])}) and holds no training (no {CONFIG}): "
                "give another folder"
            )
        return
    if not resume:
        raise InputError(
            f"{folder} holds a training already: resume it with --resume, or give another folder"
        )
    if path.read_text(encoding="utf-8") != config_text(config):
        raise InputError(f"{folder} holds a training with other settings, see {path}")
    kept = stored_sources(folder)
    changed = [
        name for name, source in sources.items() if name in kept and kept[name].digest != source.digest
    ]
    if changed:
        raise InputError(
            f"{folder}: what it learns from has changed since it began: {listed(changed)}. Put it back as it "
            "was to resume, or train anew in another folder"
        )
    if other := _other_code(folder):
        raise InputError(
            f"{folder}: code that is not RUDC's is not what it was when the training began: {listed(other)}. "
            "To resume it, name the same files, unchanged, by --import, and install the same packages; or "
            "train anew in another folder"
        )


def refuse_lost(folder: Path, missing: Path, before: int) -> None:
    """Raise InputError if a folder without the file `missing` holds a checkpoint, or rows of steps later than
    `before`, the last ones that are written before a checkpoint: to begin anew would overwrite them.
    """
    checkpoints = [missing.parent, aside_of(missing.parent)]
    left = [place.name for place in checkpoints if os.path.lexists(place)]
    for path in (folder / "progress.csv", folder / "evaluation.csv"):
        if path.is_file() and any(int(row["steps"]) > before for row in read_log(path)):
            left.append(path.name)
    if left:
        raise InputError(
            f"{missing} is missing, so the training cannot go on; beginning anew would overwrite what there "
            f"is of it ({listed(left)}). Put the file back, or train anew in another folder"
        )


def _other_code(folder: Path) -> list[str]:
    """Files, modules and packages whose code differs from what was kept, or that only one side has."""
    kept, now = _read(folder / CODE, _CODE), _code_now()
    if kept is None:  # it began before this was kept
        return []
    found: dict[str, None] = {}
    for part, here in now.items():
        there = kept.get(part, {})
        found |= {name: None for name in [*there, *here] if there.get(name) != here.get(name)}
    return list(found)


def _code_now() -> Code:
    return {"imported": sources_digests(), "plugins": plugins()}


def keep_inputs(config: TrainConfig, folder: Path, sources: Sources) -> None:
    """Write what a training is made from; what was kept when it began stays. Raises StorageError."""
    write_atomically(folder / CONFIG, config_text(config))
    if not (folder / SCENARIOS).exists():
        write_atomically(folder / SCENARIOS, _SOURCES.dump_json(sources, indent=2) + b"\n")
    if not (folder / CODE).exists():
        write_atomically(folder / CODE, _CODE.dump_json(_code_now(), indent=2) + b"\n")


def config_text(config: TrainConfig) -> str:
    """What `config.json` says."""
    return config.model_dump_json(indent=2) + "\n"


def stored_config(folder: Path) -> TrainConfig | None:
    """The configuration of the training that a folder holds; None if it holds none."""
    try:
        return TrainConfig.model_validate_json((folder / CONFIG).read_text(encoding="utf-8"))
    except FileNotFoundError:
        return None
    except ValidationError as error:
        raise InputError(problems(error, str(folder / CONFIG), ())) from None
    except (OSError, ValueError) as error:
        raise InputError(f"{folder / CONFIG} cannot be read: {error}") from error


def stored_sources(folder: Path) -> Sources:
    """The scenarios as they were when a folder's training began; empty where nothing was kept of them."""
    return _read(folder / SCENARIOS, _SOURCES) or {}


def _read(path: Path, kind: TypeAdapter[T]) -> T | None:
    """What a file says; None if there is none."""
    try:
        return kind.validate_json(path.read_bytes())
    except FileNotFoundError:
        return None
    except ValidationError as error:
        raise InputError(problems(error, str(path))) from None
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error}") from error


def sources_now(config: TrainConfig, folder: Path) -> Sources:
    """The scenarios that a training names, as they are now; files where they lay when it began. Raises
    ScenarioError.
    """
    training, kept = config.training, stored_sources(folder)
    names = dict.fromkeys((training.scenario, *training.evaluate_on))
    return {name: _source(name, kept[name].file if name in kept else None) for name in names}


def _source(name: str, file: str | None) -> Source:
    place = file if file is not None and Path(file).is_file() else name
    scenario = load_scenario(place)
    own = place not in shipped_scenarios()
    return Source(digest=scenario.digest, file=str(scenario.path) if own else None)


def with_files(config: TrainConfig, sources: Sources) -> TrainConfig:
    """The same training, its scenarios named so that they are found from any working folder."""
    training = config.training
    where = {name: source.file or name for name, source in sources.items()}
    found = {
        "scenario": where[training.scenario],
        "evaluate_on": tuple(where[name] for name in training.evaluate_on),
    }
    return config.model_copy(update={"training": training.model_copy(update=found)})


def otherwise(checkpoint: Path, config: TrainConfig) -> list[str]:
    """Dotted keys of the settings in which a checkpoint differs from a configuration. Raises OSError or
    ValueError where its description cannot be read."""
    there = json.loads((checkpoint / DESCRIPTION).read_text(encoding="utf-8"))
    here = json.loads(json.dumps(config.model_dump(mode="json")))
    return [key for name in SECTIONS for key in _differing(name, here.get(name), there.get(name))]


def _differing(key: str, one: Any, other: Any) -> Iterator[str]:
    if isinstance(one, Mapping) and isinstance(other, Mapping):
        for name in dict.fromkeys([*one, *other]):
            yield from _differing(f"{key}.{name}", one.get(name), other.get(name))
    elif one != other:
        yield key
