"""`network check`: what was read from a network file, and what in it will cause trouble."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations, product
from pathlib import Path

import numpy as np

from rudc.geometry import rectangle_gaps
from rudc.network.conflicts import undecided
from rudc.network.network import Network, load_network
from rudc.network.polyline import arc_length, beside, resample
from rudc.network.road import Arm, Lane, Movement
from rudc.network.route import Route
from rudc.network.route_builder import room_on_road
from rudc.network.tiles import SEAM

SHORT_ARM = 60.0
"""m: less leaves no room to start, follow and brake"""
NARROW_LANE = 2.6
"""m: less leaves a car of 1.8 m no margin"""
SHORT_WAY = 35.0
"""m of lane beyond the junction: enough for a car to arrive 30 m beyond it, where scenarios end by default"""
FAST = 15.0
"""m/s: the ego drives no faster"""


@dataclass(frozen=True)
class ArmReport:
    """One arm as understood."""

    name: str
    """compass name"""
    bearing_deg: float
    """degrees counter-clockwise from east; in the west 180, and not -180"""
    length_m: float
    """m, the largest `at` on any of its lanes"""
    in_lanes: int
    """lanes towards the junction"""
    out_lanes: int
    """lanes away from it"""
    lane_width_m: float
    """m, its narrowest lane"""
    speed_mps: float
    """m/s, highest limit on it"""
    major: bool
    """whether it has priority"""


@dataclass(frozen=True)
class MovementReport:
    """One movement as understood."""

    origin: str
    """arm"""
    destination: str
    """arm"""
    turn: str
    """left, straight or right"""
    lanes: tuple[int, ...]
    """indices of the inbound lanes that permit it"""
    yields: bool
    """whether it must yield to traffic of some other arm"""
    length_m: float
    """m from stop line to the junction's exit"""
    least_radius_m: float
    """m, tightest bend of the ego's path (inf where it is straight)"""
    waiting_m: float | None
    """m beyond the stop line that the front bumper may wait; None where it need not yield"""


@dataclass(frozen=True)
class NetworkReport:
    """What `check_network` understood."""

    network: Network
    """the network itself, for drawing it"""
    name: str
    """file name without its endings"""
    junction: str
    """id of its node (of a roundabout: of the first one)"""
    kind: str
    """SUMO's node type, or `roundabout`"""
    road_km: float
    """km of two-way road: vehicles are counted per km of it"""
    arms: tuple[ArmReport, ...]
    """counter-clockwise from the east"""
    movements: tuple[MovementReport, ...]
    """those that scenarios may use, in the order of arms and lanes: nobody turns back"""
    warnings: tuple[str, ...]
    """what will cause trouble, one sentence each; empty when all is well"""


def check_network(source: str | Path, junction: str | None = None) -> NetworkReport:
    """Reads a network (shipped name or .net.xml) and checks all that the simulation will need from it.
    Raises NetworkError."""
    network = load_network(source, junction)
    network.refuse_lights()
    routes = {(m.origin, m.destination): network.route(m.origin, m.destination) for m in network.onward}
    warnings = [
        *_node_warnings(network),
        *(text for arm in network.arms for text in _arm_warnings(network, arm)),
        *_movement_warnings(network),
        *(text for route in routes.values() for text in _route_warnings(network, route)),
        *waiting_warnings(list(routes.values())),
        *_undecided_warnings(network),
    ]
    return NetworkReport(
        network=network,
        name=network.name,
        junction=network.nodes[0],
        kind="roundabout" if network.is_roundabout else network.node_type,
        road_km=network.road_km,
        arms=tuple(_arm_report(network, arm) for arm in network.arms),
        movements=tuple(
            _movement_report(network, m, routes[m.origin, m.destination]) for m in network.onward
        ),
        warnings=tuple(warnings),
    )


def _arm_report(network: Network, arm: Arm) -> ArmReport:
    lanes, bearing = network.lanes_of(arm), math.degrees(arm.bearing)
    return ArmReport(
        name=arm.name,
        bearing_deg=bearing + 360.0 if round(bearing) == -180 else bearing,
        length_m=max(network.stretch(lane).reach for lane in (*arm.in_lanes, *arm.out_lanes)),
        in_lanes=len(arm.in_lanes),
        out_lanes=len(arm.out_lanes),
        lane_width_m=min(lane.width for lane in lanes),
        speed_mps=max(lane.speed for lane in lanes),
        major=arm.major,
    )


def _movement_report(network: Network, movement: Movement, route: Route) -> MovementReport:
    return MovementReport(
        origin=movement.origin,
        destination=movement.destination,
        turn=movement.turn,
        lanes=tuple(sorted({network.inbound_lane(row).index for row in movement.rows})),
        yields=not movement.major,
        length_m=route.exit_s - route.stop_line_s,
        least_radius_m=_least_radius(route),
        waiting_m=None if movement.major else route.waiting_s - route.stop_line_s,
    )


def _least_radius(route: Route) -> float:
    bend = float(np.abs(route.path.curvature).max())
    return 1.0 / bend if bend > 1e-3 else float("inf")


def _node_warnings(network: Network) -> Iterator[str]:
    if network.node_type == "unregulated":
        yield (
            "the junction is `unregulated`: SUMO's vehicles drive through each other there; give its node "
            "the type `priority` or `allway_stop`"
        )
    reserved: dict[tuple[str, ...], list[str]] = {}
    for lane, users in network.left_out.items():
        reserved.setdefault(users, []).append(lane)
    for users, lanes in reserved.items():
        what = f"lanes {', '.join(lanes)} are" if len(lanes) > 1 else f"lane {lanes[0]} is"
        yield f"{what} closed to cars (for {', '.join(users)} only) and left out: no part of the ego's road"


def _arm_warnings(network: Network, arm: Arm) -> Iterator[str]:
    lengths = {lane.edge: lane.length for lane in network.lanes_of(arm) if lane.edge in arm.in_edges}
    length = sum(lengths.values())
    if arm.in_lanes and length < SHORT_ARM:
        yield (
            f"arm {arm.name} is only {length:.0f} m long on its way in; from {SHORT_ARM:.0f} m on there is "
            "room to start, follow and brake (others enter at its outer end, near the junction)"
        )
    for x, y in (place - network.center for k, place in network.tracks if network.arms[k] is arm):
        yield (
            f"tracks cross arm {arm.name} at [{x:.0f}, {y:.0f}], {math.hypot(x, y):.0f} m from the "
            "junction's centre: there are no trains here"
        )
    if not arm.in_lanes:
        yield f"arm {arm.name} is one-way: nothing enters by it"
    if not arm.out_lanes:
        yield f"arm {arm.name} is one-way: nothing leaves by it"
    fast: dict[float, list[str]] = {}
    used = {network.inbound_lane(row).id for movement in network.onward for row in movement.rows}
    for lane in network.lanes_of(arm):
        name = _name(network, lane)
        if lane.width < NARROW_LANE:
            yield (
                f"lane {name} is only {lane.width:.2f} m wide; from {NARROW_LANE:.1f} m on a car of 1.8 m "
                "has a margin"
            )
        if lane.speed > FAST:
            fast.setdefault(lane.speed, []).append(name)
        if lane.refuses:
            yield f"lane {name} refuses {', '.join(lane.refuses)}; such traffic cannot appear on it"
        if lane.id in arm.in_lanes and lane.id not in used:
            helps = (
                "; ways do not change lanes on a ring, so the ring's lane that it enters must reach an exit "
                "(connections in a .con.xml)"
                if network.is_roundabout
                else ""
            )
            yield f"lane {name} leads nowhere: no way from it reaches another arm{helps}"
    yield from _shared_lanes(network, arm)
    for speed, fast_ones in fast.items():
        names = [name for name in fast_ones if name in network.lane_names] or fast_ones
        have = f"lanes {', '.join(names)} have" if len(names) > 1 else f"lane {names[0]} has"
        yield f"{have} a limit of {speed:.1f} m/s; the ego drives at most {FAST:.0f} m/s"


def _shared_lanes(network: Network, arm: Arm) -> Iterator[str]:
    """A warning for each pair of lanes of opposite directions that overlap."""
    lanes = network.lanes_of(arm)
    ins, outs = ([lane for lane in lanes if lane.edge in edges] for edges in (arm.in_edges, arm.out_edges))
    for one, other in product(ins, outs):
        if _overlap(one, other):
            yield (
                f"lanes {_name(network, one)} and {_name(network, other)} overlap, although their directions "
                "are opposite: who meets there may have no room to pass, and no `wrong_way` is noticed"
            )


def _overlap(one: Lane, other: Lane) -> bool:
    """Whether two lanes overlap by more than SEAM m somewhere along both."""
    along, aside = beside(one.xy, resample(other.xy, np.arange(0.0, arc_length(other.xy)[-1], 1.0)))
    level = (along >= 0.0) & (along <= arc_length(one.xy)[-1])
    return bool((np.abs(aside[level]) < 0.5 * (one.width + other.width) - SEAM).any())


def _name(network: Network, lane: Lane) -> str:
    """A lane's name in scenarios; for one farther out on an arm, SUMO's id."""
    return next((name for name, known in network.lane_names.items() if known == lane.id), lane.id)


def _movement_warnings(network: Network) -> Iterator[str]:
    there = {(m.origin, m.destination) for m in network.movements}
    for origin in network.arms:
        lacking = [
            arm.name for arm in network.arms
            if arm is not origin and arm.out_lanes and (origin.name, arm.name) not in there
        ]  # fmt: skip
        if origin.in_lanes and lacking:
            arms = f"arm{'s' if len(lacking) > 1 else ''} {', '.join(lacking)}"
            yield f"no movement leads from arm {origin.name} to {arms}"
    for m in network.movements:
        if m.turn == "u_turn" and m.origin != m.destination:
            yield f"the way from arm {m.origin} to arm {m.destination} turns back, and is left out"


def _route_warnings(network: Network, route: Route) -> Iterator[str]:
    way = f"the ego's path from {route.origin} to {route.destination}"
    radius, least = _least_radius(route), 1.0 / network.vehicle.tightest
    if radius < least:
        place = _place(network, route, int(np.abs(route.path.curvature).argmax()))
        yield f"{way} bends with a radius of {radius:.2f} m {place}; its turning circle needs {least:.2f} m"
    room = room_on_road(network, route.path, network.vehicle)
    if room.min() < 0.0:
        yield f"{way} leaves the road with a corner of the car {_place(network, route, int(room.argmin()))}"
    if (against := against_lane(network, route)) is not None:
        yield against
    edges, last = network.arm(route.destination).out_edges, network.paths.lane_ids[route.row][-1]
    left = route.length - route.exit_s
    if network.lanes[last].edge != edges[-1] and left < SHORT_WAY:
        yield f"{way} ends with its lane {left:.0f} m beyond the junction; it arrives there at the latest"


def against_lane(network: Network, route: Route) -> str | None:
    """A warning where a route's path lies in a lane of the opposite direction, so that whoever follows it
    drives the wrong way (rudc/world/borders.py)."""
    ways = np.array([network.surface.direction(x, y) for x, y in route.path.xy.tolist()])
    wrong = np.flatnonzero(np.cos(route.path.heading - ways) < 0.0)  # nan, where there is none, is not
    if not len(wrong):
        return None
    return (
        f"the ego's path from {route.origin} to {route.destination} lies in a lane of the opposite direction "
        f"{_place(network, route, int(wrong[0]))}: an episode ends there as `wrong_way`, often "
        "since the car cannot turn so sharply: a wider angle helps, or `ego.may_cross_centre: true`"
    )


def _place(network: Network, route: Route, k: int) -> str:
    """`at [12, -3], 8 m before its stop line`: where place k of a route's path is, in m from the junction's
    centre."""
    x, y = (route.path.xy[k] - network.center).tolist()
    beyond = float(route.path.s[k]) - route.stop_line_s
    return f"at [{x:.0f}, {y:.0f}], {abs(beyond):.0f} m {'before' if beyond < 0 else 'beyond'} its stop line"


def waiting_warnings(routes: list[Route]) -> Iterator[str]:
    """A warning for each pair of routes from different arms on which two waiting cars would overlap."""
    waiting = [route for route in routes if route.waiting_s > route.stop_line_s]
    for a, b in combinations(waiting, 2):
        if a.origin != b.origin and waiting_gap(a, b) <= 0.0:
            yield (
                f"waiting inside the junction, a car from {a.origin} to {a.destination} and one "
                f"from {b.origin} to {b.destination} overlap"
            )


def _undecided_warnings(network: Network) -> Iterator[str]:
    """A warning for each pair of movements whose vehicles meet and have no right of way."""
    paths = network.paths
    if network.node_type == "unregulated":  # has a warning of its own
        return

    def way(row: int) -> str:
        origin, destination = (network.arms[k].name for k in (paths.origin[row], paths.destination[row]))
        return f"from {origin} to {destination}"

    against, across = ([(way(a), way(b)) for a, b in pairs] for pairs in undecided(paths))
    for one, other in dict.fromkeys(against):
        yield (
            f"vehicles {one} and {other} meet head-on in the junction, and neither must yield: they may "
            "stand for good; give the junction's node another `radius`, or the connections other shapes"
        )
    for one, other in dict.fromkeys(across):
        yield (
            f"the ways of vehicles {one} and {other} cross or merge in the junction, and neither must yield: "
            'they may collide; no connection there should have `pass="true"`'
        )


def waiting_gap(a: Route, b: Route) -> float:
    """m between two cars that wait as far into the junction as their routes allow; 0 where they overlap."""
    car = (a.key.vehicle.length, a.key.vehicle.width)
    x, y, psi = a.path.pose(np.array([a.waiting_s - car[0] / 2, 0.0]))
    u, v, phi = b.path.pose(np.array([b.waiting_s - car[0] / 2, 0.0]))
    position, heading = np.array([[u[0], v[0]]]), phi[:1]
    return float(
        rectangle_gaps(float(x[0]), float(y[0]), float(psi[0]), *car, position, heading, np.array([car]))[0]
    )
