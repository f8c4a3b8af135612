"""In which unit the number of a key is, and within which bounds: what its field's annotation says."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, get_args

from pydantic.fields import FieldInfo

from rudc.scenario.distributions import Bounds


def unit_of(field: FieldInfo) -> str:
    """The unit, such as `m/s`; empty where there is none."""
    return " and ".join(dict.fromkeys(bound.unit for bound in bounds_of(field) if bound.unit))


def bounds_of(field: FieldInfo) -> list[Bounds]:
    """Bounds of a number, or of each of two."""
    own = [part for part in field.metadata if isinstance(part, Bounds)]
    return own or list(_bounds_in(field.annotation))


def _bounds_in(annotation: Any) -> Iterator[Bounds]:
    for part in getattr(annotation, "__metadata__", ()):
        if isinstance(part, Bounds):
            yield part
    for part in get_args(annotation):
        if not isinstance(part, Bounds):
            yield from _bounds_in(part)
