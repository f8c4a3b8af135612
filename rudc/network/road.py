"""The parts of a road network as plain data: lanes, arms, movements. Angles counter-clockwise from x (east),
SI units."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

from rudc.arrays import Array

Turn = Literal["left", "straight", "right", "u_turn"]

COMPASS = ("east", "northeast", "north", "northwest", "west", "southwest", "south", "southeast")
"""names of arms, one for each 45 degrees of bearing"""


ROAD_USERS = ("passenger", "truck", "bus", "motorcycle", "bicycle")
"""SUMO's vehicle classes that traffic is made of"""
RAILS = ("tram", "rail_urban", "rail", "rail_electric", "rail_fast", "subway", "cable_car")
"""SUMO's vehicle classes that run on rails: no traffic here"""


def may_mean(name: str, names: Iterable[str]) -> list[str]:
    """Those of `names` (of arms or lanes) that may be meant by `name`: if it begins with a compass word, none
    that begins with one more than 45 degrees away.
    """
    return [other for other in names if _steps_between(_direction(name), _direction(other)) <= 1]


def _direction(name: str) -> int | None:
    word = name.partition("_")[0]
    return COMPASS.index(word) if word in COMPASS else None


def _steps_between(one: int | None, other: int | None) -> int:
    """Steps of 45 degrees; 0 where a direction is not known."""
    if one is None or other is None:
        return 0
    away = abs(one - other)
    return min(away, len(COMPASS) - away)


@dataclass(frozen=True, eq=False)
class Lane:
    """One lane: of an arm, of a roundabout's ring, or inside a node of the junction."""

    id: str
    """SUMO's id"""
    edge: str
    """id of its edge"""
    index: int
    """0 is the rightmost in driving direction"""
    width: float
    """m"""
    length: float
    """m, as stated in the file: SUMO counts positions on the lane in it"""
    speed: float
    """m/s, limit"""
    xy: Array
    """(K, 2) m, centre line in driving direction"""
    heading: Array
    """(K,) rad, direction of travel at its points, unwrapped"""
    polygon: Array
    """(2K, 2) m, what it covers"""
    internal: bool
    """whether it lies inside a node"""
    refuses: tuple[str, ...]
    """kinds of road users (SUMO's vehicle classes) that may not use it, of `ROAD_USERS`"""


@dataclass(frozen=True, eq=False)
class ReservedLane:
    """A lane that is closed to cars, at the junction or on its ring: no part of the road, only drawn."""

    area: Array
    """(K, 2) m, what it covers: its right side, then its left side backwards"""
    is_pavement: bool
    """whether only pedestrians use it"""


@dataclass(frozen=True)
class Arm:
    """One road at the junction, from the junction out to the next real junction, dead end, or place from
    which no connection leads cars on."""

    name: str
    """compass word of its bearing as seen from the junction; where two arms have the same word, with the id
    of its edge appended"""
    in_edge: str | None
    """edge that enters the junction, None where the arm is one-way outwards"""
    out_edge: str | None
    """edge that leaves the junction, None where the arm is one-way inwards"""
    in_edges: tuple[str, ...]
    """all edges towards the junction, outermost first (one, unless the road changes on its way)"""
    out_edges: tuple[str, ...]
    """all edges away from the junction, innermost first"""
    bearing: float
    """rad, direction from the junction's centre to the arm"""
    heading_in: float
    """rad, direction of travel of traffic that enters by it, taken over its last 20 m"""
    length: float
    """m, the mean of its two directions"""
    in_lanes: tuple[str, ...]
    """lane ids of `in_edge`, rightmost first"""
    out_lanes: tuple[str, ...]
    """lane ids of `out_edge`, rightmost first"""
    major: bool
    """whether some movement from it (in general: straight on) need not yield to traffic of any other arm"""

    @property
    def two_way_m(self) -> float:
        """m of two-way road: a one-way arm counts half."""
        return self.length if self.in_lanes and self.out_lanes else 0.5 * self.length


@dataclass(frozen=True)
class Movement:
    """A permitted way from one arm to another."""

    origin: str
    """name of the arm it comes from"""
    destination: str
    """name of the arm it leaves by"""
    turn: Turn
    """by the angle between the arms: within 30 degrees is straight (at most one movement of an arm); `u_turn`
    leads back onto the same arm, or, where SUMO says so, onto the other carriageway of the same road"""
    angle: float
    """rad, change of heading from the one arm to the other, positive to the left"""
    edges: tuple[str, ...]
    """edges driven, in order, those of a roundabout's ring included"""
    rows: tuple[int, ...]
    """its lane-to-lane variants: rows of `Network.paths`"""
    major: bool
    """whether none of its rows must yield to traffic of another arm"""
