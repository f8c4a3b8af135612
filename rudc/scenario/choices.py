"""`{choice: [...]}` in a scenario, for numbers and for words.

Where a model has `Side`, `Place` or another word that is annotated with `OrChoice`, a file writes a word, or
`{choice: [left, right]}`. With `{choice: [left, right], shared: NAME}` a shared number
(rudc/scenario/shared.py) says which, 0 the first, so that several keys of a scenario may go together.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler, PrivateAttr, model_validator
from pydantic_core import CoreSchema, core_schema

from rudc.scenario.base import FileModel, Identifier, Number, parts_of, refuse, with_parts
from rudc.scenario.drawable import Drawable, places_of, shared_number


class ChoiceParameters(FileModel, frozen=True):
    """Values and how likely each is; a subclass says of what type they are."""

    values: tuple[Any, ...]
    """one of these"""
    weights: tuple[Number, ...] | None = None
    """relative weight of each value; by default all equal"""

    @classmethod
    def __get_pydantic_json_schema__(
        cls, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        model = handler.resolve_ref_schema(handler(schema))
        values = {"type": "array", "items": model["properties"]["values"]["items"], "minItems": 1}
        return {"anyOf": [values, model]}

    @model_validator(mode="before")
    @classmethod
    def _from_list(cls, data: Any) -> Any:
        return {"values": data} if isinstance(data, list | tuple) else data

    @model_validator(mode="after")
    def _check(self) -> ChoiceParameters:
        if not self.values:
            refuse("there is nothing to choose from", "values")
        if self.weights is None:
            return self
        if len(self.weights) != len(self.values):
            refuse(f"{len(self.weights)} weights for {len(self.values)} values", "weights")
        for i, weight in enumerate(self.weights):
            if weight < 0:
                refuse(f"a weight cannot be negative, got {weight:g}", "weights", i)
        if not 0 < sum(self.weights) < math.inf:
            refuse("one weight at least must be above 0, and the sum of all finite", "weights")
        return self

    def refuse_weights(self) -> None:
        """Refuse weights, where a shared number says which value it is."""
        if self.weights is not None:
            refuse("has no effect beside `shared`, whose number says which value it is", "choice", "weights")

    @property
    def shares(self) -> list[float]:
        """Probability of each value."""
        weights = self.weights or (1.0,) * len(self.values)
        return [weight / sum(weights) for weight in weights]

    @property
    def possible(self) -> tuple[Any, ...]:
        """The values that are ever drawn."""
        return tuple(value for value, share in zip(self.values, self.shares, strict=True) if share > 0.0)


class WordChoice(Drawable, frozen=True):
    """One of several words; a subclass says of what type they are."""

    choice: ChoiceParameters
    """the words; or {values: [...], weights: [...]}"""
    shared: Identifier | None = None
    """name of the shared number that says which, 0 the first; by default each is drawn by itself"""

    _places: tuple[int, ...] = PrivateAttr(default=())
    """those in the list that the shared number may say"""

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.shared is not None:
            self.choice.refuse_weights()
            # A frozen model's private attributes may be set all the same.
            self._places = places_of(  # pyright: ignore[reportAttributeAccessIssue]
                self.shared, shared_number(self.shared), len(self.choice.values)
            )
        return self

    @property
    def places(self) -> tuple[int, ...]:
        """Places in the list that the shared number may say; none where none says."""
        return self._places

    @property
    def possible(self) -> tuple[str, ...]:
        """Every word that may be drawn."""
        return tuple(self.choice.values[i] for i in self._places) or self.choice.possible

    def drawn(self, rng: np.random.Generator) -> str:
        """Draw one word."""
        return self.choice.values[int(rng.choice(len(self.choice.values), p=self.choice.shares))]


def _form(value: Any) -> str:
    """Tag of the form a word is written in; tags carry brackets so that none reads like a key."""
    many = isinstance(value, WordChoice) or (isinstance(value, Mapping) and "choice" in value)
    return "<words>" if many else "<word>"


@dataclass(frozen=True)
class OrChoice:
    """Marks a word of a model that a file may leave to chance. A model from a file then has a `WordChoice` in
    its place, in spite of the word's type; in an event that takes effect it has been drawn.
    """

    form: type[WordChoice]
    """what a choice of such words is made of"""

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        forms = {"<word>": handler(source), "<words>": handler.generate_schema(self.form)}
        return core_schema.tagged_union_schema(forms, _form)


def possible(word: Any) -> tuple[Any, ...]:
    """Every word that may be drawn: of a fixed one itself."""
    return word.possible if isinstance(word, WordChoice) else (word,)


def possible_together(*words: Any) -> list[tuple[Any, ...]]:
    """Every combination of words that may be drawn: those that name the same shared number go together."""
    choices = [word for word in words if isinstance(word, WordChoice)]
    shared = {word.shared: word.places for word in choices if word.shared is not None and word.places}
    found = dict[tuple[Any, ...], None]()
    for places in itertools.product(*shared.values()):
        at = dict(zip(shared, places, strict=True))
        told = [with_shared(word, at) for word in words]
        found |= dict.fromkeys(itertools.product(*map(possible, told)))
    return [*found]


def words_in(value: Any) -> Iterator[WordChoice]:
    """Each choice of words in a model, or tuple, list or dict of them."""
    if isinstance(value, WordChoice):
        yield value
    elif not isinstance(value, Drawable):
        for _, part in parts_of(value):
            yield from words_in(part)


def with_shared(value: Any, numbers: Mapping[str, float]) -> Any:
    """The same word, model, or tuple, list or dict of them, with the word that a shared number says in the
    place of each `WordChoice` that names one; `numbers`: name -> value.
    """
    if isinstance(value, WordChoice) and value.shared is not None and value.shared in numbers:
        return value.choice.values[int(numbers[value.shared])]
    if isinstance(value, Drawable):
        return value
    return with_parts(value, lambda _, part: with_shared(part, numbers))


SideOfRoad = Literal["left", "right"]


class Sides(ChoiceParameters, frozen=True):
    """Sides of a road."""

    values: tuple[SideOfRoad, ...]
    """one of these"""


class SideChoice(WordChoice, frozen=True):
    """One of both sides."""

    choice: Sides
    """the sides; or {values: [...], weights: [...]}"""


class Places(ChoiceParameters, frozen=True):
    """Names of lanes or arms."""

    values: tuple[Identifier, ...]
    """one of these"""


class PlaceChoice(WordChoice, frozen=True):
    """One of several lanes or arms."""

    choice: Places
    """the names; or {values: [...], weights: [...]}"""


Turn = Literal["left", "straight", "right"]
EgoTurn = Literal["left", "straight", "right", "random"]


class EgoTurns(ChoiceParameters, frozen=True):
    """Turns of the ego at the junction."""

    values: tuple[EgoTurn, ...]
    """one of these"""


class EgoTurnChoice(WordChoice, frozen=True):
    """One of several turns."""

    choice: EgoTurns
    """the turns; or {values: [...], weights: [...]}"""


VehicleType = Literal["car", "truck", "bus", "motorcycle", "bicycle"]


class VehicleTypes(ChoiceParameters, frozen=True):
    """Types of vehicles."""

    values: tuple[VehicleType, ...]
    """one of these"""


class VehicleTypeChoice(WordChoice, frozen=True):
    """One of several types of vehicles."""

    choice: VehicleTypes
    """the types; or {values: [...], weights: [...]}"""


AnyEgoTurn = Annotated[EgoTurn, OrChoice(EgoTurnChoice)]
Side = Annotated[SideOfRoad, OrChoice(SideChoice)]
AnyVehicleType = Annotated[VehicleType, OrChoice(VehicleTypeChoice)]
Place = Annotated[Identifier, OrChoice(PlaceChoice)]
"""The name of a lane or arm."""
