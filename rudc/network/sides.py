"""Which one-way edges are the two sides of one road: one leads to the junction, the other from it.

Between the same two nodes, those belong together whose lines lie nearest to each other. Where a turn lane
begins, or a slip road parts, one side has a node that the other has not. Then two one-way roads are one arm
if they lead off in about the same direction and share a node, or lie side by side with no other road between
them, the one that leads away on the right.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from rudc.arrays import Array
from rudc.network.polyline import arc_length, resample, without_repeats

ALIKE, ALIKE_M = 0.87, 20.0
"""two roads may be one above this cosine of the angle between them; m of them over which it is taken"""
MEDIAN_M, PARALLEL = 20.0, 0.95
"""m between the middles of two one-way roads that share no node, up to which they may be one road; the cosine
above which they must be then"""


@dataclass(frozen=True)
class RawArm:
    """One road at the junction, as chains of edges."""

    inbound: tuple[Any, ...]
    """sumolib edges towards the junction, outermost first; may be empty"""
    outbound: tuple[Any, ...]
    """sumolib edges away from the junction, innermost first; may be empty"""


def roads_to_one(towards: list[Any], away: list[Any]) -> list[tuple[Any, Any]]:
    """The roads to one neighbour: of each, the edge from it and the edge to it, or None. Where there are
    several, those are whose lines lie nearest to each other."""
    if len(towards) == len(away) == 1:
        return [(towards[0], away[0])]
    partner: dict[Any, Any] = {}
    for inbound, outbound in sorted(product(towards, away), key=lambda edges: _apart(*edges)):
        if inbound not in partner and outbound not in partner.values():
            partner[inbound] = outbound
    alone = [edge for edge in away if edge not in partner.values()]
    return [*((edge, partner.get(edge)) for edge in towards), *((None, edge) for edge in alone)]


def _apart(inbound: Any, outbound: Any) -> float:
    """m, mean distance of two edges between the same nodes, at like parts of their lengths."""
    lines = [without_repeats(line) for line in (shape_of(inbound)[::-1], shape_of(outbound))]
    here, there = (resample(line, np.linspace(0.0, arc_length(line)[-1], 20)) for line in lines)
    return float(np.hypot(*(here - there).T).mean())


def paired(arms: list[RawArm]) -> list[RawArm]:
    """The arms; a one-way road to the junction and one from it become one arm where they are the two sides of
    one road."""
    entering = [arm for arm in arms if not arm.outbound]
    leaving = [arm for arm in arms if not arm.inbound]
    gaps = {pair: _median(*pair, arms) for pair in product(entering, leaving)}
    partner: dict[RawArm, RawArm] = {}
    for one, other in sorted(gaps, key=lambda pair: gaps[pair]):
        if gaps[one, other] <= MEDIAN_M and one not in partner and other not in partner.values():
            partner[one] = other
    whole = [RawArm(arm.inbound, partner[arm].outbound) if arm in partner else arm for arm in arms]
    return [arm for arm in whole if arm not in partner.values()]


def _median(entering: RawArm, leaving: RawArm, arms: list[RawArm]) -> float:
    """m between the middles of a one-way road to the junction and one from it, at most, next to the junction
    and ALIKE_M out; 0 where they share a node, inf where they are no two sides of one road."""
    one, other = _outwards(entering), _outwards(leaving)
    alike = float(_direction(one) @ _direction(other))
    nodes = {edge.getFromNode() for edge in entering.inbound}
    if not nodes.isdisjoint(edge.getToNode() for edge in leaving.outbound):
        return 0.0 if alike > ALIKE else math.inf
    gap = _beside(one, other)
    if alike <= PARALLEL or min(gap) < 0.0:
        return math.inf
    between = [_beside(one, _outwards(arm))[1] for arm in arms if arm not in (entering, leaving)]
    return math.inf if any(0.0 < away < gap[1] for away in between) else max(gap)


def _outwards(arm: RawArm) -> tuple[Array, Array]:
    """(2,) m and (2,) m, the ends of the first ALIKE_M of a road, from the junction outwards."""
    lines = list(map(shape_of, arm.outbound)) or [shape_of(edge)[::-1] for edge in reversed(arm.inbound)]
    return lines[0][0], place_along(lines, ALIKE_M)


def _direction(road: tuple[Array, Array]) -> Array:
    """(2,) the direction of a road as of `_outwards`, of length 1."""
    way = road[1] - road[0]
    return way / np.hypot(*way)


def _beside(road: tuple[Array, Array], other: tuple[Array, Array]) -> tuple[float, float]:
    """m by which another road lies to the right of a road, at its beginning and at its end; inf where it is
    farther ahead or behind there than ALIKE_M, or leads elsewhere."""
    way = _direction(road)
    if float(way @ _direction(other)) <= ALIKE:
        return math.inf, math.inf
    away = [there - here for here, there in zip(road, other, strict=True)]
    right = [float(way[1] * d[0] - way[0] * d[1]) for d in away]
    near = all(abs(float(way @ d)) <= ALIKE_M for d in away)
    return (right[0], right[1]) if near else (math.inf, math.inf)


def place_along(lines: Sequence[Array], reach: float) -> Array:
    """(2,) m, the place `reach` m along a line and those that continue it, or the end of the last, as if each
    began where the one before ends."""
    place: Array | None = None
    for line in map(without_repeats, lines):
        if len(line) > 1 and reach > 0.0:
            on = min(reach, arc_length(line)[-1])
            here, there = resample(line, np.array([0.0, on]))
            place, reach = there if place is None else place + (there - here), reach - on
    return lines[0][0] if place is None else place


def shape_of(element: Any) -> Array:
    """(K, 2) m, the shape of a sumolib lane or node."""
    return np.array(element.getShape(), dtype=float).reshape(-1, 2)
