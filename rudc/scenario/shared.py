"""`{shared: gap, plus: 3}`: a number that several keys of a scenario share.

A scenario's section `shared` names numbers, each of which is drawn once an episode. Wherever a number stands,
a file may name one of them, times `times`, plus `plus`; with neither, it is that number itself. So two events
lie where the same draw says, or one lies 3 m beyond the other. And where a `choice` stands, of words or
numbers, one of them may say which: `{choice: [north, south], shared: where}`.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from typing import Any, Self

import numpy as np
from pydantic import PrivateAttr, model_serializer, model_validator

from rudc.scenario.base import Identifier, Number
from rudc.scenario.drawable import shared_number
from rudc.scenario.fixed import Distribution


class Shared(Distribution, frozen=True):
    """A number that follows from one of the scenario's section `shared`."""

    shared: Identifier
    """its name there"""

    _number: Distribution | None = PrivateAttr(default=None)

    @model_validator(mode="after")
    def _look_up(self) -> Self:
        found = shared_number(self.shared)
        assert found is None or isinstance(found, Distribution)
        # A frozen model's private attributes may be set all the same.
        self._number = found  # pyright: ignore[reportAttributeAccessIssue]
        return self

    @property
    def number(self) -> Distribution | None:
        """The shared number; None if that is wrong itself, which is reported where it stands."""
        return self._number

    @abstractmethod
    def of(self, value: float) -> float:
        """What this is where the shared number is `value`."""

    def sample(self, rng: np.random.Generator) -> float:
        """Draw one value, by itself; an episode draws one for all (`Scenario.plan`)."""
        return math.nan if self._number is None else self.of(self._number.sample(rng))

    @property
    def possible(self) -> tuple[float, ...] | None:
        """What it may be; None where the shared number's values cannot be listed."""
        values = None if self._number is None else self._number.possible
        return None if values is None else tuple(map(self.of, values))


class SharedNumber(Shared, frozen=True):
    """A number of the scenario's section `shared`, times `times`, plus `plus`."""

    times: Number = 1.0
    """factor on it"""
    plus: Number = 0.0
    """what is added then"""

    @model_serializer
    def _as_written(self) -> dict[str, Any]:
        times = {} if self.times == 1.0 else {"times": self.times}
        plus = {} if self.plus == 0.0 else {"plus": self.plus}
        return {"shared": self.shared, **times, **plus}

    def of(self, value: float) -> float:
        """What this is where the shared number is `value`."""
        return self.times * value + self.plus

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
