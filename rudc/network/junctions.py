"""Which junctions a network has, for whoever must choose one; each is only looked at, not read in full."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from rudc.errors import NetworkError
from rudc.network.assembly import centre_of, lights_at
from rudc.network.net_file import read_net, understood
from rudc.network.reader import Junction, all_junctions, find_arms, find_ways


@dataclass(frozen=True)
class JunctionReport:
    """One of a network's junctions."""

    id: str
    """what `junction` in a scenario's file names: its node (of a roundabout: the first one)"""
    kind: str
    """SUMO's node type, or `roundabout`"""
    arms: int
    """how many roads meet there"""
    x_m: float
    """m, where its centre lies in the file"""
    y_m: float
    """m, the same northwards"""
    unusable: str | None
    """why no scenario can use it; None where one can"""


def list_junctions(path: Path) -> list[JunctionReport]:
    """The junctions of a .net.xml, in the order of their ids. Raises NetworkError."""
    with understood(path):
        return [_report(junction) for junction in all_junctions(read_net(path))]


def _report(junction: Junction) -> JunctionReport:
    arms = find_arms(junction)
    x, y = centre_of(junction).tolist()
    node = junction.nodes[0]
    unusable = "traffic lights" if lights_at(junction, arms) else None
    try:
        if not find_ways(junction, arms):
            unusable = "no connection leads through it"
    except NetworkError as error:
        unusable = str(error)
    kind = "roundabout" if junction.is_roundabout else str(node.getType())
    return JunctionReport(node.getID(), kind, len(arms), x, y, unusable)
