"""What is wrong with a scenario and where, in words that someone who writes YAML understands."""

from __future__ import annotations

import inspect
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, get_args

from pydantic import ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails

from rudc.hints import did_you_mean, nearest
from rudc.scenario.base import FileModel
from rudc.scenario.choices import WordChoice
from rudc.scenario.distributions import FORMS, Choice, Constant, Normal, SharedChoice, Uniform
from rudc.scenario.dotted import Path
from rudc.scenario.events.registry import EVENT_KINDS, tag_of
from rudc.scenario.selectors import ByArm
from rudc.scenario.shared import SharedNumber
from rudc.scenario.units import unit_of

_FORMS: dict[str, type[FileModel]] = {
    f"<{model.__name__.lower()}>": model
    for model in (Constant, Uniform, Normal, Choice, SharedNumber, SharedChoice)
}
_FORMS |= {"<words>": WordChoice, "<by arm>": ByArm}
_PAIR = {"mean": 0, "std": 1}
"""places in [mean, std]"""


@dataclass(frozen=True)
class Problem:
    """One thing that is wrong."""

    path: Path
    """the key it is about, which is not in the data where it is missing"""
    text: str
    """what is wrong"""
    on_key: bool = False
    """whether the key itself is wrong rather than its value"""


def describe(error: ValidationError, model: type[FileModel], data: Any) -> list[Problem]:
    """Every problem that pydantic found in data."""
    details = error.errors(include_url=False)
    problems = [_describe(detail, model, data) for detail in details]
    misspelt = {
        (problem.path[:-1], near)
        for problem, detail in zip(problems, details, strict=True)
        if detail["type"] == "extra_forbidden" and (near := nearest(problem.path[-1], _known(detail, model)))
    }
    # A required key that is there but misspelt is one problem, not two.
    return [
        problem
        for problem, detail in zip(problems, details, strict=True)
        if not (detail["type"] == "missing" and (problem.path[:-1], problem.path[-1]) in misspelt)
    ]


FIXED = ("name", "description", "out_of_distribution", "extends", "sweep")
"""keys of a file that cannot be swept"""


def got(value: Any) -> str:
    """What a file has in a place, in words."""
    match value:
        case None:
            return "nothing"
        case bool():
            return f"the truth value {str(value).lower()}"
        case str():
            return f"the text {value[:57] + '...' if len(value) > 60 else value!r}"
        case int() | float():
            return f"the number {value}"
        case Mapping():
            return "a mapping"
        case _:
            return "a list"


def _describe(detail: ErrorDetails, model: type[FileModel], data: Any) -> Problem:
    loc, value, kind = detail["loc"], detail["input"], detail["type"]
    context = detail.get("ctx", {})
    path = _path((*loc, *context.get("at", ())), data)
    match kind:
        case "refused":
            return Problem(path, context["message"], on_key=context["on_key"])
        case "missing" if isinstance(loc[-1], int):
            return Problem(_path(loc[:-1], data), f"expected 2 values, got {loc[-1]}")
        case "missing":
            return Problem((*_path(loc[:-1], data), loc[-1]), "is missing, and it is required")
        case "extra_forbidden":
            return Problem((*_path(loc[:-1], data), loc[-1]), _unknown(detail, model), on_key=True)
        case "distribution":
            return _not_a_distribution(path, value, _number(loc, model))
        case "event_kind":
            return _not_an_event(path, value)
        case "model_type" | "model_attributes_type" | "dict_type":
            keys = ", ".join(_keys(_model_at(loc, model))) if kind != "dict_type" else ""
            return Problem(path, f"expected a mapping{f' (keys: {keys})' if keys else ''}, got {got(value)}")
        case "list_type" | "tuple_type" if path[:1] == ("sweep",) and isinstance(value, Mapping):
            key = f"{path[-1]}.{next(iter(value), 'KEY')}"
            return Problem(path, f"expected a list of values, got a mapping; the key is written `{key}`")
        case "float_type" | "float_parsing":
            forms = f", {FORMS}" if "<constant>" in loc else ""
            return Problem(path, f"expected {_number(loc, model)}{forms}; got {got(value)}")
    if "<role>" in loc:
        context = {**context, "form": " or {from: ARM, turn: ..., type: ...}"}
    if "<word>" in loc:
        context = {**context, "form": " or {choice: [...]}"}
    elif path[:1] and path[0] not in FIXED and path[-1] != "name":
        context = {**context, "may_be_swept": True}
    return Problem(path, _in_words(kind, value, context, detail["msg"]))


def _number(loc: Sequence[str | int], model: type[FileModel]) -> str:
    """`a number in m/s` where the number at an error's location has a unit, else `a number`."""
    within = next((i for i, part in enumerate(loc) if part in _FORMS), len(loc))
    names = [i for i, part in enumerate(loc[:within]) if isinstance(part, str)]
    here = _model_at(loc[: names[-1]], model) if names and "weights" not in loc else None
    field = None if here is None else _named(here).get(str(loc[names[-1]]))
    unit = "" if field is None else unit_of(field)
    return f"a number in {unit}" if unit else "a number"


def _in_words(kind: str, value: Any, context: dict[str, Any], message: str) -> str:
    match kind:
        case "bool_type":
            return f"expected true or false, got {got(value)}"
        case "finite_number":
            return f"expected a finite number, got {value}"
        case "string_type":
            return f"expected text{context.get('form', '')}, got {got(value)}{_not_drawn(value, context)}"
        case "string_too_short":
            return "must not be empty"
        case "literal_error":
            options = re.findall(r"'([^']*)'", context["expected"])
            near = did_you_mean(value, options) if isinstance(value, str) else ""
            form, why = context.get("form", ""), _not_drawn(value, context)
            return f"expected one of {', '.join(options)}{form}; got {got(value)}{near}{why}"
        case "tuple_type" | "list_type":
            return f"expected a list, got {got(value)}"
        case "too_long":
            return f"expected {context['max_length']} values, got {context['actual_length']}"
    return message


def _not_drawn(value: Any, context: Mapping[str, Any]) -> str:
    """What there is instead, where a distribution stands for a word that cannot be drawn; else nothing."""
    drawn = isinstance(value, Mapping) and value and set(value) <= {"uniform", "normal", "choice"}
    if not drawn or "choice" in context.get("form", ""):
        return ""
    instead = "; to run several values, list them under `sweep`" if "may_be_swept" in context else ""
    return f"; a distribution cannot stand here{instead}"


def _unknown(detail: ErrorDetails, model: type[FileModel]) -> str:
    key, known = detail["loc"][-1], _known(detail, model)
    if key == "<<":
        return "YAML's merge key is not understood here; use `extends`"
    if key == "weights" and known == ["choice"]:
        return "stands within `choice`: {choice: {values: [...], weights: [...]}}"
    section = _section_of(key, model)
    meant = did_you_mean(key, known) or (f" (did you mean '{section}.{key}'?)" if section else "")
    return "unknown key" + (meant or f"; known here: {', '.join(known)}")


def _section_of(key: str | int, model: type[FileModel]) -> str | None:
    """The section of a file that knows a key, if one does."""
    inner = {name: field.annotation for name, field in model.model_fields.items()}
    sections = ((name, part) for name, part in inner.items() if inspect.isclass(part))
    return next((name for name, part in sections if issubclass(part, FileModel) and key in _keys(part)), None)


def _not_a_distribution(path: Path, value: Any, number: str) -> Problem:
    forms = ("uniform", "normal", "choice", "shared")
    if isinstance(value, Mapping) and len(value) == 1 and (near := did_you_mean(next(iter(value)), forms)):
        return Problem((*path, next(iter(value))), f"unknown distribution{near}", on_key=True)
    given = [form for form in forms if isinstance(value, Mapping) and form in value]
    return Problem(path, f"expected {number}, {FORMS}; got {' and '.join(given) or got(value)}")


def _not_an_event(path: Path, value: Any) -> Problem:
    if not isinstance(value, Mapping):
        return Problem(
            path, f"expected an event, such as {{kind: hard_brake, vehicle: leader}}; got {got(value)}"
        )
    if "kind" not in value:
        near = nearest("kind", [key for key in value if isinstance(key, str)])
        if near:
            return Problem((*path, near), "unknown key (did you mean 'kind'?)", on_key=True)
        return Problem((*path, "kind"), f"is missing, and it is required; one of {', '.join(EVENT_KINDS)}")
    kind = value["kind"]
    if not isinstance(kind, str):
        return Problem((*path, "kind"), f"expected a kind of event, got {got(kind)}")
    meant = did_you_mean(kind, list(EVENT_KINDS)) or (
        f"; there are {', '.join(EVENT_KINDS)}; "
        "one of your own comes with `rudc --import FILE.py COMMAND ...`"
    )
    return Problem((*path, "kind"), f"unknown kind of event {kind!r}{meant}")


def _path(loc: Sequence[str | int], data: Any) -> Path:
    """Where in the data an error is; what else pydantic's location has (tags, short forms) is passed over."""
    path: Path = ()
    here = data
    for part in loc:
        if isinstance(here, list) and part in _PAIR:
            part = _PAIR[str(part)]
        inside = isinstance(here, Mapping) and part in here
        if inside or (isinstance(here, list) and isinstance(part, int) and part < len(here)):
            here = here[part]  # pyright: ignore[reportCallIssue, reportArgumentType] - the key fits, see above
            path = (*path, part)
    return path


def _known(detail: ErrorDetails, model: type[FileModel]) -> list[str]:
    """Keys that would have been understood where an unknown one stands."""
    return _keys(_model_at(detail["loc"][:-1], model))


def _keys(model: type[FileModel] | None) -> list[str]:
    return [] if model is None else list(_named(model))


def _named(model: type[FileModel]) -> dict[str, FieldInfo]:
    """Key -> field."""
    return {field.alias or name: field for name, field in model.model_fields.items()}


def _model_at(loc: Sequence[str | int], model: type[FileModel]) -> type[FileModel] | None:
    """What the mapping at an error's location is made of."""
    here: type[FileModel] | None = model
    tags = _FORMS | {tag_of(kind): event for kind, event in EVENT_KINDS.items()}
    for part in loc:
        if part in tags:
            here = tags[str(part)]
        elif isinstance(part, str) and here is not None:
            named = _named(here)
            here = _model_in(named[part].annotation) if part in named else None
    return here


def _model_in(annotation: Any) -> type[FileModel] | None:
    """The model that values of an annotated field are made of."""
    if inspect.isclass(annotation) and issubclass(annotation, FileModel):
        return annotation
    found = (_model_in(argument) for argument in get_args(annotation))
    return next((model for model in found if model is not None), None)
