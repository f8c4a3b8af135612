"""Whether a network file agrees with itself: what SUMO does not check, and crashes on if it is wrong.

Numbers must be finite and of a size that roads have; a node that states right of way (`<request>`) must do so
for just as many ways through it (`<connection>`, and pedestrian crossings) as there are.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from rudc.errors import NetworkError

FARTHEST = 1e8
"""m, largest coordinate: those of map projections stay below a tenth of it"""
LONGEST = 1e6
"""m, longest lane"""
WIDEST = 100.0
"""m, widest lane"""
FASTEST = 1000.0
"""m/s, highest speed limit"""
SHOWN = 5
"""contradictions that a message names, at most"""


def refuse_implausible(net: Any, path: Path) -> None:
    """Raise NetworkError if a sumolib net holds what no road network has; the message names it."""
    found = [*_wrong_numbers(net), *_wrong_requests(net)]
    if found:
        more = f"; and {len(found) - SHOWN} more" if len(found) > SHOWN else ""
        raise NetworkError(
            f"{path}: {'; '.join(found[:SHOWN])}{more}. "
            "Build the network anew with netconvert; SUMO crashes on such a file"
        )


def _wrong_numbers(net: Any) -> Iterator[str]:
    for node in net.getNodes():
        if not _lies_well(np.array([node.getCoord(), *node.getShape()], dtype=float)):
            yield f"junction {node.getID()!r} lies nowhere: a coordinate is no number, or huge"
    for edge in net.getEdges():
        for lane in edge.getLanes():
            yield from _wrong_lane(lane)


def _wrong_lane(lane: Any) -> Iterator[str]:
    name = lane.getID()
    shape = np.array(lane.getShape(), dtype=float)
    if len(shape) < 2:
        yield f"lane {name} has no shape"
    elif not _lies_well(shape):
        yield f"lane {name} lies nowhere: a coordinate is no number, or huge"
    for what, value, most, unit in (
        ("length", lane.getLength(), LONGEST, "m"),
        ("width", lane.getWidth(), WIDEST, "m"),
        ("speed", lane.getSpeed(), FASTEST, "m/s"),
    ):
        if not 0.0 < value <= most:
            yield f"lane {name} has a {what} of {value:g} {unit}; it must be above 0 and at most {most:g}"


def _lies_well(points: Any) -> bool:
    return bool(np.all(np.abs(points) <= FARTHEST))


def _wrong_requests(net: Any) -> Iterator[str]:
    """Nodes whose right of way is not stated for the ways that lead through them."""
    crossings = Counter(
        edge.getID()[1:].rpartition("_c")[0] for edge in net.getEdges() if edge.getFunction() == "crossing"
    )
    for node in net.getNodes():
        stated = node._prohibits
        if not stated:
            continue
        name = node.getID()
        ways = crossings[name] + sum(
            len(links)
            for edge in node.getIncoming()
            if edge.getFunction() == ""
            for onto, links in edge.getOutgoing().items()
            if onto.getFunction() == ""
        )
        if len(stated) != ways:
            yield (
                f"junction {name!r} states right of way for {len(stated)} ways through it, and has {ways}: "
                "a <connection> or a <request> is missing"
            )
        elif sorted(stated) != list(range(ways)):
            yield f"the <request>s of junction {name!r} are not numbered from 0 to {ways - 1}"
        elif any(
            len(row) != ways or set(row) - set("01") for row in (*stated.values(), *node._foes.values())
        ):
            yield f"a <request> of junction {name!r} does not say 0 or 1 for each of its {ways} ways"
