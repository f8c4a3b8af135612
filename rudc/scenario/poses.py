"""Where things stand that an event puts into the world: by position and heading, or along a lane."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Annotated, Any

from pydantic import SerializerFunctionWrapHandler, model_serializer

from rudc.scenario.base import FileModel
from rudc.scenario.choices import AnyVehicleType, Place
from rudc.scenario.distributions import AnyDistribution, Bounds, Constant
from rudc.scenario.triggers import Metre, Position

Degree = Annotated[AnyDistribution, Bounds(-360, 360, "deg")]
Lateral = Annotated[AnyDistribution, Bounds(-50, 50, "m")]
BoxSide = Annotated[AnyDistribution, Bounds(0, 200, "m", above=True)]

_OF_POSITION = ("heading",)
_OF_LANE = ("at", "heading_offset", "lateral")
_MEANT = {
    "heading": " (did you mean 'heading_offset'?)",
    "heading_offset": " (did you mean 'heading'?)",
}


class Pose(FileModel, frozen=True):
    """A place on the plane, by position and heading or by lane."""

    position: Position | None = None
    """[x, y] of the centre, m east and north of the junction's centre"""
    heading: Degree = Constant(value=0.0)
    """deg, counter-clockwise from east; with `position`"""
    lane: Place | None = None
    """lane it stands on, such as west_out_1"""
    at: Metre | None = None
    """m from the junction along `lane`, of its centre"""
    heading_offset: Degree = Constant(value=0.0)
    """deg, counter-clockwise from the lane's direction; with `lane`"""
    lateral: Lateral = Constant(value=0.0)
    """m to the left of the lane's centre line; with `lane`"""

    @classmethod
    def misfits(cls, given: Mapping[str, Any]) -> Iterator[tuple[str, str | None]]:
        """Either a position, with what goes with it, or a lane, with what goes with that."""
        if ("position" in given) == ("lane" in given):
            if set(given) <= set(cls.model_fields):
                yield "expected either `position` (and `heading`) or `lane` and `at`", None
            return
        partner, others = ("position", _OF_POSITION) if "lane" in given else ("lane", _OF_LANE)
        for name in others:
            if name in given:
                yield f"goes with `{partner}` only{_MEANT.get(name, '')}", name
        if "lane" in given and "at" not in given:
            yield "needs `at`, the distance from the junction in m", "lane"

    @model_serializer(mode="wrap")
    def _without_other_form(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        others = _OF_LANE if self.lane is None else _OF_POSITION
        return {key: value for key, value in handler(self).items() if key not in others}

    @property
    def heading_rad(self) -> float:
        """rad, counter-clockwise from east."""
        return math.radians(float(self.heading))

    @property
    def heading_offset_rad(self) -> float:
        """rad, counter-clockwise from the lane's direction."""
        return math.radians(float(self.heading_offset))


class Placement(Pose, frozen=True):
    """A stationary vehicle at any pose."""

    type: AnyVehicleType = "car"
    """what vehicle; `rudc scenario keys mix` says how long each is"""


class Box(Pose, frozen=True):
    """A rectangle at any pose."""

    size: tuple[BoxSide, BoxSide]
    """[length, width] in m, length along the heading"""

    @property
    def sides(self) -> tuple[float, float]:
        """Length and width in m, once they are drawn."""
        length, width = self.size
        return float(length), float(width)


class OpaqueBox(Box, frozen=True):
    """A rectangle that cannot be seen through, such as a building or a hedge."""


class Obstacle(Box, frozen=True):
    """Something that lies on the road, such as stones or a mattress."""
