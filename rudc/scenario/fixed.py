"""What a number in a scenario file can do, and a fixed one."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from typing import Any

import numpy as np
from pydantic import GetJsonSchemaHandler, model_serializer, model_validator
from pydantic_core import CoreSchema

from rudc.scenario.base import Number
from rudc.scenario.drawable import Drawable


class Distribution(Drawable, frozen=True):
    """A number that is fixed or drawn at random. `float(d)` gives the value of a fixed one."""

    @abstractmethod
    def sample(self, rng: np.random.Generator) -> float:
        """Draw one value; a fixed number leaves the generator untouched."""

    @property
    @abstractmethod
    def mean(self) -> float:
        """Its expectation."""

    @property
    @abstractmethod
    def support(self) -> tuple[float, float]:
        """Least and greatest value it can take."""

    @property
    def possible(self) -> tuple[float, ...] | None:
        """Every value that it can take; None where they cannot be listed."""
        return None

    def drawn(self, rng: np.random.Generator) -> Constant:
        """A fixed number, drawn from it, to stand in its place."""
        return Constant(value=self.sample(rng))

    def __float__(self) -> float:
        raise TypeError(f"{self!r} is not fixed; draw from it with `sample`")

    def __index__(self) -> int:
        value = float(self)
        if not value.is_integer():
            raise TypeError(f"{value} is not a whole number")
        return int(value)


class Constant(Distribution, frozen=True):
    """A plain number."""

    value: Number

    @model_validator(mode="before")
    @classmethod
    def _from_number(cls, data: Any) -> Any:
        return data if isinstance(data, Mapping) else {"value": data}

    @model_serializer
    def _to_number(self) -> float:
        return self.value

    @classmethod
    def __get_pydantic_json_schema__(
        cls, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        return {"type": "number"}

    def sample(self, rng: np.random.Generator) -> float:
        """The number itself."""
        return self.value

    @property
    def possible(self) -> tuple[float, ...]:
        """The number itself."""
        return (self.value,)

    @property
    def mean(self) -> float:
        """The number itself."""
        return self.value

    @property
    def support(self) -> tuple[float, float]:
        """The number itself, twice."""
        return self.value, self.value

    def __float__(self) -> float:
        return self.value
