"""Makes lanes, arms and movements from what the reader found in the network file."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np

from rudc.arrays import Array, Flags
from rudc.network.polyline import (
    headings,
    signed_area,
    strip,
    without_repeats,
    wrap,
)
from rudc.network.reader import VEHICLE_CLASS, Junction, Way, leads_on
from rudc.network.road import COMPASS, RAILS, ROAD_USERS, Arm, Lane, Movement, ReservedLane, Turn
from rudc.network.sides import RawArm, place_along, shape_of

STRAIGHT = np.radians(30.0)
"""rad, a change of heading smaller than this is no turn"""
ALIKE = np.radians(1.0)
"""rad, changes of heading to both sides that differ by less are equal: files have centimetres, and whoever
draws a fork is no more exact"""
LOOK_OUT = 20.0
"""m of an arm next to the junction over which its direction is taken"""
OVERHANG = 10.0
"""m that the drivable area reaches beyond the outer end of an arm, so that the end is no edge of the road"""
OVERLAP = 0.5
"""m that each lane's area reaches beyond its ends, so that lanes and nodes join without gaps"""
SWEPT = 2.6
"""m, widest strip that counts as drivable along a lane inside a node (the node's own shape says the rest)"""


def make_lane(raw: Any) -> Lane:
    """The `Lane` made from a sumolib lane."""
    xy = without_repeats(shape_of(raw))
    edge = raw.getEdge()
    lane = Lane(
        id=raw.getID(),
        edge=edge.getID(),
        index=int(raw.getIndex()),
        width=float(raw.getWidth()),
        length=float(raw.getLength()),
        speed=float(raw.getSpeed()),
        xy=xy,
        heading=headings(xy),
        polygon=strip(xy, float(raw.getWidth())),
        internal=edge.getFunction() != "",
        refuses=tuple(user for user in ROAD_USERS if not raw.allows(user)),
    )
    for array in (lane.xy, lane.heading, lane.polygon):
        array.flags.writeable = False
    return lane


def make_lanes(junction: Junction, arms: Sequence[RawArm], ways: Sequence[Way]) -> dict[str, Lane]:
    """All lanes of arms, ring and ways by id, in a fixed order."""
    raw = {lane.getID(): lane for lane in _lanes_of(junction, arms) if lane.allows(VEHICLE_CLASS)}
    for way in ways:
        raw.update((lane_id, junction.net.getLane(lane_id)) for lane_id in way.source.lane_ids)
    drawn = {lane_id: lane for lane_id, lane in raw.items() if len(without_repeats(shape_of(lane))) > 1}
    return {lane_id: make_lane(lane) for lane_id, lane in drawn.items()}


def _lanes_of(junction: Junction, arms: Sequence[RawArm]) -> list[Any]:
    """All lanes of the arms and of the ring."""
    edges = [edge for arm in arms for edge in (*arm.inbound, *arm.outbound)]
    edges += [junction.net.getEdge(edge) for edge in sorted(junction.ring)]
    return [lane for edge in edges for lane in edge.getLanes()]


def _nodes_within(arm: RawArm) -> list[Any]:
    """Nodes at which one edge of an arm passes into the next, once each."""
    ends = [e.getToNode() for e in arm.inbound[:-1]] + [e.getFromNode() for e in arm.outbound[1:]]
    return list(dict.fromkeys(ends))


def tracks_across(arms: Sequence[RawArm]) -> list[tuple[int, Array]]:
    """Where tracks cross an arm: the arm's place in `arms`, and (2,) m."""
    return [
        (k, np.array(node.getCoord()))
        for k, arm in enumerate(arms)
        for node in _nodes_within(arm)
        if node.getType() == "rail_crossing"
    ]


def lights_at(junction: Junction, arms: Sequence[RawArm]) -> tuple[str, ...]:
    """Ids of the nodes of the junction and of its arms that have traffic lights."""
    nodes = dict.fromkeys((*junction.nodes, *(node for arm in arms for node in _nodes_within(arm))))
    return tuple(node.getID() for node in nodes if str(node.getType()).startswith("traffic_light"))


def _closed_edges(junction: Junction, arms: Sequence[RawArm]) -> list[Any]:
    """The edges to and from the junction that are closed to cars as a whole, and so are of no arm."""
    ours = {edge.getID() for arm in arms for edge in (*arm.inbound, *arm.outbound)} | junction.ring
    there = {
        edge.getID(): edge for node in junction.nodes for edge in (*node.getIncoming(), *node.getOutgoing())
    }
    return [
        edge
        for name, edge in sorted(there.items())
        if name not in ours and not edge.getFunction() and not edge.allows(VEHICLE_CLASS)
    ]


def lanes_without_cars(junction: Junction, arms: Sequence[RawArm]) -> dict[str, tuple[str, ...]]:
    """Lanes at the junction that are closed to cars but open to others, trams and trains included: id -> who
    may use it."""
    edges = [edge for arm in arms for edge in (*arm.inbound, *arm.outbound)]
    lanes = [lane for edge in (*edges, *_closed_edges(junction, arms)) for lane in edge.getLanes()]
    users = {
        lane.getID(): tuple(user for user in (*ROAD_USERS, *RAILS) if lane.allows(user))
        for lane in lanes
        if not lane.allows(VEHICLE_CLASS)
    }
    return {name: allowed for name, allowed in users.items() if allowed}


def reserved_lanes(junction: Junction, arms: Sequence[RawArm]) -> tuple[ReservedLane, ...]:
    """Lanes of the arms, of the ring, and beside them at the junction that are closed to cars but open to
    anybody else."""
    beside = [lane for edge in _closed_edges(junction, arms) for lane in edge.getLanes()]
    raw = {
        lane.getID(): lane
        for lane in (*_lanes_of(junction, arms), *beside)
        if lane.getPermissions()
        and not lane.allows(VEHICLE_CLASS)
        and len(without_repeats(shape_of(lane))) > 1
    }
    areas = _lane_areas(arms, {name: make_lane(lane) for name, lane in raw.items()})
    return tuple(
        ReservedLane(area, lane.allows("pedestrian") and not any(map(lane.allows, ROAD_USERS)))
        for area, lane in zip(areas, raw.values(), strict=True)
    )


def stopping_lanes(arms: Sequence[RawArm]) -> frozenset[str]:
    """Ids of the lanes of the arms at whose end all must stop first: SUMO's link states s and w."""
    lanes = [lane for arm in arms for edge in arm.inbound[-1:] for lane in edge.getLanes()]
    return frozenset(
        lane.getID() for lane in lanes if any(link.getState() in ("s", "w") for link in lane.getOutgoing())
    )


def centre_of(junction: Junction) -> Array:
    """(2,) m, the node's position; for a roundabout, the mean of its nodes' positions."""
    return np.mean([node.getCoord() for node in junction.nodes], axis=0)


def in_order(raw: Sequence[RawArm], centre: Array) -> list[RawArm]:
    """The arms counter-clockwise from the east."""
    bearings = [_bearing(_axis(arm)[1], centre) for arm in raw]
    order = sorted(range(len(raw)), key=lambda k: round((bearings[k] + 1e-3) % (2 * np.pi), 6))
    return [raw[k] for k in order]


def _axis(raw: RawArm) -> tuple[Array, Array]:
    """(2,), (2,) m, the arm's middle next to the junction and LOOK_OUT m out."""
    inbound = [shape_of(edge)[::-1] for edge in reversed(raw.inbound[:-1])]
    outbound = [shape_of(edge) for edge in raw.outbound[1:]]
    lines = [[shape_of(lane)[::-1], *inbound] for edge in raw.inbound[-1:] for lane in edge.getLanes()]
    lines += [[shape_of(lane), *outbound] for edge in raw.outbound[:1] for lane in edge.getLanes()]
    far = [place_along(line, LOOK_OUT) for line in lines]
    return np.mean([line[0][0] for line in lines], axis=0), np.mean(far, axis=0)


def _bearing(far: Array, centre: Array) -> float:
    """rad, direction from the junction's centre."""
    return float(np.arctan2(*(far - centre)[::-1]))


def make_arms(raw: Sequence[RawArm], lanes: dict[str, Lane], centre: Array) -> list[Arm]:
    """Arms in the order of `raw`; `decide_major` sets their `major` later."""
    arms = [_make_arm(arm, lanes, centre) for arm in raw]
    words = [arm.name for arm in arms]
    return [
        replace(arm, name=f"{arm.name}_{arm.in_edge or arm.out_edge}") if words.count(arm.name) > 1 else arm
        for arm in arms
    ]


def _make_arm(raw: RawArm, lanes: dict[str, Lane], centre: Array) -> Arm:
    near, far = _axis(raw)
    bearing = _bearing(far, centre)
    inwards = near - far
    ways = [edges for edges in (raw.inbound, raw.outbound) if edges]
    length = sum(float(edge.getLength()) for edges in ways for edge in edges) / len(ways)
    return Arm(
        name=COMPASS[round(bearing / (np.pi / 4)) % 8],
        in_edge=raw.inbound[-1].getID() if raw.inbound else None,
        out_edge=raw.outbound[0].getID() if raw.outbound else None,
        in_edges=tuple(edge.getID() for edge in raw.inbound),
        out_edges=tuple(edge.getID() for edge in raw.outbound),
        bearing=bearing,
        heading_in=float(np.arctan2(inwards[1], inwards[0])),
        length=length,
        in_lanes=_lane_ids(raw.inbound[-1:], lanes),
        out_lanes=_lane_ids(raw.outbound[:1], lanes),
        major=False,
    )


def _lane_ids(edges: Iterable[Any], lanes: dict[str, Lane]) -> tuple[str, ...]:
    return tuple(lane.getID() for edge in edges for lane in edge.getLanes() if lane.getID() in lanes)


def decide_major(arms: Sequence[Arm], ways: Sequence[Way], yields: Flags, node_type: str) -> list[Arm]:
    """The arms, each marked major if no way from it must yield to a way from another arm, or if one that need
    not is yielded to by another arm's. Of a right turn the latter counts only where it follows a main road
    that bends, and so leads to an arm that is major without it: beside others that turn into lanes of their
    own a minor arm's right turn may be free, too. Where traffic from the right goes first no arm is major,
    although right turns yield to nobody there.
    """
    if node_type == "right_before_left":
        return [replace(arm, major=False) for arm in arms]
    owes = _owes_others(ways, yields)
    bound, owed = np.any(owes, axis=1), np.any(owes, axis=0)
    free = [way.source for way, counts in zip(ways, ~bound & owed, strict=True) if counts]
    right = [_angle(arms, way.origin, way.destination) < -STRAIGHT for way in free]
    waiting = {way.source.origin for way, waits in zip(ways, bound, strict=True) if waits}
    major = {way.source.origin for way in ways} - waiting
    major |= {way.origin for way, turns in zip(free, right, strict=True) if not turns}
    major |= {
        way.origin for way, turns in zip(free, right, strict=True) if turns and way.destination in major
    }
    return [replace(arm, major=k in major) for k, arm in enumerate(arms)]


def _angle(arms: Sequence[Arm], o: int, d: int) -> float:
    """rad, the change of heading from one arm's end to another's beginning; above 0 to the left."""
    return float(wrap(arms[d].heading_in + np.pi - arms[o].heading_in))


def _owes_others(ways: Sequence[Way], yields: Flags) -> Flags:
    """(P, P) whether each way must yield to each other that comes from another arm."""
    origin = np.array([way.source.origin for way in ways])
    return yields & (origin[:, None] != origin[None, :])


def make_movements(arms: Sequence[Arm], ways: Sequence[Way], yields: Flags) -> list[Movement]:
    """Movements in the order of their first rows."""
    bound = np.any(_owes_others(ways, yields), axis=1)
    rows: dict[tuple[int, int], list[int]] = {}
    for row, way in enumerate(ways):
        rows.setdefault((way.source.origin, way.source.destination), []).append(row)
    movements = []
    for (o, d), members in rows.items():
        angle = _angle(arms, o, d)
        back = o == d or all(ways[row].turns_back for row in members)
        movements.append(
            Movement(
                origin=arms[o].name,
                destination=arms[d].name,
                turn="u_turn" if back else _turn(arms, rows, o, d, angle),
                angle=angle,
                edges=_edges(arms[o], arms[d], ways[members[0]]),
                rows=tuple(members),
                major=not bound[members].any(),
            )
        )
    return movements


def _turn(arms: Sequence[Arm], rows: Iterable[tuple[int, int]], o: int, d: int, angle: float) -> Turn:
    """The name of a turn that does not lead back. If several destinations lie nearly straight on, only the
    straightest is `straight`; of two that lie equally far to both sides (within ALIKE), none.
    """
    others = [_angle(arms, o, b) for a, b in rows if a == o and b not in (o, d)]
    straighter = any(abs(other) < abs(angle) for other in others)
    forked = any(other * angle < 0.0 and abs(other + angle) < ALIKE for other in others)
    if abs(angle) < STRAIGHT and not straighter and not forked:
        return "straight"
    return "left" if angle > 0 else "right"


def refused_classes(
    net: Any, movements: Iterable[Movement], lanes: Iterable[Lane]
) -> dict[tuple[str, str], frozenset[str]]:
    """`Layout.refused`."""
    on: dict[str, list[set[str]]] = {}
    for lane in lanes:
        on.setdefault(lane.edge, []).append({*lane.refuses})
    refused: dict[tuple[str, str], frozenset[str]] = {}
    for movement in movements:
        found = set[str]().union(*(set.intersection(*on[edge]) for edge in movement.edges if edge in on))
        for edge, following in pairwise(map(net.getEdge, movement.edges)):
            links = edge.getOutgoing().get(following, ())
            found |= {user for user in ROAD_USERS if not any(leads_on(link, user) for link in links)}
        refused[movement.origin, movement.destination] = frozenset(found)
    return refused


def _edges(origin: Arm, destination: Arm, way: Way) -> tuple[str, ...]:
    middle = way.source.lane_ids[way.source.before_junction : -way.source.after_junction]
    ring = [lane_id.rpartition("_")[0] for lane_id in middle if not lane_id.startswith(":")]
    return (*origin.in_edges, *dict.fromkeys(ring), *destination.out_edges)


def drivable_polygons(junction: Junction, arms: Sequence[RawArm], lanes: dict[str, Lane]) -> list[Array]:
    """Polygons (K, 2) m whose union is the drivable area: lanes, nodes, and an overhang where arms end."""
    polygons = _lane_areas(arms, lanes)
    nodes = {node.getID(): node for node in junction.nodes}
    for arm in arms:
        for edge in (*arm.inbound, *arm.outbound):
            nodes.update((node.getID(), node) for node in (edge.getFromNode(), edge.getToNode()))
    shapes = [shape_of(node) for node in nodes.values()]
    return polygons + [shape for shape in shapes if len(shape) >= 3 and abs(signed_area(shape)) > 1.0]


def _lane_areas(arms: Sequence[RawArm], lanes: dict[str, Lane]) -> list[Array]:
    """(2K, 2) m each, what the lanes cover, with an overhang where arms end."""
    outer = {lane for arm in arms for lane in _lane_ids(arm.inbound[:1], lanes)}
    outer_ends = {lane for arm in arms for lane in _lane_ids(arm.outbound[-1:], lanes)}
    return [
        lane_area(
            lane, OVERHANG if lane.id in outer else OVERLAP, OVERHANG if lane.id in outer_ends else OVERLAP
        )
        for lane in lanes.values()
    ]


def lane_area(lane: Lane, before: float = OVERLAP, after: float = OVERLAP) -> Array:
    """(2K, 2) m, the polygon that a lane covers, reaching `before` and `after` m straight on beyond its
    ends."""
    xy = np.array(lane.xy)
    xy[0] -= before * _unit(xy[1] - xy[0])
    xy[-1] += after * _unit(xy[-1] - xy[-2])
    return strip(xy, min(lane.width, SWEPT) if lane.internal else lane.width)


def joint(before: Sequence[Lane], after: Sequence[Lane]) -> Array:
    """(K, 2) m, the road between the end of one edge of an arm and the beginning of the next, of which these
    are the lanes: the convex hull of their last and first OVERLAP m.
    """
    from scipy.spatial import ConvexHull  # few networks need it

    ends = [_end_area(lane.xy[-1], lane.heading[-1] + np.pi, lane.width) for lane in before]
    ends += [_end_area(lane.xy[0], lane.heading[0], lane.width) for lane in after]
    points = np.concatenate(ends)
    return points[ConvexHull(points).vertices]


def _end_area(end: Array, inwards: float, width: float) -> Array:
    """(4, 2) m, corners of the OVERLAP m of a lane at one of its ends, from which `inwards` rad leads on."""
    along = np.array([np.cos(inwards), np.sin(inwards)])
    aside = 0.5 * width * np.array([-along[1], along[0]])
    return end + np.array([-aside, aside, aside + OVERLAP * along, -aside + OVERLAP * along])


def _unit(d: Array) -> Array:
    return d / np.hypot(*d)
