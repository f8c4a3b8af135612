"""In which unit the number of a key is, and within which bounds, and whether a word may be drawn: what its
field's annotation says.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, TypeVar, get_args

from pydantic.fields import FieldInfo

from rudc.scenario.choices import OrChoice
from rudc.scenario.distributions import Bounds

Mark = TypeVar("Mark")


def unit_of(field: FieldInfo) -> str:
    """The unit, such as `m/s`; empty where there is none."""
    return " and ".join(dict.fromkeys(bound.unit for bound in bounds_of(field) if bound.unit))


def bounds_of(field: FieldInfo) -> list[Bounds]:
    """Bounds of a number, or of each of two."""
    return marks_of(field, Bounds)


def may_be_chosen(field: FieldInfo) -> bool:
    """Whether a file may leave a word to chance."""
    return bool(marks_of(field, OrChoice))


def marks_of(field: FieldInfo, kind: type[Mark]) -> list[Mark]:
    """The marks of a kind on a field, or within its type."""
    own = [part for part in field.metadata if isinstance(part, kind)]
    return own or list(_marks_in(field.annotation, kind))


def _marks_in(annotation: Any, kind: type[Mark]) -> Iterator[Mark]:
    for part in getattr(annotation, "__metadata__", ()):
        if isinstance(part, kind):
            yield part
    for part in get_args(annotation):
        if not isinstance(part, kind):
            yield from _marks_in(part, kind)
