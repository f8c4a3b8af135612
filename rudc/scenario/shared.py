"""`{shared: gap, plus: 3}`: a number that several keys of a scenario share.

A scenario's section `shared` names numbers, each of which is drawn once an episode. Wherever a number stands,
a file may name one of them, times `times`, plus `plus`; with neither, it is that number itself. So two events
lie where the same draw says, or one lies 3 m beyond the other.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from types import MappingProxyType
from typing import Any

import numpy as np
from pydantic import PrivateAttr, model_serializer, model_validator

from rudc.hints import there_are
from rudc.scenario.base import Identifier, Number, refuse
from rudc.scenario.fixed import Distribution

Known = Mapping[str, Distribution | None]
"""the scenario's shared numbers by name; None for one that is wrong itself"""
_KNOWN: ContextVar[Known] = ContextVar("known", default=MappingProxyType({}))
"""those of the scenario that is being checked"""


@contextmanager
def sharing(known: Known) -> Iterator[None]:
    """Within it, these are the shared numbers that a `Shared` may name."""
    token = _KNOWN.set(known)
    try:
        yield
    finally:
        _KNOWN.reset(token)


class Shared(Distribution, frozen=True):
    """A number of the scenario's section `shared`, times `times`, plus `plus`."""

    shared: Identifier
    """its name there"""
    times: Number = 1.0
    """factor on it"""
    plus: Number = 0.0
    """what is added then"""

    _number: Distribution | None = PrivateAttr(default=None)

    @model_validator(mode="after")
    def _look_up(self) -> Shared:
        known = _KNOWN.get()
        if self.shared not in known:
            named = there_are(self.shared, known) if known else "; the scenario has no section `shared`"
            refuse(f"no shared number is called {self.shared!r}{named}", "shared")
        # A frozen model's private attributes may be set all the same.
        self._number = known[self.shared]  # pyright: ignore[reportAttributeAccessIssue]
        return self

    @model_serializer
    def _as_written(self) -> dict[str, Any]:
        times = {} if self.times == 1.0 else {"times": self.times}
        plus = {} if self.plus == 0.0 else {"plus": self.plus}
        return {"shared": self.shared, **times, **plus}

    @property
    def number(self) -> Distribution | None:
        """The shared number; None if that is wrong itself, which is reported where it stands."""
        return self._number

    def of(self, value: float) -> float:
        """What this is where the shared number is `value`."""
        return self.times * value + self.plus

    def sample(self, rng: np.random.Generator) -> float:
        """Draw one value, by itself; an episode draws one for all (`Scenario.plan`)."""
        return math.nan if self._number is None else self.of(self._number.sample(rng))

    @property
    def mean(self) -> float:
        """Of the shared number, times `times`, plus `plus`."""
        return math.nan if self._number is None else self.of(self._number.mean)

    @property
    def support(self) -> tuple[float, float]:
        """Of the shared number, times `times`, plus `plus`."""
        if self._number is None:
            return -math.inf, math.inf
        low, high = sorted(self.of(end) for end in self._number.support)
        return low, high
