"""Settings of which several kinds are registered by name, such as actions and corrections.

A kind is registered by its class or by its place (`module:Class`); a module given by a place is imported when
the kind is first used.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, TypeVar

from pydantic import ValidationError

from rudc.errors import InputError
from rudc.hints import there_are
from rudc.imports import found_at
from rudc.settings import Settings, known_keys, problems

M = TypeVar("M", bound=Settings)
Kinds = Mapping[str, type[M] | str]
"""name of a kind -> its class, or `module:Class`"""


def class_of(kind: type[M] | str) -> type[M]:
    """The class of a registered kind, imported if it is given by its place."""
    found: Any = found_at(kind) if isinstance(kind, str) else kind
    return found


def of_kind(value: Any, registered: Kinds[M], base: type[M]) -> M:
    """The settings that `value` stands for. It may be such settings already, the name of a kind (with its
    defaults), or a mapping of `kind` and settings. For use in a pydantic validator: raises ValueError or
    pydantic's ValidationError.
    """
    if isinstance(value, base):
        return value
    given = {"kind": value} if isinstance(value, str) else value
    if not isinstance(given, Mapping):
        raise ValueError(f"expected one of {', '.join(registered)}, or a mapping with `kind`")
    if "kind" not in given:
        raise ValueError(f"the mapping has no `kind`; it is one of {', '.join(registered)}")
    kind = given["kind"]
    if not isinstance(kind, str):
        raise ValueError(f"`kind` is a name, one of {', '.join(registered)}")
    if kind not in registered:
        raise ValueError(f"there is no {kind!r}{there_are(kind, registered)}")
    return class_of(registered[kind]).model_validate(dict(given))


def read_kind(value: Any, registered: Kinds[M], base: type[M], what: str) -> M:
    """As `of_kind`, for a value that a user gave; messages call it `what`. Raises InputError."""
    try:
        return of_kind(value, registered, base)
    except ValidationError as error:
        kind = value if isinstance(value, str) else value["kind"]
        raise InputError(problems(error, what, known_keys(class_of(registered[kind])()))) from None
    except ValueError as error:
        raise InputError(f"{what}: {error}") from None
