"""How the ego starts: its route, drawn from the network, its speed, and whether the start is safe for
everybody.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple, TypeVar

import numpy as np

from rudc.arrays import Array
from rudc.errors import NetworkError, SimulationError
from rudc.geometry import rectangle_gaps
from rudc.network.paths import SPACING
from rudc.vehicle import Actuation
from rudc.world.bends import OVER_M, SHARE
from rudc.world.ego import DRY, GRAVITY, grip_of
from rudc.world.scene import Scene

if TYPE_CHECKING:
    from rudc.network.network import Lane, Network, Route
    from rudc.network.road import Movement
    from rudc.scenario.plan import EgoPlan, EpisodePlan

MARGIN_M = 2.0
"""m, least gap between the ego and anything at the start"""
REACTION_S = 0.5
"""s after which the vehicle behind brakes"""
BRAKING = 4.0
"""m/s2, with which the vehicle behind can brake, if the road lets it, and the one ahead may; and with which
the ego can brake for a bend"""
STRAIGHT = 1e-3
"""1/m, curvature below which a road counts as straight"""
ROUNDED_M = 0.1
"""m by which the length of a lane as stated in its file may differ, by rounding, from that of its centre line
"""


def movements_of(network: Network, plan: EgoPlan) -> list[Movement]:
    """The movements that fit a plan, at least one. Raises NetworkError if there is none."""
    movements = list(network.onward)
    if plan.origin is not None:
        wanted = network.arm(plan.origin).name
        movements = [m for m in movements if m.origin == wanted]
        if not movements:
            raise NetworkError(f"network {network.name}: no movement begins at arm {wanted}")
    from_there = movements
    if plan.turn is not None:
        movements = [m for m in movements if m.turn == plan.turn]
    if plan.destination is not None:
        wanted = network.arm(plan.destination).name
        movements = [m for m in movements if m.destination == wanted]
    if not movements:
        asked = (
            f" from {plan.origin}" if plan.origin else "",
            f" with `turn: {plan.turn}`" if plan.turn else "",
            f" to {plan.destination}" if plan.destination else "",
        )
        known = ", ".join(f"{m.origin}>{m.destination} ({m.turn})" for m in from_there)
        raise NetworkError(f"network {network.name} has no movement{''.join(asked)}; it has {known}")
    return movements


def draw_route(network: Network, plan: EgoPlan, rng: np.random.Generator) -> Route:
    """The plan's route. What the plan leaves open is drawn with equal probabilities, first the arm, then the
    movement. Raises NetworkError if no movement fits the plan."""
    movements = movements_of(network, plan)
    origins = sorted({m.origin for m in movements})
    origin = origins[rng.integers(len(origins))]
    choices = [m for m in movements if m.origin == origin]
    movement = choices[rng.integers(len(choices))]
    return network.route(movement.origin, movement.destination)


Speed = TypeVar("Speed", float, Array)
"""m/s, of one vehicle or of each of several"""


class Entry(NamedTuple):
    """Where a vehicle enters a route."""

    edges: tuple[str, ...]
    """the rest of the route from there on, as SUMO's edges"""
    lane: Lane
    """lane on which it enters"""
    front: float
    """m along the lane at which its front bumper is"""


def start_of(route: Route, plan: EpisodePlan, length: float) -> float:
    """m along the route's path, where the centre of an ego of `length` m starts. Raises SimulationError if
    the arm is too short for that.
    """
    distance, half = plan.ego.distance_m, 0.5 * length
    s = route.stop_line_s - distance - half
    if s < half:
        raise SimulationError(
            f"scenario {plan.scenario}: ego.distance {distance:.1f} m does not fit on the arm "
            f"{route.origin}, which has {route.stop_line_s:.1f} m before its stop line"
        )
    return s


def fastest_start(route: Route, s: float, grip: float) -> float:
    """m/s, highest speed from which an ego that starts at `s` m on its path can take the bends before its
    stop line, as other drivers do (rudc/world/bends.py), where the road gives `grip` m/s2.
    """
    grip = min(grip, DRY * GRAVITY)
    half = round(0.5 * OVER_M / SPACING)
    heading = np.pad(route.path.heading, half, mode="edge")
    bend = np.abs(heading[2 * half :] - heading[: -2 * half]) / OVER_M
    first, last = (min(round(at / SPACING), len(bend) - 1) for at in (s, route.stop_line_s))
    way = np.maximum(route.path.s[first : last + 1] - s, 0.0)
    squared = SHARE * grip / np.maximum(bend[first : last + 1], STRAIGHT) + 2.0 * min(BRAKING, grip) * way
    return math.sqrt(float(squared.min()))


def entry(network: Network, route: Route, front_s: float) -> Entry:
    """Where a vehicle enters a route if its front bumper is at front_s m of the route's path.

    An arm may consist of several edges one behind the other; the vehicle need not enter on the outermost.
    """
    edges, ids = network.arm(route.origin).in_edges, network.paths.lane_ids[route.row]
    inbound = [lane for lane in map(network.lanes.get, ids) if lane is not None and lane.edge in edges]
    locate = network.paths.locate
    starts = [locate(route.origin, route.destination, lane.id, 0.0)[1] for lane in inbound]
    start, lane = [pair for pair in zip(starts, inbound, strict=True) if pair[0] <= front_s][-1]
    front, scale = front_s - start, locate(route.origin, route.destination, lane.id, 1.0)[1] - start
    if abs(scale - 1.0) * lane.length > ROUNDED_M:
        front /= scale
    return Entry(route.edges[route.edges.index(lane.edge) :], lane, front)


def safe_to_start(scene: Scene) -> bool:
    """Whether the ego is at least MARGIN_M m from everything, can stop behind its leader, and its follower
    can stop behind the ego.

    Both brake at 4 m/s2, or as hard as the road lets them if that is less, the one behind 0.5 s later.
    """
    ego, body = scene.ego, scene.vehicle
    if scene.count == 0:
        return True
    gaps = rectangle_gaps(
        ego.x, ego.y, ego.psi, body.length, body.width, scene.position, scene.heading, scene.size
    )
    if gaps.min() < MARGIN_M:
        return False
    away = scene.position - (ego.x, ego.y)
    ahead = away @ (np.cos(ego.psi), np.sin(ego.psi))
    aside = away @ (-np.sin(ego.psi), np.cos(ego.psi))
    same_way = np.cos(scene.heading - ego.psi) > 0.7
    in_lane = (np.abs(aside) < 0.5 * (body.width + scene.size[:, 1])) & same_way & (np.abs(ahead) < 60)
    speed = scene.speed
    behind = np.where(ahead > 0, ego.v, speed)
    front = np.where(ahead > 0, speed, ego.v)
    braking = np.where(ahead > 0, braking_of(scene, ego=True), braking_of(scene, ego=False))
    return bool(np.all(gaps[in_lane] >= safe_gap(behind, front, braking)[in_lane]))


def no_safe_start(plan: EpisodePlan, draws: int) -> SimulationError:
    """The error that says that the ego could not start safely in any of so many draws of a plan."""
    return SimulationError(
        f"scenario {plan.scenario}, seed {plan.seed}: no safe start for the ego in {draws} "
        "draws; lower traffic.density, or move ego.distance or what stands there"
    )


def braking_of(scene: Scene, *, ego: bool) -> float:
    """m/s2, with which the ego or another is reckoned to brake: BRAKING, or less where the road gives less.
    On a slippery patch only the ego slips."""
    now = scene.actuation if ego else Actuation(friction=scene.road_friction)
    return min(BRAKING, grip_of(now or Actuation()))


def safe_gap(behind: Speed, front: Speed, braking: Speed) -> Speed:
    """m, gap that one who drives `behind` m/s and brakes with `braking` m/s2 needs to who drives `front` m/s
    before it."""
    return MARGIN_M + REACTION_S * behind + (behind**2 - front**2) / (2 * braking)
