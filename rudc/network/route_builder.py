"""Builds `Route`: the ego's smooth reference path over a movement, its alternatives, and the road's edges
beside it.

Turns are drawn as one circular arc (fillet) between the centre lines of the inbound and the outbound lane,
extended straight into the junction: left turns with radius LEFT_RADIUS, which begins the turn as late as such
an arc can (two opposing left-turners then wait without overlapping), right turns with the widest arc that
fits. Where no arc that the car can drive fits between stop line and exit, or it would leave the road there,
the lanes' own shapes serve, and where they bend more tightly than it can turn, a wider line
(rudc/network/widening.py).
All lines are smoothed by a moving average of SMOOTHING m, so that curvature is continuous.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from rudc.arrays import Array
from rudc.geometry import rectangle_corners
from rudc.network.conflicts import through_waiting, waiting_bumper
from rudc.network.layout import Layout
from rudc.network.polyline import arc_length, resample, smooth, union_boundary, without_repeats, wrap
from rudc.network.road import Movement
from rudc.network.road_edges import edge_widths
from rudc.network.route import ReferencePath, Route, RouteKey
from rudc.network.widening import widened
from rudc.vehicle import EgoVehicle

LEFT_RADIUS = 10.5
"""m, arc of the ego's left turns"""
RIGHT_RADIUS = 15.0
"""m, widest arc of the ego's right turns"""
LEAST_RADIUS = 5.2
"""m, no fillet tighter than this, or than `EgoVehicle.tightest`"""
STRAIGHT_ON = np.radians(15.0)
"""rad, a movement that turns less follows the lanes' own shapes"""
SMOOTHING = 4.0
"""m, window of the moving average"""
LONGEST = 150.0
"""m, longest way through the junction for which a wider line is sought: the time grows with its square"""
FINE = 0.05
"""m, spacing at which lines are drawn before they are sampled"""
TASKS = {"left": 0, "u_turn": 0, "straight": 1, "right": 2}


def build_route(network: Layout, movement: Movement, lane: int | None, vehicle: EgoVehicle) -> Route:
    """The ego's route over a movement, from inbound lane index `lane` (None: left turns from the leftmost
    lane that permits the movement, all others from the rightmost)."""
    paths = network.paths
    row = start_row(network, movement, lane)
    arm = network.arm(movement.origin)
    line = network.centre_line(row)
    stop, exit_s = float(paths.stop_s[row]), float(paths.exit_s[row])
    path = _reference(network, row, stop, exit_s, movement, vehicle)

    def station(s: float) -> float:
        """m, arc length on the ego's path of the place at s m on the row's line."""
        return _station_of(path, resample(line, np.array([s]))[0], s)

    boundary = union_boundary(network.carriageway(movement))
    return Route(
        origin=movement.origin,
        destination=movement.destination,
        turn=movement.turn,
        task=TASKS[movement.turn],
        edges=movement.edges,
        row=row,
        alternatives=_alternatives(network, movement, row, vehicle),
        major=arm.major,
        limits=moved(paths.limits[row], station),
        canonical_angle=float(wrap(arm.heading_in - np.pi / 2)),
        key=RouteKey(network.path, network.junction, movement.origin, movement.destination, lane, vehicle),
        **along(network, row, path, station(stop), station(exit_s), boundary, vehicle),
    )


def along(
    network: Layout,
    row: int,
    path: ReferencePath,
    stop: float,
    exit_s: float,
    boundary: Array,
    body: EgoVehicle,
) -> dict[str, Any]:
    """The fields of a `Route` over `row` that go with its line: the line, where it stops, waits, meets others
    and ends, and the road's edges beside it. `stop`, `exit_s`: m, on the line; `boundary`: the carriageway's,
    as of `union_boundary`.
    """
    paths, table = network.paths, network.conflict(path)
    crossing = table[(paths.origin != paths.origin[row]) & np.isfinite(table[:, 0])]
    left, right = edge_widths(boundary, path, body)
    normal = np.column_stack([-np.sin(path.heading), np.cos(path.heading)])
    return {
        "path": path,
        "stop_line_s": stop,
        "waiting_s": waiting_bumper(path, paths, network.gives_way(path, row), stop, exit_s, body.width),
        "zone_start_s": float(crossing[:, 0].min()) if len(crossing) else stop,
        "zone_end_s": min(float(crossing[:, 1].max()), exit_s) if len(crossing) else stop,
        "exit_s": exit_s,
        "length": path.length,
        "left_edge": path.xy + left[:, None] * normal,
        "right_edge": path.xy - right[:, None] * normal,
        "left_width": left,
        "right_width": right,
    }


def moved(
    limits: tuple[tuple[float, float], ...], onto: Callable[[float], float]
) -> tuple[tuple[float, float], ...]:
    """The limits, as of `Route.limits`, on another line; `onto` turns arc lengths into those on it, m."""
    return tuple((begin if math.isinf(begin) else float(onto(begin)), limit) for begin, limit in limits)


def _station_of(path: ReferencePath, point: Array, near: float) -> float:
    return path.project(float(point[0]), float(point[1]), near)[0]


def start_row(network: Layout, movement: Movement, lane: int | None = None) -> int:
    """The row on which the ego starts: from the inbound lane of that index, or from its own."""
    rows = list(movement.rows)
    indices = [network.inbound_lane(row).index for row in rows]
    if lane is None:
        lane = max(indices) if movement.turn in ("left", "u_turn") else min(indices)
    return rows[indices.index(lane)]


def _alternatives(
    network: Layout, movement: Movement, row: int, vehicle: EgoVehicle
) -> tuple[ReferencePath, ...]:
    """Lines from the row's inbound lane to the other outbound lanes, where a car stays on the road."""
    line, stop = network.centre_line(row), float(network.paths.stop_s[row])
    candidates = []
    for other in _other_exits(network, movement, row):
        exit_s = float(network.paths.exit_s[other])
        joined = _join(line, stop, network.centre_line(other), exit_s, movement.angle, vehicle)
        if joined is not None:
            candidates.append(ReferencePath(joined))
    return tuple(path for path in candidates if fits(network, path, vehicle))


def _other_exits(network: Layout, movement: Movement, row: int) -> list[int]:
    """For each outbound lane other than the row's own, a row (from any lane) that ends on it."""
    own = network.outbound_lane(row).id
    exits: dict[str, int] = {}
    for other in range(network.paths.count):
        arm = network.arms[int(network.paths.destination[other])].name
        if arm == movement.destination and network.outbound_lane(other).id != own:
            exits.setdefault(network.outbound_lane(other).id, other)
    return list(exits.values())


def _reference(
    network: Layout, row: int, stop: float, exit_s: float, movement: Movement, vehicle: EgoVehicle
) -> ReferencePath:
    """The path over a row: the first of `_lines` that meets nobody of whom the right of way says nothing
    (`conflicts.silent`) and nobody who waits at a stop line (`through_waiting`); if each of them does, the
    first of those that meet fewest.
    """
    best, least = None, math.inf
    for line in _lines(network, network.centre_line(row), stop, exit_s, movement, vehicle):
        silent = np.isfinite(network.silent(line, row)[:, 0])
        met = int((silent | through_waiting(line, network.paths, row)).sum())
        if met < least:
            best, least = line, met
        if not least:
            break
    assert best is not None
    return best


def _lines(
    network: Layout, line: Array, stop: float, exit_s: float, movement: Movement, vehicle: EgoVehicle
) -> Iterator[ReferencePath]:
    """Lines to choose from, in this order: a fillet, if one fits and stays on the road; the lanes' own line,
    if a car can drive it; else a wider one, unless it leaves the road or the way through the junction is
    longer than LONGEST; else the lanes' own line in spite of that.
    """
    if abs(movement.angle) > STRAIGHT_ON and not network.is_roundabout:
        joined = _join(line, stop, line, exit_s, movement.angle, vehicle)
        if joined is not None and fits(network, path := ReferencePath(joined), vehicle):
            yield path
    fine = resample(line, np.arange(0.0, arc_length(line)[-1], FINE))
    lanes = ReferencePath(smooth(fine, FINE, SMOOTHING))
    if np.abs(lanes.curvature).max() <= vehicle.tightest and fits(network, lanes, vehicle, margin=0.0):
        yield lanes
        return
    if exit_s - stop <= LONGEST:
        wider = widened(network.surface, network.carriageway(movement), line, (stop, exit_s), vehicle)
        if fits(network, wider, vehicle, margin=0.0):
            yield wider
            return
    yield lanes


def _join(
    before: Array, stop: float, after: Array, exit_s: float, angle: float, vehicle: EgoVehicle
) -> Array | None:
    """(K, 2) m, smoothed: `before` up to its arc length stop, over the junction, `after` from its exit_s;
    None if there is no such line.

    Over the junction: an arc between the two tangents, or, nearly straight on, a cubic that shifts from lane
    to lane.
    """
    head = resample(before, np.arange(0.0, stop, FINE))
    tail = resample(after, np.arange(exit_s, arc_length(after)[-1], FINE))
    if len(head) < 2 or len(tail) < 2:
        return None
    p, u = head[-1], _unit(head[-1] - head[-2])
    q, v = tail[0], _unit(tail[1] - tail[0])
    middle = _fillet(p, u, q, v, angle, vehicle) if abs(angle) > STRAIGHT_ON else _shift(p, u, q, v)
    if middle is None:
        return None
    line = without_repeats(np.concatenate([head, middle, tail]))
    return smooth(resample(line, np.arange(0.0, arc_length(line)[-1], FINE)), FINE, SMOOTHING)


def _unit(d: Array) -> Array:
    return d / np.hypot(*d)


def _fillet(p: Array, u: Array, q: Array, v: Array, angle: float, vehicle: EgoVehicle) -> Array | None:
    """Arc from the ray p + a u to the ray that ends in q along v, for a turn by about `angle`."""
    turn = float(np.arctan2(u[0] * v[1] - u[1] * v[0], u @ v))
    if turn * angle <= 0 or abs(turn) < STRAIGHT_ON or abs(turn) > np.radians(150):
        return None
    a, b = np.linalg.solve(np.column_stack([u, v]), q - p)
    half = np.tan(abs(turn) / 2)
    radius = min(LEFT_RADIUS if angle > 0 else RIGHT_RADIUS, min(a, b) / half)
    if radius < max(LEAST_RADIUS, 1.0 / vehicle.tightest):
        return None
    start = p + (a - radius * half) * u
    side = np.sign(turn)
    centre = start + side * radius * np.array([-u[1], u[0]])
    swept = np.linspace(0.0, turn, max(2, int(radius * abs(turn) / FINE)))
    cos, sin = np.cos(swept), np.sin(swept)
    spoke = start - centre
    return centre + np.column_stack([cos * spoke[0] - sin * spoke[1], sin * spoke[0] + cos * spoke[1]])


def _shift(p: Array, u: Array, q: Array, v: Array) -> Array:
    """Cubic (Hermite) from p along u to q along v."""
    reach = float(np.hypot(*(q - p)))
    t = np.linspace(0.0, 1.0, max(2, int(reach / FINE)))[:, None]
    return (
        (2 * t**3 - 3 * t**2 + 1) * p
        + (t**3 - 2 * t**2 + t) * reach * u
        + (3 * t**2 - 2 * t**3) * q
        + (t**3 - t**2) * reach * v
    )


def fits(network: Layout, path: ReferencePath, vehicle: EgoVehicle, margin: float = 0.1) -> bool:
    """Whether a vehicle that follows the path keeps all of its body at least `margin` m on the road."""
    return bool(room_on_road(network, path, vehicle).min() >= margin)


def room_on_road(network: Layout, path: ReferencePath, vehicle: EgoVehicle) -> Array:
    """(n,) m, least distance from a corner of a vehicle to the road's edge, at each place of the path that it
    follows; negative beyond the edge."""
    xy, psi = path.body_pose(path.s, vehicle)
    size = np.broadcast_to([vehicle.length, vehicle.width], (len(xy), 2))
    return network.surface.signed_distance(rectangle_corners(xy, psi, size)).min(axis=1)
