"""What may stand in a scenario file, as a list to read: all of it from the models and their docstrings."""

from __future__ import annotations

import inspect
import re
from collections.abc import Container, Iterator, Mapping
from dataclasses import dataclass, replace
from types import NoneType
from typing import Any, Literal, get_args, get_origin

import yaml
from pydantic.fields import FieldInfo

from rudc.errors import InputError
from rudc.hints import did_you_mean
from rudc.scenario.base import FileModel
from rudc.scenario.distributions import Bounds, Distribution
from rudc.scenario.events import EVENT_KINDS, Event
from rudc.scenario.model import Scenario
from rudc.scenario.triggers import Conditions, OrName, Trigger
from rudc.scenario.units import bounds_of, marks_of, may_be_chosen, unit_of

_PLAIN = {int: "whole number", float: "number"}
"""what a value of a plain type is, in an event of one's own"""


@dataclass(frozen=True)
class Key:
    """One key."""

    name: str
    """dotted, as in `--set`; `[]` stands for a place in a list"""
    type: str
    """what its value is"""
    unit: str
    default: str
    """as a file would say it; `required`, or empty where there is none"""
    text: str
    """what it means"""


@dataclass(frozen=True)
class Section:
    """Keys that stand together."""

    name: str
    text: str
    keys: tuple[Key, ...]


def sections(topic: str | None = None) -> list[Section]:
    """All sections, or the one of an event's kind, of `when`, or of a part of the file by its (dotted) key;
    of `events`, or `kind`, those of all kinds. Of any other key, such as `duration`, `accident.vehicles` or
    `events.0.at`, what is said of it and of the keys in it, wherever it may stand.

    Raises InputError for an unknown topic.
    """
    whole = {name: _section(name, model, "") for name, model in _models().items()}
    if topic is None:
        return list(whole.values())
    asked, topic = topic, re.sub(r"^events\.(\d+\.)?", "", topic)
    if topic in ("events", "kind"):
        return [whole[kind] for kind in EVENT_KINDS]
    known = {**whole, **_parts()}
    last = {name.rpartition(".")[2]: name for name in reversed(known)}
    if topic in known:
        return [known[topic]]
    part = [known[last[topic]]] if topic in last else []
    listed = {name for section in part for name in (section.name, *(key.name for key in section.keys))}
    if found := [*part, *_with_key(whole, topic, listed)]:
        return found
    words = {word for section in whole.values() for key in section.keys for word in _path(key)}
    raise InputError(
        f"nothing in a scenario is called {asked!r}{did_you_mean(topic, sorted({*last, *words}))}; there are "
        f"{', '.join(sorted(last))}, and their keys"
    )


def _with_key(whole: Mapping[str, Section], topic: str, listed: Container[str]) -> list[Section]:
    """The sections with those of their keys only that are, or are in, the key that the topic names, and are
    not `listed` already. The topic's first word may be a section's name."""
    first, _, rest = topic.partition(".")
    among, wanted = ([whole[first]], rest) if rest and first in whole else (list(whole.values()), topic)
    found = []
    for section in among:
        before = "" if section.name == "scenario" else f"{section.name}."
        named = [key for key in section.keys if f".{wanted}." in f".{'.'.join(_path(key))}."]
        found.append(replace(section, keys=tuple(key for key in named if before + key.name not in listed)))
    return [section for section in found if section.keys]


def _path(key: Key) -> list[str]:
    return key.name.replace("[]", "").split(".")


def _models() -> dict[str, type[FileModel]]:
    return {"scenario": Scenario, **EVENT_KINDS, "when": Trigger}


def _parts() -> dict[str, Section]:
    inner = [*_inner(Scenario, ""), *_inner(Trigger, "when")]
    return {path: _section(path, model, f"{path}.") for path, model in inner}


def _section(name: str, model: type[FileModel], prefix: str) -> Section:
    return Section(name, (inspect.getdoc(model) or "").split("\n")[0], tuple(_keys(model, prefix)))


def _inner(model: type[FileModel], path: str) -> Iterator[tuple[str, type[FileModel]]]:
    """Dotted key and model of every mapping below a model."""
    for key, field in _fields(model):
        part, many = _model_of(field.annotation)
        if part is not None and not many:
            below = f"{path}.{key}".lstrip(".")
            yield below, part
            yield from _inner(part, below)


def _keys(model: type[FileModel], prefix: str) -> Iterator[Key]:
    for key, field in _fields(model):
        if prefix == "" and issubclass(model, Event) and key == "kind":
            continue
        name = f"{prefix}{key}"
        yield Key(name, _type(field), unit_of(field), _default(field), _one_line(field.description))
        part, many = _model_of(field.annotation)
        if part is not None and part is not Event and not issubclass(part, Conditions):
            yield from _keys(part, f"{name}[]." if many else f"{name}.")


def _fields(model: type[FileModel]) -> list[tuple[str, FieldInfo]]:
    return [(field.alias or name, field) for name, field in model.model_fields.items()]


def _one_line(text: str | None) -> str:
    return " ".join((text or "").split())


def _type(field: FieldInfo) -> str:
    """What a value is, in words."""
    bounds = bounds_of(field)
    part, many = _model_of(field.annotation)
    if part is not None:
        kinds = f"; kinds: {', '.join(EVENT_KINDS)}" if part is Event else ""
        return f"list of mappings{kinds}" if many else " | ".join([*_words(field.annotation), "mapping"])
    if bounds:
        numbers = " and ".join(dict.fromkeys(_range(bound) for bound in bounds))
        if _is_dict(field.annotation):
            return f"mapping, each {numbers}"
        name = " | name" if marks_of(field, OrName) else ""
        return f"[number, number], {numbers}" if len(bounds) == 2 else numbers + name
    words = ["true", "false"] if field.annotation is bool else _words(field.annotation)
    chosen = " | {choice: ...}" if may_be_chosen(field) else ""
    if words:
        return " | ".join(words) + chosen
    if _is_dict(field.annotation):
        return "mapping"
    return _PLAIN.get(field.annotation, "text") + chosen


def _range(bounds: Bounds) -> str:
    kind = "whole number" if bounds.whole else "number"
    return f"{kind} {'above ' if bounds.above else ''}{bounds.low:g} to {bounds.high:g}"


def _default(field: FieldInfo) -> str:
    if field.is_required():
        return "required"
    value = field.get_default(call_default_factory=True)
    plain = value
    if isinstance(value, FileModel):  # of a mapping, only keys that differ from their own defaults
        given = not isinstance(value, Distribution)
        plain = value.model_dump(mode="json", exclude_none=True, exclude_defaults=given)
    if plain in (None, "", (), {}):
        return ""
    return yaml.safe_dump(plain, default_flow_style=True, width=1000).removesuffix("...\n").strip()


def _is_dict(annotation: Any) -> bool:
    """Whether a field may hold a mapping whose keys are names of the file's choice."""
    return get_origin(annotation) is dict or any(map(_is_dict, get_args(annotation)))


def _words(annotation: Any) -> list[str]:
    """The words that may stand there."""
    if get_origin(annotation) is Literal:
        return [str(word) for word in get_args(annotation)]
    return [word for part in get_args(annotation) if part is not NoneType for word in _words(part)]


def _model_of(annotation: Any) -> tuple[type[FileModel] | None, bool]:
    """The mapping that a field holds, if it does, and whether it holds a list of them."""
    if inspect.isclass(annotation) and issubclass(annotation, FileModel):
        return (None, False) if issubclass(annotation, Distribution) else (annotation, False)
    for part in get_args(annotation):
        model, many = _model_of(part)
        if model is not None:
            return model, many or get_origin(annotation) is tuple
    return None, False
