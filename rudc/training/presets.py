"""Presets: trees of settings in YAML that a training starts from: `default`, `paper` or a user's file."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from rudc.agents.correction import read_correction
from rudc.errors import InputError
from rudc.hints import there_are
from rudc.learning.algorithms import ALGORITHMS, Algorithm
from rudc.scenario.yaml_text import read_yaml
from rudc.settings import meant

FOLDER = Path(__file__).parent / "presets"


def preset_names() -> tuple[str, ...]:
    """Presets that come with RUDC."""
    return tuple(sorted(file.stem for file in FOLDER.glob("[!.]*.yaml")))


def read_preset(name: str) -> dict[str, Any]:
    """The tree of a preset, by name or file. Raises InputError."""
    path = FOLDER / f"{name}.yaml"
    if not path.is_file():
        path = Path(name)
        if path.suffix not in (".yaml", ".yml"):
            raise InputError(
                f"there is no preset {name!r}{there_are(name, preset_names())}; or give a .yaml file"
            )
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: cannot be read: {error}") from None
    sheet, reports = read_yaml(text, str(path), keys="`learner` and `correction`")
    if sheet is None or reports:
        raise InputError("\n".join(map(str, reports)))
    return sheet.data


def fitting(algorithm: Algorithm, preset: Mapping[str, Any], name: str) -> dict[str, Any]:
    """Those parts of a preset, called `name`, that fit an algorithm. Left out are a correction that does not
    (and then `learns_from`), and settings that its learner does not have. A learner's setting that no
    algorithm has is refused: raises InputError.
    """
    tree = dict(preset)
    learner = tree.get("learner")
    known = set(algorithm.config.model_fields)
    if isinstance(learner, Mapping):
        _refuse_what_nobody_has(learner, known, f"preset {name!r}")
    if "correction" in tree and not _can_have(algorithm, tree["correction"], name in preset_names()):
        del tree["correction"]
        known.discard("learns_from")
    if isinstance(learner, Mapping):
        tree["learner"] = {key: value for key, value in learner.items() if key in known}
    return tree


def _can_have(algorithm: Algorithm, correction: Any, shipped: bool) -> bool:
    """Whether an algorithm takes a preset's correction: from a shipped preset only one of its own kind, from
    a user's file each that asks no more than its critics say. What is wrong in itself is refused later.
    """
    mine = algorithm.defaults.get("correction", {}).get("kind")
    kind = correction.get("kind", mine) if isinstance(correction, Mapping) else correction
    if kind == mine or shipped:
        return kind == mine
    try:
        return set(read_correction(correction).asks) <= set(algorithm.config.offers)
    except InputError:
        return True


def _refuse_what_nobody_has(learner: Mapping[str, Any], known: set[str], what: str) -> None:
    for key in learner.keys() - known:
        if not any(key in other.config.model_fields for other in ALGORITHMS.values()):
            there = (f"learner.{name}" for name in sorted(known))
            raise InputError(f"{what}: there is no setting 'learner.{key}'{meant(f'learner.{key}', there)}")


def left_out(preset: Mapping[str, Any], settings: Mapping[str, Any], before: str = "") -> Iterator[str]:
    """Dotted keys of what a preset sets and another tree of settings lacks."""
    for key, value in preset.items():
        if key not in settings:
            yield f"{before}{key}"
        elif isinstance(value, Mapping) and isinstance(settings[key], Mapping):
            yield from left_out(value, settings[key], f"{before}{key}.")


def set_otherwise(preset: Mapping[str, Any], wanted: Any, there: Any, before: str = "") -> Iterator[str]:
    """Dotted keys of those values that a preset sets and that differ between two trees of settings."""
    for key, value in preset.items():
        one, other = wanted.get(key), there.get(key)
        if isinstance(value, Mapping) and isinstance(one, Mapping) and isinstance(other, Mapping):
            yield from set_otherwise(value, one, other, f"{before}{key}.")
        elif one != other:
            yield f"{before}{key}"
