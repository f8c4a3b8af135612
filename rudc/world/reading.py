"""Reads the surrounding vehicles (SVs) off the road and composes scenes.

What changes only when somebody enters or leaves (sizes, kinds) or comes to another lane (path) is kept from
one decision to the next.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rudc.arrays import Array
from rudc.vehicle import Actuation, EgoVehicle
from rudc.world.kernels import nearest_first, overlapping
from rudc.world.scene import EgoState, Scene
from rudc.world.sumo import Motion, Sumo
from rudc.world.traffic import EGO, Traffic

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rudc.network.network import Network, Route
    from rudc.world.props import Prop


class EgoView(NamedTuple):
    """The part of a scene that is about the ego; fields as in `Scene`, in its order save the last three."""

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


class Reader:
    """Reads the road of one episode."""

    def __init__(self, sumo: Sumo, network: Network, traffic: Traffic) -> None:
        self._sumo = sumo
        self._network = network
        self._traffic = traffic
        self._met: set[tuple[str, ...]] = set()
        self._places: dict[tuple[str, str, str], tuple[int, float, float]] = {}
        self._name(())

    def meet(self) -> None:
        """See who is on the road now; those who have left are forgotten."""
        active = self._sumo.vehicles()
        if active != self.active:
            self._traffic.forget(active)
            self._name(active)

    def read(self) -> Motion:
        """Where all SVs are now, who is on the road being seen first."""
        self.meet()
        self.motion = self._sumo.motion(self.names)
        if self.motion.lane != self._lanes:
            self._locate()
        return self.motion

    def rears(self) -> list[tuple[str, float, float]]:
        """Of all on the road as last read, the ego and obstacles' stand-ins included: lane, m along it of the
        rear, m/s."""
        motion, sumo = self.motion, self._sumo
        svs = motion.lane, (motion.lane_pos - self.lengths).tolist(), motion.speed.tolist()
        found = list(zip(*svs, strict=True))
        for name in self._others:
            lane, front = sumo.lane_place(name)
            found.append((lane, front - sumo.length(name), sumo.drive(name)[0]))
        return found

    def relocate(self) -> None:
        """Find anew along which path each SV drives: the next time, for one has been sent another way."""
        self._lanes = []

    def _name(self, active: tuple[str, ...]) -> None:
        drivers = self._traffic.drivers
        self.active = active
        """names of all that SUMO moves, the ego and obstacles' stand-ins included"""
        self.names = [name for name in active if name in drivers]
        """of the n SVs on the road"""
        self._others = [name for name in active if name not in drivers]
        types = [drivers[name].type for name in self.names]
        self._sizes = np.array([(t.length, t.width) for t in types]).reshape(-1, 2)
        self.lengths = np.ascontiguousarray(self._sizes[:, 0])
        """(n,) m"""
        self._halves = 0.5 * self.lengths
        self._kinds = np.array([int(t.kind) for t in types], dtype=np.int64)
        self._lanes: list[str] = []
        self._path, self._start, self._scale = np.zeros(0, dtype=np.int64), np.zeros(0), np.zeros(0)

    def _locate(self) -> None:
        """Row of `network.paths` of each SV, and how its position on its lane becomes an arc length there."""
        drivers, self._lanes = self._traffic.drivers, self.motion.lane
        places = [
            self._place(drivers[name].origin, drivers[name].destination, lane)
            for name, lane in zip(self.names, self._lanes, strict=True)
        ]
        self._path = np.array([row for row, _, _ in places], dtype=np.int64)
        self._start = np.array([start for _, start, _ in places])
        self._scale = np.array([scale for _, _, scale in places])

    def _place(self, origin: str, destination: str, lane: str) -> tuple[int, float, float]:
        """Row of `network.paths` of somebody on a lane between two arms, m there where the lane begins, and
        m along it for each m on the lane; what was found is kept."""
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
        """The world as last read: SVs and props, nearest to the ego first."""
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
            *ego[:-3],
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
        )

    def locate_ego(self, route: Route, length: float) -> tuple[int, float]:
        """Row of `network.paths` and arc length (m) there of a SUMO-driven ego's centre; row -1 when
        unknown."""
        lane, front = self._sumo.lane_place(EGO)
        row, s = self._network.paths.locate(route.origin, route.destination, lane, front)
        return row, s - 0.5 * length

    def new_overlaps(self, scene: Scene) -> int:
        """Pairs that overlap in the scene and have not before: two SVs, or an SV and something on the
        road."""
        found = overlapping(scene.position, scene.heading, scene.size).tolist()
        driven = scene.path >= 0
        pairs = [(scene.ids[i], scene.ids[j]) for i, j in found if driven[i] or driven[j]]
        new = {tuple(sorted(pair)) for pair in pairs} - self._met
        self._met |= new
        return len(new)
