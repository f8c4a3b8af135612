"""What is drawn in each episode, and the numbers of a scenario's section `shared`, by their names."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from types import MappingProxyType
from typing import Any

import numpy as np

from rudc.hints import there_are
from rudc.scenario.base import FileModel, refuse


class Drawable(FileModel, frozen=True):
    """A value of a file that may differ from episode to episode."""

    @abstractmethod
    def drawn(self, rng: np.random.Generator) -> Any:
        """A fixed value, drawn from it, to stand in its place."""

    @property
    @abstractmethod
    def possible(self) -> tuple[Any, ...] | None:
        """Every value that may be drawn; None where they cannot be listed."""


Known = Mapping[str, Drawable | None]
"""the scenario's shared numbers by name; None for one that is wrong itself"""
_KNOWN: ContextVar[Known] = ContextVar("known", default=MappingProxyType({}))
"""those of the scenario that is being checked"""


@contextmanager
def sharing(known: Known) -> Iterator[None]:
    """Within it, these are the shared numbers that a value may name."""
    token = _KNOWN.set(known)
    try:
        yield
    finally:
        _KNOWN.reset(token)


def shared_number(name: str) -> Drawable | None:
    """The shared number of that name; None if it is wrong itself. Refuses a name that none has."""
    known = _KNOWN.get()
    if name not in known:
        named = there_are(name, known) if known else "; the scenario has no section `shared`"
        refuse(f"no shared number is called {name!r}{named}", "shared")
    return known[name]


def places_of(name: str, number: Drawable | None, count: int) -> tuple[int, ...]:
    """Which of `count` values a shared number may say, 0 the first; none if it is wrong itself. Refuses one
    that cannot say any.
    """
    if number is None:
        return ()
    places = number.possible
    if places is None or any(place not in range(count) for place in places):
        given = "" if places is None else f"; it may be {', '.join(f'{place:g}' for place in places)}"
        refuse(
            f"{name!r} says which of {count} values this is, 0 the first, so it must be a whole number from "
            f"0 to {count - 1}, or a {{choice: [...]}} of such{given}",
            "shared",
        )
    return tuple(dict.fromkeys(map(int, places)))
