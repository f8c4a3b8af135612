"""Which surrounding vehicle an event or a condition means, seen from the ego at the moment it is asked.

A file writes a word, such as `leader`, or an arm by which the vehicle comes: `{from: north, turn: left}`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import Discriminator, Field, Tag

from rudc.scenario.base import FileModel
from rudc.scenario.choices import (
    AnyVehicleType,
    ChoiceParameters,
    OrChoice,
    Place,
    Turn,
    WordChoice,
    possible,
)

Role = Literal["leader", "follower", "oncoming", "crossing", "nearest", "random", "all", "same"]
"""`same` is the vehicle of the event that `event_state` names"""


class Turns(ChoiceParameters, frozen=True):
    """Turns at the junction."""

    values: tuple[Turn, ...]
    """one of these"""


class TurnChoice(WordChoice, frozen=True):
    """One of several turns."""

    choice: Turns
    """the turns; or {values: [...], weights: [...]}"""


class ByArm(FileModel, frozen=True):
    """The vehicle that reaches its stop line first, of those that come by an arm and are still before it.

    Those whose way crosses the ego's come before all others.
    """

    origin: Place = Field(alias="from")
    """arm (compass name) or edge it comes by"""
    turn: Annotated[Turn, OrChoice(TurnChoice)] | None = None
    """where it turns; by default anywhere"""
    type: AnyVehicleType | None = None
    """what it is; by default any vehicle"""

    def __str__(self) -> str:
        named = ("from", self.origin), ("turn", self.turn), ("type", self.type)
        return " ".join(f"{key} {' or '.join(possible(word))}" for key, word in named if word)


def _form(value: Any) -> str:
    """Tag of the form a selector is written in; tags carry brackets so that none reads like a key."""
    by_arm = isinstance(value, ByArm) or (isinstance(value, Mapping) and "choice" not in value)
    return "<by arm>" if by_arm else "<role>"


Selector = Annotated[Annotated[Role, Tag("<role>")] | Annotated[ByArm, Tag("<by arm>")], Discriminator(_form)]
