"""`Stage`: what an event's effect may touch, and how it picks a vehicle."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from rudc.arrays import Array
from rudc.geometry import rectangle_corners
from rudc.world.scene import Scene

if TYPE_CHECKING:
    from rudc.network.network import Network, Route
    from rudc.network.road import Lane
    from rudc.world.ego import EgoPlant
    from rudc.world.perception import Sensors
    from rudc.world.props import Prop
    from rudc.world.sumo import Sumo
    from rudc.world.traffic import Traffic

BLOCK = "block"
"""how the names of SUMO's stand-ins for obstacles begin"""
SQUEEZE_M = 0.4
"""m that an obstacle may reach into a lane without closing it"""


@dataclass(slots=True)
class Stage:
    """The parts of one episode's world that events act on."""

    sumo: Sumo
    network: Network
    traffic: Traffic
    plant: EgoPlant
    route: Route
    rng: np.random.Generator
    sensors: Sensors
    decision_s: float
    start_s: float
    """m, where on its path the ego starts"""
    props: list[Prop] = field(default_factory=list)
    unlawful: set[str] = field(default_factory=set)
    """names of vehicles that an event has break the rules, at fault when they hit the ego"""
    _blocks: int = 0

    def add_obstacle(self, prop: Prop) -> None:
        """Put a standing prop on the road, and in SUMO's eyes on every lane of an arm that it obstructs.

        There SVs queue behind it or change lanes around it; inside the junction the yielding layer alone sees
        it.
        """
        self.props.append(prop)
        x, y, heading = prop.pose()
        corners = rectangle_corners(np.array([x, y]), np.array(heading), np.array([prop.length, prop.width]))
        for arm in self.network.arms:
            for lane_id in (*arm.in_lanes, *arm.out_lanes):
                lane = self.network.lanes[lane_id]
                span = _obstructed(lane, corners)
                if span is not None:
                    name = f"{BLOCK}{self._blocks}:{prop.name}"
                    self._blocks += 1
                    self.sumo.block(name, lane.edge, lane.index, *span)
                    self.traffic.reserve(lane_id, *span)

    def remove_obstacles(self, prefix: str) -> None:
        """Take away the obstacles whose names begin so."""
        self.props = [prop for prop in self.props if not prop.name.startswith(prefix)]
        for name in self.sumo.vehicles():
            if name.startswith(BLOCK) and name.split(":", 1)[1].startswith(prefix):
                self.sumo.remove(name)


def _obstructed(lane: Lane, corners: Array) -> tuple[float, float] | None:
    """Stretch (m, m) of a lane that a rectangle with these corners (4, 2) leaves too narrow to drive, if
    any."""
    start, end = lane.xy[0], lane.xy[-1]
    along = (end - start) / np.linalg.norm(end - start)
    s = (corners - start) @ along
    aside = (corners - start) @ (-along[1], along[0])
    free = 0.5 * lane.width - SQUEEZE_M
    if aside.max() < -free or aside.min() > free or s.max() < 1.0 or s.min() > lane.length - 1.0:
        return None
    return max(float(s.min()), 0.2), min(float(s.max()), lane.length - 0.2)


def pick(scene: Scene, selector: str, rng: np.random.Generator) -> list[int]:
    """Rows of the scene's SVs that a selector names; empty when there is none such now.

    leader: the nearest ahead on the ego's path; follower: the nearest behind in its lane; oncoming and
    crossing: the one that reaches the junction first among those from the opposite arm, or from the arms to
    the sides; nearest; random; all.
    """
    svs = np.flatnonzero(scene.path >= 0)
    if selector == "all" or svs.size == 0:
        return [int(i) for i in svs]
    if selector == "random":
        return [int(rng.choice(svs))]
    if selector == "nearest":
        return [int(svs[0])]
    if selector in ("leader", "follower"):
        return _in_line(scene, svs, ahead=selector == "leader")
    return _towards_junction(scene, svs, oncoming=selector == "oncoming")


def _in_line(scene: Scene, svs: np.ndarray, ahead: bool) -> list[int]:
    near = [scene.route.path.project(x, y) for x, y in scene.position[svs].tolist()]
    best, which = np.inf, -1
    for i, (s, offset) in zip(svs, near, strict=True):
        gap = s - scene.ego_s if ahead else scene.ego_s - s
        along = scene.route.path.pose(s)[2]
        if 0 < gap < best and abs(offset) < 1.5 and np.cos(scene.heading[i] - along) > 0.7:
            best, which = gap, int(i)
    return [which] if which >= 0 else []


def _towards_junction(scene: Scene, svs: np.ndarray, oncoming: bool) -> list[int]:
    paths = scene.network.paths
    rows = scene.path[svs]
    to_stop = paths.stop_s[rows] - scene.path_s[svs]
    turn = paths.heading[rows, 0] - scene.route.path.pose(0.0)[2]
    opposite = np.cos(turn) < -0.7
    sideways = np.abs(np.cos(turn)) <= 0.7
    speed = np.maximum(np.hypot(*scene.velocity[svs].T), 0.5)
    due = np.where((to_stop > 0) & (opposite if oncoming else sideways), to_stop / speed, np.inf)
    best = int(np.argmin(due))
    return [int(svs[best])] if np.isfinite(due[best]) else []
