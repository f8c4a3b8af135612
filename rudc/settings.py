"""`Settings`: frozen configuration that holds only what has an effect.

Some settings have no effect because of the values of others. Such a setting is refused, with the reason,
where somebody sets it, and it is left out where settings are written. So a file says what was used, and two
files that differ also differ in effect. Keys are dotted, such as `learner.n_step`, and are the same wherever
a setting can be given (see `changed`).
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from copy import deepcopy
from typing import Any, Self, TypeVar

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    SerializerFunctionWrapHandler,
    ValidationError,
    model_serializer,
    model_validator,
)
from pydantic_core import InitErrorDetails, PydanticCustomError

from rudc.errors import InputError
from rudc.hints import nearest

_PLAIN = {
    r"Value error, (.*)": r"\1",
    r"Field required": "is missing, and it is required",
    r"Input should be a valid integer.*": "expected a whole number",
    r"Input should be a valid number.*": "expected a number",
    r"Input should be a valid boolean.*": "expected true or false",
    r"Input should be a valid string.*": "expected text",
    r"Input should be a valid (?:list|tuple|array).*": "expected a list",
    r"Input should be a valid dictionary.*": "expected a mapping",
    r"Input should be greater than or equal to (.*)": r"must be at least \1",
    r"Input should be less than or equal to (.*)": r"must be at most \1",
    r"Input should be (greater|less) than (.*)": r"must be \1 than \2",
    r"Input should be (.*)": r"expected \1",
}
"""a message of pydantic's -> ours"""
NO_EFFECT = "no_effect"
"""type of the validation error for a setting that has no effect"""
Tree = dict[str, Any]
M = TypeVar("M", bound=BaseModel)


def within(low: float, high: float, why: str) -> AfterValidator:
    """Refuses a number outside [low, high], and says why; None passes."""

    def check(value: float | None) -> float | None:
        if value is not None and not low <= value <= high:
            raise ValueError(f"{value:g} is not between {low:g} and {high:g}: {why}")
        return value

    return AfterValidator(check)


class Settings(BaseModel):
    """Base of the models that settings are read into."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    def keys(self) -> Iterable[str]:
        """Names of all settings."""
        return type(self).model_fields

    def without_effect(self) -> Mapping[str, str]:
        """Dotted key of each setting that has no effect because of the others -> why; subclasses override
        this."""
        return {}

    @model_validator(mode="after")
    def _refuse_what_has_no_effect(self) -> Self:
        idle = {key: why for key, why in self.without_effect().items() if _is_set(self, key)}
        if idle:
            raise ValidationError.from_exception_data(
                type(self).__name__,
                [
                    InitErrorDetails(
                        type=PydanticCustomError(NO_EFFECT, "has no effect {why}", {"why": why}),
                        loc=tuple(key.split(".")),
                        input=None,
                    )
                    for key, why in idle.items()
                ],
            )
        return self

    @model_serializer(mode="wrap")
    def _leave_out_what_has_no_effect(self, handler: SerializerFunctionWrapHandler) -> Tree:
        values = handler(self)
        for key in self.without_effect():
            section, _, name = key.rpartition(".")
            (_section(values, section) or {}).pop(name, None)
        return values


def changed(settings: M, changes: Mapping[str, Any], what: str) -> M:
    """The same settings with values changed at dotted keys. If the `kind` of a section changes, the section
    gets that kind's default values. What is said of a whole section, or of its kind, comes before what is
    said of its parts, in whatever order they are given. Settings that have no effect any more are dropped;
    one that is among the changes is refused. Messages call the settings `what`. Raises InputError, with a
    hint.
    """
    values = settings.model_dump()
    for key in sorted(changes, key=lambda key: (key.count("."), not key.endswith(".kind"))):
        _put(values, key, changes[key])
    return settled(type(settings), values, changes, what, known_keys(settings))


def settled(model: type[M], values: Tree, given: Iterable[str], what: str, known: Iterable[str] = ()) -> M:
    """Settings from a tree of values. Values that have no effect in it are left out, except at the keys that
    somebody has `given`: there they are refused. Raises InputError, with hints at `known` keys.
    """
    values, given = deepcopy(values), tuple(given)
    while True:
        try:
            return model.model_validate(values)
        except ValidationError as error:
            idle = [".".join(map(str, e["loc"])) for e in error.errors() if e["type"] == NO_EFFECT]
            inherited = [key for key in idle if not any(f"{key}.".startswith(f"{k}.") for k in given)]
            if not inherited:
                raise InputError(problems(error, what, known, given, values)) from None
            for key in inherited:
                section, _, name = key.rpartition(".")
                (_section(values, section) or {}).pop(name, None)


def merged(below: Mapping[str, Any], above: Mapping[str, Any]) -> Tree:
    """Two trees as one; values of `above` take precedence, and a section with another `kind` is replaced
    whole.
    """
    result = deepcopy(dict(below))
    for key, value in above.items():
        mine = result.get(key)
        if (
            isinstance(mine, dict)
            and isinstance(value, Mapping)
            and ("kind" not in value or value["kind"] == mine.get("kind"))
        ):
            result[key] = merged(mine, value)
        else:
            result[key] = deepcopy(value)
    return result


def known_keys(settings: BaseModel, before: str = "") -> Iterator[str]:
    """Dotted keys of all values."""
    for name in settings.keys() if isinstance(settings, Settings) else type(settings).model_fields:
        value = getattr(settings, name, None)
        if isinstance(value, BaseModel):
            yield from known_keys(value, f"{before}{name}.")
        else:
            yield f"{before}{name}"


def meant(key: str, known: Iterable[str]) -> str:
    """` (did you mean 'x'?)`, or nothing. The suggestion is a known key with the same last part (the one most
    like `key` if there are several), else one whose last part is similar, from the same section if that is
    known.
    """
    keys = list(known)
    section, _, last = key.rpartition(".")
    ends = (f".{last}", f".{last.replace('_', '.')}")
    same = [k for k in keys if f".{k}".endswith(ends)]
    near = nearest(key, same) or next(iter(same), None)
    if near is None:
        beside = [k for k in keys if section and k.rpartition(".")[0] == section]
        parts = {k.rpartition(".")[2]: k for k in beside or keys}
        near = parts.get(nearest(last, parts) or "")
    return f" (did you mean {near!r}?)" if near and near != key else ""


def plainly(message: str) -> str:
    """A message of pydantic's in the words of all others; any other message as it is."""
    for theirs, ours in _PLAIN.items():
        if found := re.fullmatch(theirs, message, re.DOTALL):
            return found.expand(ours)
    return message


def problems(
    error: ValidationError,
    what: str,
    known: Iterable[str] = (),
    given: Iterable[str] = (),
    values: Tree | None = None,
) -> str:
    """All that pydantic found wrong with `what`, one `key: message` for each problem, with hints at known
    keys. An unknown key is named as it was `given`. `values`: the tree that was read; it says of which kind a
    section is.
    """
    keys = list(known)
    parts = []
    for e in error.errors():
        key = ".".join(map(str, e["loc"]))
        if e["type"] == "extra_forbidden":
            key = next((k for k in given if k.startswith(f"{key}.")), key)
            hint = meant(key, keys) or _with_kind(key, values)
            parts.append(f"there is no setting {key!r}{hint}")
        else:
            parts.append((f"{key}: " if key else "") + plainly(e["msg"]))
    return f"{what}: " + "; ".join(parts)


def _with_kind(key: str, values: Tree | None) -> str:
    """` with correction.kind=none`, where the key's section has a `kind`; else nothing. With a filter, also
    how settings of a barrier of one's own come there.
    """
    section = key.rpartition(".")[0]
    kind = (_section(values, section) or {}).get("kind") if section else None
    own = "; a barrier of your own comes with `rudc --import FILE.py COMMAND ...`" if kind == "cbf" else ""
    return f" with {section}.kind={kind}{own}" if kind else ""


def _put(values: Tree, key: str, value: Any) -> None:
    *path, last = key.split(".")
    if not all((*path, last)):
        raise InputError(f"setting {key!r}: expected a dotted key, such as learner.n_step")
    here = values
    for part in path:
        below = here.get(part)
        if below is None:
            below = here[part] = {}
        if not isinstance(below, dict):
            raise InputError(f"setting {key!r}: {part!r} is {below!r}, which has no parts")
        here = below
    if last == "kind" and here.get("kind") != value:
        here.clear()
    here[last] = deepcopy(value)


def _section(values: Any, section: str) -> Tree | None:
    for part in section.split(".") if section else ():
        values = values.get(part) if isinstance(values, dict) else None
    return values if isinstance(values, dict) else None


def _is_set(settings: BaseModel, key: str) -> bool:
    *path, last = key.split(".")
    here: Any = settings
    for part in path:
        if not isinstance(here, BaseModel) or part not in here.model_fields_set:
            return False
        here = getattr(here, part)
    return isinstance(here, BaseModel) and last in here.model_fields_set
