"""`Scene`: the world at one instant, as arrays. Agents, filter, observation and reward know the world by it.

World frame: x east, y north, heading psi counter-clockwise from x. SI units, radians. Positions are those of
a vehicle's centre; the ego's centre of gravity is the centre of its rectangle.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace
from enum import IntEnum
from typing import TYPE_CHECKING

import numpy as np

from rudc.arrays import Array, Flags, Index
from rudc.vehicle import Actuation, EgoVehicle

if TYPE_CHECKING:
    from rudc.network.network import Network, Route


STANDING = 0.5
"""m/s, a road user slower than this counts as standing; other thresholds than this one give a reason"""
STILL = 0.2
"""m/s, a road user slower than this counts as standing still; less than STANDING, since one that creeps may
still clear the way
"""


class Kind(IntEnum):
    """What a road user or obstacle is."""

    CAR = 0
    TRUCK = 1
    BUS = 2
    MOTORCYCLE = 3
    BICYCLE = 4
    PEDESTRIAN = 5
    OBSTACLE = 6


@dataclass(frozen=True, slots=True)
class EgoState:
    """State of the ego vehicle's plant."""

    x: float
    """m, centre of gravity"""
    y: float
    """m"""
    psi: float
    """rad, heading of the body"""
    v: float
    """m/s, speed of the centre of gravity, never negative"""
    slip: float
    """rad, angle from the body's axis to the velocity"""
    yaw_rate: float
    """rad/s"""
    acceleration: float
    """m/s2, realised (after lag, delay and friction); where actuators lag, it is not 0 in a stopped car whose
    brakes still act
    """
    steering: float
    """rad, realised front-wheel angle"""


OF_OTHERS = "position", "heading", "velocity", "acceleration", "size", "kind", "path", "path_s"
"""names of the arrays of a scene that have a row for each of the others"""


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """The world at one instant.

    Its N others are the surrounding vehicles, pedestrians and obstacles, nearest to the ego first.
    """

    time_s: float
    """s since the episode began"""
    timeout_s: float
    """s, the episode's time limit"""
    ego: EgoState
    vehicle: EgoVehicle
    route: Route
    """the ego's route, with its reference path"""
    ego_s: float
    """m, arc length of the ego's projection on `route.path`"""
    ego_offset: float
    """m, lateral offset from `route.path`, positive to its left"""
    waited_s: float
    """s for which the ego has been standing (below STANDING) without a break"""
    last_u: Array
    """(2,) the action applied before this instant: acceleration m/s2, front-wheel angle rad"""
    network: Network
    ids: tuple[str, ...]
    """names of the N others"""
    position: Array
    """(N, 2) m, centres"""
    heading: Array
    """(N,) rad"""
    velocity: Array
    """(N, 2) m/s, world frame"""
    acceleration: Array
    """(N,) m/s2, longitudinal"""
    size: Array
    """(N, 2) m, length and width"""
    kind: Index
    """(N,) `Kind`"""
    path: Index
    """(N,) row of `network.paths` along which each drives, -1 for none (obstacle, pedestrian, wrong-way
    driver)
    """
    path_s: Array
    """(N,) m, arc length of each one's centre along that path"""
    destination_s: float = math.inf
    """m, arc length on `route.path` where the episode succeeds, or the end of the path if that comes first"""
    actuation: Actuation | None = None
    """dead time, lag and friction between a command and the motion; for ablations only, since no real car
    knows them
    """
    may_cross_centre: bool = False
    """whether the ego may drive on the lanes of oncoming traffic"""
    road_friction: float | None = None
    """coefficient of friction of the road beside slippery patches, None if it is dry; the others know it, the
    ego does not
    """
    hidden_by: Array | None = None
    """(K, 5) opaque boxes that hide what is behind them: centre x, y (m), heading (rad), length, width (m);
    None for none"""
    sight_m: float = math.inf
    """m, range of the ego's sensors"""
    lag_s: float = 0.0
    """s, first-order time constant with which the ego's brakes follow a command, as far as its driver knows;
    0 where it is not known
    """
    grip: float = math.inf
    """m/s2, most that the ego's tyres give, as far as its driver knows; inf where nothing is known"""

    def __post_init__(self) -> None:
        """Make the arrays read-only, since the world goes on using those that it gives to agents."""
        for name in (*OF_OTHERS, "last_u"):
            getattr(self, name).setflags(write=False)
        if self.hidden_by is not None:
            self.hidden_by.setflags(write=False)

    def __eq__(self, other: object) -> bool:
        """Whether both show the same instant, number for number (network and route: by identity)."""
        if not isinstance(other, Scene):
            return NotImplemented
        pairs = ((getattr(self, field.name), getattr(other, field.name)) for field in fields(self))
        return all(
            a is b or (np.array_equal(a, b) if isinstance(a, np.ndarray) else a == b) for a, b in pairs
        )

    @property
    def count(self) -> int:
        """N."""
        return len(self.ids)

    @property
    def ego_position(self) -> Array:
        """(2,) m."""
        return np.array([self.ego.x, self.ego.y])

    @property
    def speed(self) -> Array:
        """(N,) m/s, speeds of the others."""
        return np.hypot(self.velocity[:, 0], self.velocity[:, 1])

    @property
    def inside(self) -> Flags:
        """(N,) whether some part of each of the others that have a path is in the junction."""
        half, paths = 0.5 * self.size[:, 0], self.network.paths
        begun = self.path_s + half > paths.stop_s[self.path]
        return (self.path >= 0) & begun & (self.path_s - half < paths.exit_s[self.path])

    @property
    def front_s(self) -> float:
        """m, arc length of the ego's front bumper on `route.path`."""
        return self.ego_s + 0.5 * self.vehicle.length

    @property
    def goal_s(self) -> float:
        """m, arc length on `route.path` at which the episode succeeds: `destination_s`, or the path's end."""
        return min(self.destination_s, self.route.length)

    def with_others_of(self, *scenes: Scene) -> Scene:
        """The scene with the others of further scenes after its own."""
        all_of = (self, *scenes)
        rows = {name: np.concatenate([getattr(scene, name) for scene in all_of]) for name in OF_OTHERS}
        return replace(self, ids=tuple([name for scene in all_of for name in scene.ids]), **rows)

    def only(self, index: Index) -> Scene:
        """The scene with only the others of these rows, in this order; the same object if these are all rows
        in their order.
        """
        if len(index) == self.count and bool((index[1:] > index[:-1]).all()):
            return self
        rows = {name: getattr(self, name)[index] for name in OF_OTHERS}
        return replace(self, ids=tuple([self.ids[i] for i in index.tolist()]), **rows)

    def nearest_first(self) -> Scene:
        """The scene with the others in the order of their distances from the ego, centre to centre; the same
        object if they are in it.
        """
        away = self.position - self.ego_position
        return self.only(np.argsort(np.hypot(away[:, 0], away[:, 1]), kind="stable"))
