"""A stopwatch that is put round functions while a study runs, and taken away afterwards: without a study it
costs nothing.

Time is exclusive: a part that calls another does not count what the other takes. It adds less than a
microsecond to each call.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import wraps
from importlib import import_module
from typing import Any


class Stopwatch:
    """Sums up what parts took since they were last asked for."""

    def __init__(self, clock: Callable[[], float] = time.thread_time) -> None:
        """`clock`: s; the processor's time of this thread, which other programs do not add to, or another."""
        self._clock = clock
        self._spent_s: dict[str, float] = {}
        self._inner_s: list[float] = []

    def timed(self, part: str, function: Callable[..., Any]) -> Callable[..., Any]:
        """The function, whose time counts as the part's."""

        @wraps(function)
        def call(*given: Any, **named: Any) -> Any:
            self._inner_s.append(0.0)
            start = self._clock()
            try:
                return function(*given, **named)
            finally:
                whole = self._clock() - start
                inner = self._inner_s.pop()
                self._spent_s[part] = self._spent_s.get(part, 0.0) + whole - inner
                if self._inner_s:
                    self._inner_s[-1] += whole

        return call

    def take(self) -> dict[str, float]:
        """Part -> ms spent in it since the last call, of the parts that were used."""
        spent, self._spent_s = self._spent_s, {}
        return {part: 1000.0 * seconds for part, seconds in spent.items()}


@contextmanager
def timing(stopwatch: Stopwatch, places: Mapping[str, str]) -> Iterator[None]:
    """Put the stopwatch round functions for as long as the block runs. `places`: `module:name.of.it` -> the
    part that its time belongs to. Raises AttributeError where there is none.
    """
    before: list[tuple[Any, str, Any]] = []
    try:
        for place, part in places.items():
            owner, name = _found(place)
            before.append((owner, name, vars(owner)[name]))
            setattr(owner, name, stopwatch.timed(part, getattr(owner, name)))
        yield
    finally:
        for owner, name, function in reversed(before):
            setattr(owner, name, function)


def _found(place: str) -> tuple[Any, str]:
    """What holds the function, and the name that it has there."""
    module, _, path = place.partition(":")
    *owners, name = path.split(".")
    owner = import_module(module)
    for part in owners:
        owner = getattr(owner, part)
    if name not in vars(owner):
        raise AttributeError(f"{place}: there is no such function")
    return owner, name
