"""Reads from SUMO where the surrounding vehicles (SVs) are, and composes scenes.

Values that change only when a vehicle enters or leaves (sizes, kinds) or comes to another lane (path) are
kept from one decision to the next.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rudc.arrays import Array
from rudc.vehicle import Actuation, EgoVehicle
from rudc.world.kernels import nearest_first, overlapping
from rudc.world.scene import EgoState, Scene
from rudc.world.sumo import Motion, Sumo
from rudc.world.traffic import Traffic
from rudc.world.vehicle_types import EGO

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rudc.network.network import Network, Route
    from rudc.world.props import Prop


class EgoView(NamedTuple):
    """The part of a scene that is about the ego; fields as in `Scene`, in the same order but for the last
    three.
    """

    time_s: float
    timeout_s: float
    state: EgoState
    vehicle: EgoVehicle
    route: Route
    s: float
    offset: float
    waited_s: float
    last_u: Array
    destination_s: float
    actuation: Actuation
    may_cross_centre: bool
    road_friction: float | None


class Reader:
    """Reads the vehicles on the road in one episode."""

    def __init__(self, sumo: Sumo, network: Network, traffic: Traffic) -> None:
        self._sumo = sumo
        self._network = network
        self._traffic = traffic
        self._met: set[tuple[str, ...]] = set()
        self._places: dict[tuple[str, str, str], tuple[int, float, float]] = {}
        self._name(())

    def meet(self) -> None:
        """Find out which vehicles are on the road now; those that have left are forgotten."""
        active = self._sumo.vehicles()
        if active != self.active:
            self._traffic.forget(active)
            self._name(active)

    def read(self) -> Motion:
        """Find out which SVs are on the road now, and where."""
        self.meet()
        self.motion = self._sumo.motion(self.names)
        if self.motion.lane != self._lanes:
            self._locate()
        return self.motion

    def rears(self) -> list[tuple[str, float, float]]:
        """Lane, position of the rear along it (m) and speed (m/s) of each vehicle on the road as last read.
        The ego and the vehicles that stand in for obstacles in SUMO are included.
        """
        motion, sumo = self.motion, self._sumo
        svs = motion.lane, (motion.lane_pos - self.lengths).tolist(), motion.speed.tolist()
        found = list(zip(*svs, strict=True))
        for name in self._others:
            lane, front = sumo.lane_place(name)
            found.append((lane, front - sumo.length(name), sumo.drive(name)[0]))
        return found

    def relocate(self) -> None:
        """At the next `read`, find anew which path each SV drives along; for when one got another route."""
        self._lanes = []

    def _name(self, active: tuple[str, ...]) -> None:
        drivers = self._traffic.drivers
        self.active = active
        """names of all vehicles in SUMO, with the ego and the stand-ins for obstacles"""
        self.names = [name for name in active if name in drivers]
        """names of the n SVs on the road"""
        self._others = [name for name in active if name not in drivers]
        types = [drivers[name].type for name in self.names]
        self._sizes = np.array([(t.length, t.width) for t in types]).reshape(-1, 2)
        self.lengths = np.ascontiguousarray(self._sizes[:, 0])
        """(n,) m, lengths of the SVs"""
        self._halves = 0.5 * self.lengths
        self._kinds = np.array([int(t.kind) for t in types], dtype=np.int64)
        self._lanes: list[str] = []
        self._path, self._start, self._scale = np.zeros(0, dtype=np.int64), np.zeros(0), np.zeros(0)

    def _locate(self) -> None:
        """Find the row of `network.paths` of each SV, and how to turn its position on its lane into an arc
        length on that row.
        """
        drivers, self._lanes = self._traffic.drivers, self.motion.lane
        places = [
            self._place(drivers[name].origin, drivers[name].destination, lane)
            for name, lane in zip(self.names, self._lanes, strict=True)
        ]
        self._path = np.array([row for row, _, _ in places], dtype=np.int64)
        self._start = np.array([start for _, start, _ in places])
        self._scale = np.array([scale for _, _, scale in places])

    def _place(self, origin: str, destination: str, lane: str) -> tuple[int, float, float]:
        """Row of `network.paths` of a vehicle that drives on a lane from one arm to another, arc length (m)
        on that row where the lane begins, and m of arc length for each m on the lane. Results are kept.
        """
        known = self._places.get((origin, destination, lane))
        if known is None:
            paths = self._network.paths
            row, start = paths.locate(origin, destination, lane, 0.0)
            scale = paths.locate(origin, destination, lane, 1.0)[1] - start
            if row < 0:
                line, length = self._sumo.lane_line(lane)
                row, start, end = paths.alongside(origin, destination, line)
                scale = (end - start) / length
            known = self._places[origin, destination, lane] = row, start, scale
        return known

    def scene(self, ego: EgoView, props: Sequence[Prop]) -> Scene:
        """The scene with the SVs as last read and the props, nearest to the ego first."""
        ids, (position, heading, course, speed, acceleration, _, lane_pos) = self.names, self.motion
        size, kind, path = self._sizes, self._kinds, self._path
        half, start, scale = self._halves, self._start, self._scale
        if props:
            ids = ids + [prop.name for prop in props]
            poses = np.array([prop.pose() for prop in props])
            none = np.zeros(len(props))
            position = np.concatenate([position, poses[:, :2]])
            heading = np.concatenate([heading, poses[:, 2]])
            course = np.concatenate([course, np.stack([np.cos(poses[:, 2]), np.sin(poses[:, 2])], axis=1)])
            speed = np.concatenate([speed, [prop.speed for prop in props]])
            acceleration = np.concatenate([acceleration, none])
            size = np.concatenate([size, [(prop.length, prop.width) for prop in props]])
            kind = np.concatenate([kind, [int(prop.kind) for prop in props]])
            path = np.concatenate([path, np.full(len(props), -1)])
            half, start, scale, lane_pos = (
                np.concatenate([part, none]) for part in (half, start, scale, lane_pos)
            )
        order, position, heading, velocity, acceleration, size, kind, path, path_s = nearest_first(
            ego.state.x, ego.state.y, position, heading, speed, course, acceleration, size, kind,
            path, half, start, scale, lane_pos,
        )  # fmt: skip
        return Scene(
            *ego[:-4],
            self._network,
            tuple([ids[i] for i in order.tolist()]),
            position,
            heading,
            velocity,
            acceleration,
            size,
            kind,
            path,
            path_s,
            ego.destination_s,
            ego.actuation,
            ego.may_cross_centre,
            ego.road_friction,
        )

    def locate_ego(self, route: Route, length: float) -> tuple[int, float]:
        """Row of `network.paths` and arc length (m) on it of a SUMO-driven ego's centre; row -1 if it is on
        none."""
        lane, front = self._sumo.lane_place(EGO)
        row, s = self._network.paths.locate(route.origin, route.destination, lane, front)
        return row, s - 0.5 * length

    def new_overlaps(self, scene: Scene) -> int:
        """How many pairs overlap in the scene that have not overlapped before: two SVs, or an SV and a
        prop."""
        found = overlapping(scene.position, scene.heading, scene.size).tolist()
        driven = scene.path >= 0
        pairs = [(scene.ids[i], scene.ids[j]) for i, j in found if driven[i] or driven[j]]
        new = {tuple(sorted(pair)) for pair in pairs} - self._met
        self._met |= new
        return len(new)
