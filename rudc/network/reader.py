"""Reads a SUMO network file: which junction, which arms, which lane-to-lane ways lead through it, who yields.

Everything comes from the .net.xml by sumolib. A "junction" is one node, or all nodes of a roundabout with the
ring between them. An arm is the road from the junction out to the next real junction or dead end; nodes on
the way at which the road merely changes (lanes, speed, direction) are passed through. Only lanes for cars
count.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from rudc.arrays import Flags
from rudc.errors import JunctionError, NetworkError, SeveralJunctionsError
from rudc.hints import listed
from rudc.network.paths import PathSource
from rudc.network.sides import RawArm, paired, roads_to_one

VEHICLE_CLASS = "passenger"
"""SUMO's class of cars: a lane that refuses them is no part of the carriageway"""

TURNS_BACK = ("t", "T")
"""SUMO's directions of connections that lead back where one came from"""


@dataclass(frozen=True)
class Way:
    """A chain of connections from an arm's last inbound lane to another's first outbound lane."""

    source: PathSource
    links: tuple[tuple[str, int], ...]
    """(node, link index) of each connection of the chain at a node of the junction"""
    turns_back: bool
    """whether it is a single connection whose direction in SUMO's file is a turn back (TURNS_BACK)"""


@dataclass(frozen=True)
class Junction:
    """The chosen junction and what leads to and from it."""

    net: Any
    nodes: tuple[Any, ...]
    ring: frozenset[str]
    """ids of the edges between the junction's own nodes (a roundabout's ring)"""
    alias: dict[str, str]
    """node -> name of the roundabout it belongs to, over the whole file"""

    @property
    def node_ids(self) -> set[str]:
        """Ids of its nodes."""
        return {node.getID() for node in self.nodes}

    @property
    def is_roundabout(self) -> bool:
        """Whether it is a ring of nodes."""
        return len(self.nodes) > 1


def choose_junction(net: Any, wanted: str | None, path: Path) -> Junction:
    """The junction named `wanted` (a node, or any node of a roundabout), or the only one there is."""
    alias = _roundabout_alias(net)
    groups = _junction_groups(net, alias)
    names = sorted(groups)
    if wanted is not None:
        for nodes in groups.values():
            if wanted in {node.getID() for node in nodes}:
                return _junction(net, nodes, alias)
        raise JunctionError(
            f"{path}: no junction {wanted!r} in this network; there are: {listed(names) or 'none'}"
        )
    if len(groups) == 1:
        return _junction(net, groups[names[0]], alias)
    if not groups:
        raise NetworkError(f"{path}: no junction with at least three arms in this network")
    raise SeveralJunctionsError(
        f"{path}: several junctions in this network; choose one by `junction: ID` in the scenario's file "
        f"(of `rudc network check`, which has a table of them: by --junction ID): {listed(names)}"
    )


def all_junctions(net: Any) -> list[Junction]:
    """The junctions that there are, by name."""
    alias = _roundabout_alias(net)
    return [_junction(net, nodes, alias) for _, nodes in sorted(_junction_groups(net, alias).items())]


def _junction(net: Any, nodes: tuple[Any, ...], alias: dict[str, str]) -> Junction:
    ids = {node.getID() for node in nodes}
    ring = frozenset(
        edge.getID()
        for node in nodes
        for edge in node.getOutgoing()
        if not edge.getFunction() and edge.getToNode().getID() in ids
    )
    return Junction(net, nodes, ring, alias)


def _roundabout_alias(net: Any) -> dict[str, str]:
    """Node -> first node of the roundabout it belongs to; the roundabout has that node's name."""
    alias = {}
    for roundabout in net.getRoundabouts():
        ids = list(roundabout.getNodes())
        alias.update(dict.fromkeys(ids, ids[0]))
    return alias


def _junction_groups(net: Any, alias: dict[str, str]) -> dict[str, tuple[Any, ...]]:
    """Real junctions by name: roundabouts, and nodes at which at least three roads meet."""
    groups: dict[str, tuple[Any, ...]] = {}
    for name in dict.fromkeys(alias.values()):
        groups[name] = tuple(net.getNode(node) for node, owner in alias.items() if owner == name)
    for node in net.getNodes():
        if node.getID() not in alias and not _is_passed_through(node, alias):
            groups[node.getID()] = (node,)
    return groups


def _is_passed_through(node: Any, alias: dict[str, str]) -> bool:
    """Whether at most two roads meet at the node: a dead end, or a road that only changes.

    A one-way road from a roundabout and one to it count as one road, so that the node at which its entry and
    its exit part is no junction.
    """
    roads = _roads((node,))
    exits = Counter(alias.get(road[0].getFromNode().getID()) for road in roads if road[1] is None)
    entries = Counter(alias.get(road[1].getToNode().getID()) for road in roads if road[0] is None)
    parted = sum(count for name, count in (exits & entries).items() if name is not None)
    return node.getID() not in alias and len(roads) - parted <= 2


def usable(edges: Iterable[Any]) -> list[Any]:
    """The normal edges that cars may use."""
    return [edge for edge in edges if edge.getFunction() == "" and _is_usable(edge)]


def _is_usable(element: Any) -> bool:
    """Whether cars may use an edge, a lane or a connection."""
    return element.allows(VEHICLE_CLASS)


def leads_on(link: Any, user: str = VEHICLE_CLASS) -> bool:
    """Whether a class of vehicles may use a connection and the two lanes that it joins."""
    return all(part.allows(user) for part in (link, link.getFromLane(), link.getToLane()))


def find_arms(junction: Junction) -> list[RawArm]:
    """The roads at the junction, each out to the next one."""
    arms = []
    taken = set[frozenset[Any]]()
    for inbound, outbound in _roads(junction.nodes):
        before = _extend(inbound, junction, taken, back=True) if inbound is not None else ()
        after = _extend(outbound, junction, taken, back=False) if outbound is not None else ()
        arms.append(RawArm(before, after))
        taken |= {_ends(edge) for edge in (*before, *after)}
    return paired(arms)


def _ends(edge: Any) -> frozenset[Any]:
    """The two nodes of an edge, which its opposite has, too."""
    return frozenset((edge.getFromNode(), edge.getToNode()))


def _roads(nodes: tuple[Any, ...]) -> list[tuple[Any, Any]]:
    """The roads that lead from the nodes to others: of each, the edge from there and the edge to there, or
    None where it is one-way."""
    neighbours: dict[Any, tuple[list[Any], list[Any]]] = {}
    towards = [(edge.getFromNode(), 0, edge) for node in nodes for edge in usable(node.getIncoming())]
    away = [(edge.getToNode(), 1, edge) for node in nodes for edge in usable(node.getOutgoing())]
    for other, way, edge in towards + away:
        if other not in nodes:
            neighbours.setdefault(other, ([], []))[way].append(edge)
    return [road for edges in neighbours.values() for road in roads_to_one(*edges)]


def _extend(edge: Any, junction: Junction, taken: set[frozenset[Any]], *, back: bool) -> tuple[Any, ...]:
    """The edge and those that continue it outwards, in driving order, up to a road between nodes that are
    `taken`: one that leaves the junction and comes back to it belongs to one of its two arms."""
    chain = [edge]
    while True:
        node = chain[-1].getFromNode() if back else chain[-1].getToNode()
        if not _is_passed_through(node, junction.alias):
            break
        inner = chain[-1].getToNode() if back else chain[-1].getFromNode()
        own = junction.node_ids | {inner.getID()}
        further = usable(node.getIncoming() if back else node.getOutgoing())
        ends = [
            e for e in further
            if (e.getFromNode() if back else e.getToNode()).getID() not in own
            and (_goes_on(e, chain[-1]) if back else _goes_on(chain[-1], e))
        ]  # fmt: skip
        if len(ends) != 1 or ends[0] in chain or _ends(ends[0]) in taken:
            break
        chain.append(ends[0])
    return tuple(reversed(chain)) if back else tuple(chain)


def _goes_on(edge: Any, following: Any) -> bool:
    """Whether an edge leads cars on to another, and not back where one came from."""
    links = edge.getOutgoing().get(following, ())
    return any(link.getDirection() not in TURNS_BACK and leads_on(link) for link in links)


def find_ways(junction: Junction, arms: list[RawArm]) -> list[Way]:
    """All lane-to-lane ways through the junction, in the order of arms and lanes."""
    targets = {arm.outbound[0].getID(): k for k, arm in enumerate(arms) if arm.outbound}
    ways = []
    for origin, arm in enumerate(arms):
        if not arm.inbound:
            continue
        for lane in filter(_is_usable, arm.inbound[-1].getLanes()):
            for connections in _chains(junction, lane, targets, ()):
                destination = targets[connections[-1].getTo().getID()]
                ways.append(_way(junction, arms, origin, destination, connections))
    return ways


def _chains(
    junction: Junction, lane: Any, targets: dict[str, int], so_far: tuple
) -> Iterator[tuple[Any, ...]]:
    """Sequences of connections from the lane to a lane of an outbound edge, at most once round the ring."""
    seen = {connection.getTo().getID() for connection in so_far}
    for connection in lane.getOutgoing():
        edge = connection.getTo()
        if not leads_on(connection):
            continue
        if edge.getID() in targets:
            yield (*so_far, connection)
        elif edge.getID() in junction.ring and edge.getID() not in seen:
            yield from _chains(junction, connection.getToLane(), targets, (*so_far, connection))


def _way(junction: Junction, arms: list[RawArm], origin: int, destination: int, connections: tuple) -> Way:
    before = _follow(junction.net, connections[0].getFromLane(), arms[origin].inbound, back=True)
    after = _follow(junction.net, connections[-1].getToLane(), arms[destination].outbound, back=False)
    middle: list[Any] = []
    for connection in connections:
        middle += _internal_lanes(junction.net, connection)
        if connection is not connections[-1]:
            middle.append(connection.getToLane())
    lanes = [*before, *middle, *after]
    source = PathSource(
        origin=origin,
        destination=destination,
        lane_ids=tuple(lane.getID() for lane in lanes),
        shapes=tuple(np.array(lane.getShape(), dtype=float) for lane in lanes),
        stated_lengths=tuple(float(lane.getLength()) for lane in lanes),
        before_junction=len(before),
        after_junction=len(after),
        limits=(*_limits(before), *[float(before[-1].getSpeed())] * len(middle), *_limits(after)),
    )
    links = tuple((c.getJunction().getID(), c.getJunctionIndex()) for c in connections)
    turns_back = len(connections) == 1 and connections[0].getDirection() in TURNS_BACK
    return Way(source, links, turns_back)


def _limits(lanes: list[Any]) -> list[float]:
    """m/s, the speed limit on each lane of an arm; inside a node of the arm it is at least the lower and at
    most the higher of those before and beyond."""
    found: list[float] = []
    for k, lane in enumerate(lanes):
        limit = float(lane.getSpeed())
        if lane.getID().startswith(":"):
            beyond = next(on.getSpeed() for on in lanes[k:] if not on.getID().startswith(":"))
            low, high = sorted((found[-1], float(beyond)))
            limit = min(max(limit, low), high)
        found.append(limit)
    return found


def _internal_lanes(net: Any, connection: Any) -> list[Any]:
    """Lanes inside a node that the connection leads over (several where it waits half-way)."""
    lanes = []
    via = connection.getViaLaneID()
    while via:
        if any(lane.getID() == via for lane in lanes):
            raise NetworkError(f"the lanes inside the junction go round in a circle at {via}")
        lanes.append(net.getLane(via))
        via = next((c.getViaLaneID() for c in lanes[-1].getOutgoing()), "")
    if not lanes:
        raise NetworkError(
            f"no lane inside the junction leads from {connection.getFromLane().getID()} to "
            f"{connection.getToLane().getID()}: build the network with internal links (netconvert without "
            "--no-internal-links)"
        )
    return lanes


def _follow(net: Any, lane: Any, edges: tuple[Any, ...], *, back: bool) -> list[Any]:
    """The lane and those for cars that continue it outwards on the arm's edges, with the lanes inside nodes
    between."""
    ids = {edge.getID() for edge in edges}
    chain = [lane]
    while True:
        links = _links_into(chain[0]) if back else chain[-1].getOutgoing()
        further = [(c, c.getFromLane() if back else c.getToLane()) for c in links if leads_on(c)]
        further = [(c, on) for c, on in further if on.getEdge().getID() in ids]
        if not further:
            return chain
        link, onto = min(further, key=lambda way: _lanes_aside(way[0]))
        if onto in chain:
            raise NetworkError(f"the road goes round in a circle at lane {chain[0 if back else -1].getID()}")
        between = _internal_lanes(net, link)
        chain = [onto, *between, *chain] if back else [*chain, *between, onto]


def _lanes_aside(link: Any) -> int:
    return abs(link.getFromLane().getIndex() - link.getToLane().getIndex())


def _links_into(lane: Any) -> list[Any]:
    return [c for links in lane.getEdge().getIncoming().values() for c in links if c.getToLane() is lane]


def right_of_way(junction: Junction, ways: list[Way]) -> Flags:
    """(P, P) [i, j]: way i must yield to way j at some node both pass, by SUMO's request matrix."""
    prohibits: dict[str, dict[int, str]] = {node.getID(): node._prohibits for node in junction.nodes}
    yields = np.zeros((len(ways), len(ways)), dtype=bool)
    for i, way in enumerate(ways):
        for node, link in way.links:
            response = prohibits[node].get(link, "")
            for j, other in enumerate(ways):
                for other_node, other_link in other.links:
                    if i != j and node == other_node and 0 <= other_link < len(response):
                        yields[i, j] |= response[-1 - other_link] == "1"
    return yields
