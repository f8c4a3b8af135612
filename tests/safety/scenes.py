"""Scenes made by hand: a straight road, paths that cross it, and others placed at will."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, cast

import numpy as np

from rudc.arrays import Array
from rudc.network.paths import SPACING
from rudc.network.route import ReferencePath
from rudc.vehicle import EgoVehicle
from rudc.world.scene import EgoState, Kind, Scene


@dataclass(frozen=True)
class Other:
    """Somebody else: position m, heading rad, speed m/s, size m, row of the paths or -1."""

    x: float
    y: float
    heading: float = 0.0
    speed: float = 0.0
    length: float = 5.0
    width: float = 1.8
    row: int = -1
    s: float = 0.0


@dataclass(frozen=True)
class Paths:
    """What the filter reads of `network.paths`."""

    xy: Array
    heading: Array

    @cached_property
    def poses(self) -> Array:
        """(P * M, 3) x m, y m, heading rad."""
        return np.concatenate([self.xy, self.heading[..., None]], axis=2).reshape(-1, 3)

    @property
    def count(self) -> int:
        """P."""
        return len(self.heading)

    @property
    def stations(self) -> int:
        """M."""
        return self.heading.shape[1]


class Surface:
    """What the filter reads of `network.surface`: two roads, 14 m wide, that cross at the origin."""

    def depth(self, x: float, y: float) -> float:
        """m from the road's edge; negative beyond it."""
        return 7.0 - min(abs(x), abs(y))

    def direction(self, x: float, y: float) -> float:
        """No lane has a direction."""
        return math.nan


@dataclass(frozen=True)
class Network:
    """What the filter reads of `scene.network`."""

    paths: Paths
    vehicle: EgoVehicle = EgoVehicle()  # noqa: RUF009 - immutable
    surface: Surface = Surface()  # noqa: RUF009 - immutable


@dataclass(frozen=True, eq=False)
class Road:
    """What the filter reads of `scene.route`."""

    path: ReferencePath
    left_edge: Array
    right_edge: Array


def straight_road(half_width: float = 7.0) -> Road:
    """200 m eastwards from (-100, 0) m, with edges `half_width` m to both sides."""
    path = ReferencePath(np.array([[-100.0, 0.0], [100.0, 0.0]]))
    up = np.array([0.0, half_width])
    return Road(path, path.xy + up, path.xy - up)


def crossing_paths() -> Network:
    """Row 0 northwards through the origin, row 1 westwards at y = 3.5 m, row 2 from north to west.

    All begin 100 m before the origin or its height.
    """
    s = SPACING * np.arange(401)
    north = np.column_stack([np.zeros_like(s), s - 100.0])
    west = np.column_stack([100.0 - s, np.full_like(s, 3.5)])
    turning = np.clip((s - 92.0) / 8.0, 0.0, 1.0)
    heading = -math.pi / 2 - turning * math.pi / 2
    steps = SPACING * np.column_stack([np.cos(heading), np.sin(heading)])
    right = np.array([-1.75, 100.0]) + np.cumsum(steps, axis=0) - steps[0]
    rows = [np.full_like(s, math.pi / 2), np.full_like(s, math.pi), heading]
    return Network(Paths(np.stack([north, west, right]), np.stack(rows)))


ROAD = straight_road()
CROSSING = crossing_paths()


def make_scene(
    others: Sequence[Other] = (),
    x: float = 0.0,
    y: float = 0.0,
    psi: float = 0.0,
    v: float = 8.0,
    route: Road = ROAD,
    network: Network = CROSSING,
    vehicle: EgoVehicle = EgoVehicle(),  # noqa: B008 - immutable
    **changes: Any,
) -> Scene:
    """Ego at (x, y) m with heading psi rad and speed v m/s, among others, nearest first."""
    ordered = sorted(others, key=lambda other: math.hypot(other.x - x, other.y - y))
    table = np.array([(o.x, o.y, o.heading, o.speed, o.length, o.width, o.s) for o in ordered]).reshape(-1, 7)
    s, offset = route.path.project(x, y, x + 100.0)
    values: dict[str, Any] = {
        "time_s": 0.0,
        "timeout_s": 40.0,
        "ego": EgoState(x, y, psi, v, 0.0, 0.0, 0.0, 0.0),
        "vehicle": vehicle,
        "route": cast(Any, route),
        "ego_s": s,
        "ego_offset": offset,
        "waited_s": 0.0,
        "last_u": np.zeros(2),
        "network": cast(Any, network),
        "ids": tuple(f"sv{i}" for i in range(len(ordered))),
        "position": table[:, :2],
        "heading": table[:, 2],
        "velocity": table[:, 3:4] * np.column_stack([np.cos(table[:, 2]), np.sin(table[:, 2])]),
        "acceleration": np.zeros(len(ordered)),
        "size": table[:, 4:6],
        "kind": np.full(len(ordered), Kind.CAR, dtype=np.int64),
        "path": np.array([o.row for o in ordered], dtype=np.int64),
        "path_s": table[:, 6],
    }
    return Scene(**{**values, **changes})
