"""Numbers in a scenario: fixed ones, and ones drawn at random.

A file writes a number, `{uniform: [low, high]}`, `{normal: {mean: m, std: s, low: l, high: h}}`,
`{choice: [a, b, c]}`, or `{shared: name}` for one that several keys share (rudc/scenario/shared.py), which
may also say which of a `choice` it is. Normals are truncated: to their own `low` and `high`, and otherwise to
what is physically sane for their key.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from statistics import NormalDist
from typing import Annotated, Any, Self, cast

import numpy as np
from pydantic import (
    Discriminator,
    GetCoreSchemaHandler,
    GetJsonSchemaHandler,
    Tag,
    TypeAdapter,
    ValidationError,
    model_validator,
)
from pydantic_core import CoreSchema, PydanticCustomError, core_schema

from rudc.scenario.base import FileModel, Number, refuse, with_parts
from rudc.scenario.choices import ChoiceParameters
from rudc.scenario.drawable import Drawable, places_of
from rudc.scenario.fixed import Constant, Distribution
from rudc.scenario.shared import Shared, SharedNumber

FORMS = (
    "{uniform: [low, high]}, {normal: {mean: m, std: s, low: l, high: h}} (low and high may be left out) "
    "or {choice: [a, b, ...]}"
)
NEAREST = 1e-9
"""standard deviations, least distance of a drawn value from the cuts of a normal distribution"""


class Uniform(Distribution, frozen=True):
    """Every value between two limits is equally likely."""

    uniform: tuple[Number, Number]
    """[low, high]"""

    @model_validator(mode="after")
    def _check(self) -> Uniform:
        low, high = self.uniform
        if low > high:
            refuse(f"low {low:g} is above high {high:g} (swap them?)", "uniform", 0)
        return self

    def sample(self, rng: np.random.Generator) -> float:
        """Draw one value."""
        return float(rng.uniform(*self.uniform))

    def quantile(self, share: float) -> float:
        """The value below which a share of the draws lies, 0 to 1."""
        low, high = self.uniform
        return min(low + share * (high - low), high)

    @property
    def mean(self) -> float:
        """The middle."""
        return 0.5 * (self.uniform[0] + self.uniform[1])

    @property
    def support(self) -> tuple[float, float]:
        """Low and high."""
        return self.uniform


class NormalParameters(FileModel, frozen=True):
    """Mean, standard deviation and limits of a normal distribution."""

    mean: Number
    """before truncation"""
    std: Number
    """standard deviation before truncation"""
    low: Number | None = None
    """no value below this; by default the least sane one"""
    high: Number | None = None
    """no value above this; by default the greatest sane one"""

    @classmethod
    def __get_pydantic_json_schema__(
        cls, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        pair = {"type": "array", "items": {"type": "number"}, "minItems": 2, "maxItems": 2}
        return {"anyOf": [pair, handler.resolve_ref_schema(handler(schema))]}

    @model_validator(mode="before")
    @classmethod
    def _from_pair(cls, data: Any) -> Any:
        if not isinstance(data, list | tuple):
            return data
        if len(data) != 2:
            limits = "limits: {mean: m, std: s, low: a, high: b}"
            refuse(f"expected [mean, std], got {len(data)} values ({limits})")
        return dict(zip(("mean", "std"), data, strict=True))

    @model_validator(mode="after")
    def _check(self) -> NormalParameters:
        if self.std <= 0:
            refuse(f"must be above 0, got {self.std:g} (without spread, write the number itself)", "std")
        if self.low is not None and self.mean < self.low:
            refuse(f"low {self.low:g} is above the mean {self.mean:g}", "low")
        if self.high is not None and self.mean > self.high:
            refuse(f"high {self.high:g} is below the mean {self.mean:g}", "high")
        return self


class Normal(Distribution, frozen=True):
    """A truncated normal distribution."""

    normal: NormalParameters
    """mean and std, and low and high where it is truncated; or [mean, std]"""

    def sample(self, rng: np.random.Generator) -> float:
        """Draw one value by inverting the distribution function, so that one draw always suffices."""
        curve, low, high = self._curve
        return self._inverse(rng.uniform(curve.cdf(low), curve.cdf(high)))

    def quantile(self, share: float) -> float:
        """The value below which a share of the draws lies, 0 to 1."""
        curve, low, high = self._curve
        below = curve.cdf(low)
        return self._inverse(below + share * (curve.cdf(high) - below))

    def _inverse(self, share: float) -> float:
        """Inverse of the whole curve's distribution function; never a cut, which bounds may exclude."""
        curve, low, high = self._curve
        inside = min(NEAREST * curve.stdev, 0.5 * (high - low))
        value = curve.inv_cdf(min(max(share, 1e-12), 1.0 - 1e-12))
        return min(max(value, low + inside), high - inside)

    @property
    def mean(self) -> float:
        """Mean of the truncated distribution."""
        curve, low, high = self._curve
        share = curve.cdf(high) - curve.cdf(low)
        if share == 0.0:  # nothing lies between
            return low
        height = sum(sign * curve.pdf(end) for sign, end in ((1, low), (-1, high)) if math.isfinite(end))
        return min(max(curve.mean + curve.variance * height / share, low), high)

    @property
    def support(self) -> tuple[float, float]:
        """Where it is truncated."""
        low, high = self.normal.low, self.normal.high
        return (-math.inf if low is None else low), (math.inf if high is None else high)

    @property
    def _curve(self) -> tuple[NormalDist, float, float]:
        return NormalDist(self.normal.mean, self.normal.std), *self.support


class Numbers(ChoiceParameters, frozen=True):
    """Numbers and how likely each is."""

    values: tuple[Number, ...]
    """one of these"""


class Choice(Distribution, frozen=True):
    """One of several values."""

    choice: Numbers
    """the values; or {values: [...], weights: [...]}"""

    def sample(self, rng: np.random.Generator) -> float:
        """Draw one value."""
        return float(rng.choice(self.choice.values, p=self.choice.shares))

    @property
    def possible(self) -> tuple[float, ...]:
        """The values that are ever drawn."""
        return self.choice.possible

    @property
    def mean(self) -> float:
        """Weighted mean of the values."""
        return float(np.average(self.choice.values, weights=self.choice.shares))

    @property
    def support(self) -> tuple[float, float]:
        """Least and greatest value of those that are ever drawn."""
        return min(self.choice.possible), max(self.choice.possible)


class SharedChoice(Shared, frozen=True):
    """Of several values the one that a number of the scenario's section `shared` says, 0 the first."""

    choice: Numbers
    """the values"""

    @model_validator(mode="after")
    def _check(self) -> Self:
        self.choice.refuse_weights()
        places_of(self.shared, self.number, len(self.choice.values))
        return self

    def of(self, value: float) -> float:
        """What this is where the shared number is `value`."""
        return self.choice.values[int(value)]

    @property
    def mean(self) -> float:
        """Mean of the values, as often as the shared number says each."""
        number = self.number
        if isinstance(number, Choice):
            return float(np.average([*map(self.of, number.choice.values)], weights=number.choice.shares))
        return math.nan if number is None else self.of(number.mean)

    @property
    def support(self) -> tuple[float, float]:
        """Least and greatest value of those that the shared number may say."""
        values = self.possible or self.choice.values
        return min(values), max(values)


_TAGS = {
    ("uniform",): "<uniform>",
    ("normal",): "<normal>",
    ("choice",): "<choice>",
    ("shared",): "<sharednumber>",
    ("choice", "shared"): "<sharedchoice>",
}


def _form(value: Any) -> str | None:
    """Tag of the form a value is written in; tags carry brackets so that none reads like a key."""
    if isinstance(value, Distribution):
        return f"<{type(value).__name__.lower()}>"
    if not isinstance(value, Mapping):
        return "<constant>" if not isinstance(value, list | tuple) else None
    forms = tuple(form for form in ("uniform", "normal", "choice", "shared") if form in value)
    return _TAGS.get(forms)


AnyDistribution = Annotated[
    Annotated[Constant, Tag("<constant>")]
    | Annotated[Uniform, Tag("<uniform>")]
    | Annotated[Normal, Tag("<normal>")]
    | Annotated[Choice, Tag("<choice>")]
    | Annotated[SharedNumber, Tag("<sharednumber>")]
    | Annotated[SharedChoice, Tag("<sharedchoice>")],
    Discriminator(
        _form, custom_error_type="distribution", custom_error_message="expected a number or a distribution"
    ),
]
"""What may stand wherever a number may."""


@dataclass(frozen=True)
class Bounds:
    """The range within which a number or distribution is physically sane."""

    low: float
    high: float
    unit: str = ""
    above: bool = False
    """whether `low` itself is excluded"""
    whole: bool = False
    """whether only whole numbers are allowed"""

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.no_info_after_validator_function(self.check, handler(source))

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        described = dict(handler(schema))
        forms = described.pop("oneOf")
        random = [form for form in forms if handler.resolve_ref_schema(form).get("type") != "number"]
        number = {
            "type": "integer" if self.whole else "number",
            "exclusiveMinimum" if self.above else "minimum": self.low,
            "maximum": self.high,
        }
        return {**described, "anyOf": [number, *random]}

    def check(self, value: Distribution) -> Distribution:
        """The same distribution, a normal one truncated to the bounds; refuses what reaches beyond them."""
        if isinstance(value, Shared) and value.number is None:
            return value
        for where, number in _numbers(value):
            cut_there = where == ("normal", "low")  # as it is by default; no draw comes out at the cut itself
            excluded = self.above and number == self.low and not cut_there
            if number > self.high or number < self.low or excluded:
                refuse(f"{number:g}{self._unit} is not {self._range}", *where)
            if self.whole and not number.is_integer():
                refuse(f"expected a whole number, got {number:g}", *where)
        if self.whole and not isinstance(
            value.number if isinstance(value, Shared) else value, Constant | Choice
        ):
            refuse("expected a whole number or {choice: [...]} of whole numbers")
        if not isinstance(value, Normal):
            return value
        limits = value.normal
        low = float(self.low) if limits.low is None else limits.low
        high = float(self.high) if limits.high is None else limits.high
        return Normal(normal=limits.model_copy(update={"low": low, "high": high}))

    @property
    def _unit(self) -> str:
        return f" {self.unit}" if self.unit else ""

    @property
    def _range(self) -> str:
        if self.above:
            return f"above {self.low:g} and at most {self.high:g}{self._unit}"
        return f"between {self.low:g} and {self.high:g}{self._unit}"


def _numbers(value: Distribution) -> list[tuple[tuple[str | int, ...], float]]:
    """Every value that must lie within the bounds, with the key it stands at."""
    match value:
        case Constant():
            return [((), value.value)]
        case Uniform():
            return [(("uniform", i), end) for i, end in enumerate(value.uniform)]
        case Choice() | SharedChoice():
            return [(("choice", "values", i), end) for i, end in enumerate(value.choice.values)]
        case Normal(normal=limits):
            named = (("mean", limits.mean), ("low", limits.low), ("high", limits.high))
            return [(("normal", name), end) for name, end in named if end is not None]
        case Shared():
            ends = [] if value.number is None else [end for _, end in _numbers(value.number)]
            return [((), value.of(end)) for end in ends]
    raise NotImplementedError(f"{type(value).__name__} must say which of its numbers are bounded")


_ADAPTER: TypeAdapter[Distribution] = TypeAdapter(AnyDistribution)


def distribution(value: float | Mapping[str, object] | Distribution) -> Distribution:
    """A distribution from what a file would say: `distribution(7)`, `distribution({"uniform": [6, 10]})`."""
    return cast(Distribution, _ADAPTER.validate_python(value))


def draw(value: Any, rng: np.random.Generator) -> Any:
    """The same model, or tuple, list or dict of them, with every number and word drawn, in field order."""
    if isinstance(value, Drawable):
        return value.drawn(rng)
    return with_parts(value, lambda _, part: draw(part, rng))


def may_be_shared(value: Distribution) -> Distribution:
    """The same number; refuses what cannot stand in `shared`, where no key says what is sane for it."""
    if isinstance(value, Shared):
        refuse("a shared number cannot name another one", "shared")
    if not all(map(math.isfinite, value.support)):
        refuse("give `low` and `high`, too: {normal: {mean: m, std: s, low: l, high: h}}", "normal")
    return value


def shared_in(data: Any) -> dict[str, Distribution | None]:
    """The numbers in the section `shared` of a scenario file's data, by name; None for one that is wrong."""
    section = data.get("shared") if isinstance(data, Mapping) else None
    found = dict[str, Distribution | None]()
    for name, value in section.items() if isinstance(section, Mapping) else ():
        try:
            found[str(name).strip()] = may_be_shared(distribution(value))
        except (ValidationError, PydanticCustomError):
            found[str(name).strip()] = None
    return found
