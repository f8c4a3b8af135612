"""`Stage`: all that an event may do to an episode. The world implements it; events know nothing of SUMO.

Angles are in rad counter-clockwise from east, positions in m in the network's frame, speeds in m/s.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rudc.scenario.choices import VehicleType
from rudc.scenario.poses import Pose
from rudc.scenario.selectors import Selector

XYHeading = tuple[float, float, float]
ROADSIDE_M = 1.5
"""m beyond the road's edge where the way across an arm begins and ends"""
Body = VehicleType | Literal["pedestrian", "obstacle"]
Size = tuple[float, float]
"""m and m, length and width"""
Thing = tuple[Body, XYHeading, Size | None]
"""what stands where; length and width in m of an obstacle, else None"""


class Halt(NamedTuple):
    """Where something that moves stops on its way, and for how long."""

    after_m: float
    """m that it has moved by then"""
    duration_s: float
    """s that it stands"""
    turns_back: bool = False
    """whether it then goes back to where it appeared"""


class Stage(ABC):
    """What events act on. Names are those of vehicles and things in a scene."""

    unlawful: set[str]
    """names of those who disregard the right of way: they do not yield to the ego, and what hits it is their
    fault unless a rule before that one decides (rudc/world/fault.py); for events to add to"""
    decision_s: float
    """s between two decisions"""

    # ---- time and vehicles

    @property
    @abstractmethod
    def time_s(self) -> float:
        """s since the episode began; 0 before that."""

    @property
    @abstractmethod
    def present(self) -> tuple[str, ...]:
        """Names of all vehicles and things there are; none before traffic is."""

    @abstractmethod
    def choose(self, selector: Selector) -> list[str]:
        """Surrounding vehicles that a selector names now; empty when there is none."""

    @abstractmethod
    def held_by(self, number: int | None) -> list[str]:
        """Surrounding vehicles that are present and of which the event of that number in keys has taken hold;
        none for None."""

    @abstractmethod
    def speed(self, name: str) -> float:
        """m/s of something that is present."""

    @abstractmethod
    def is_inside(self, name: str) -> bool:
        """Whether some part of a surrounding vehicle is in the junction."""

    @abstractmethod
    def seize(self, name: str, *, heedless: bool = False) -> None:
        """Take a vehicle's speed into the event's hands: it brakes as hard as it is told to.

        A heedless one drives by itself, but without regard to right of way, and is unlawful; it still keeps
        its distance, also to an ego before it.
        """

    @abstractmethod
    def release(self, name: str, *, heedless: bool = False) -> None:
        """Give a vehicle back to its driver, seized with the same `heedless`."""

    @abstractmethod
    def slow_down(self, name: str, deceleration: float, least: float = 0.0) -> None:
        """Have a vehicle brake with deceleration m/s2, if the road lets it, until the next decision, but to
        no less than `least` m/s. It brakes with 12 m/s2 at most (HARDEST in event.py). If several events slow
        it down, or it brakes to yield, the hardest braking counts.
        """

    @abstractmethod
    def set_speed_factor(self, name: str, factor: float | None, event: str = "") -> None:
        """Set how many times the limit a vehicle wants to drive, for an event; None when the event is over.

        Of several events the last counts; when all are over, the vehicle's own factor does.
        """

    @abstractmethod
    def set_top_speed(self, name: str, speed: float | None, event: str = "") -> None:
        """Set the m/s that a vehicle does not exceed, for an event; None when the event is over.

        If several events set one, the lowest counts; it is never above what the vehicle's type can do.
        """

    @property
    @abstractmethod
    def density(self) -> float:
        """veh/km at which traffic is held."""

    @abstractmethod
    def set_density(self, density: float | None, event: str = "") -> None:
        """Set the veh/km at which traffic is held from now on; as `set_speed_factor`, after all events the
        scenario's."""

    # ---- places

    @abstractmethod
    def pose(self, place: Pose) -> XYHeading:
        """Where something stands that a file places by position or by lane."""

    @abstractmethod
    def pose_on_lane(self, lane: str, at: float) -> XYHeading:
        """The place in the middle of a lane, `at` m from the junction."""

    @abstractmethod
    def behind_on_lane(self, lane: str, at: float) -> NDArray[np.float64]:
        """(K, 2) m, a way against the traffic that ends on a lane, `at` m from the junction. It begins at the
        end of the road to which the lane leads, through the junction if it leads there."""

    @abstractmethod
    def lane_width(self, lane: str) -> float:
        """m."""

    @abstractmethod
    def pieces_along_lane(self, lane: str, at: float, length: float) -> list[tuple[XYHeading, float]]:
        """The straight pieces of equal length that follow the next `length` m of a lane from `at` m on: the
        middle of each, and its length (m)."""

    @abstractmethod
    def against_lane(self, lane: str, at: float) -> NDArray[np.float64]:
        """(K, 2) m, the way against a lane from `at` m from the junction, off the road by an arm."""

    @abstractmethod
    def across_arm(self, arm: str, at: float) -> NDArray[np.float64]:
        """(2, 2) m, the way across an arm `at` m from the junction.

        From the roadside right of traffic that drives towards the junction to the other side.
        """

    # ---- things

    @abstractmethod
    def length_of(self, body: Body) -> float:
        """m, of a vehicle or pedestrian."""

    @abstractmethod
    def stand(
        self, name: str, body: Body, place: XYHeading, size: Size | None = None, *, for_s: float = math.inf
    ) -> None:
        """Put something that stands on the road, called `EVENT:...`.

        `size`: length and width in m of an obstacle. `for_s`: s after which it will be taken away; what is
        to stand in its place waits for that.
        """

    @abstractmethod
    def is_free(
        self, body: Body, place: XYHeading, size: Size | None = None, *, for_ego: bool = False
    ) -> bool:
        """Whether nobody who drives or walks is where something would stand, or would come there even braking
        hard. The ego counts only with `for_ego`. `size` as in `stand`."""

    @abstractmethod
    def is_taken_for_now(self, body: Body, place: XYHeading, size: Size | None = None) -> bool:
        """Whether something stands in a place now that will be taken away. `size` as in `stand`."""

    @abstractmethod
    def send(
        self,
        name: str,
        body: Body,
        way: NDArray[np.float64],
        speed: float,
        late_m: float = 0.0,
        beyond_m: float = 0.0,
        behind: NDArray[np.float64] | None = None,
        halt: Halt | None = None,
        size: Size | None = None,
    ) -> None:
        """Have something, called `EVENT:...`, move along a way (K, 2) m at speed m/s.

        It starts `late_m` m before the way's begin, and is gone `beyond_m` m beyond its end. `behind` (K, 2)
        m leads to the way's begin: a driver who is held up may back along it, and is gone at its first point.
        With a `halt` it stops on its way, and goes on later. `size`: length and width in m; by default
        those of traffic of its kind.
        """

    @abstractmethod
    def has_room(
        self,
        body: Body,
        way: NDArray[np.float64],
        speed: float,
        late_m: float = 0.0,
        size: Size | None = None,
    ) -> bool:
        """Whether something whose centre appears `late_m` m before a way (K, 2) m begins, and drives along it
        at speed m/s, and the surrounding vehicles can still stop before each other. An ego counts only below
        2 m/s."""

    @abstractmethod
    def things_of(self, event: str) -> frozenset[str]:
        """Names of the things that the event of that name has put on the road and that are still there."""

    @abstractmethod
    def remove_things(self, event: str) -> None:
        """Take away what the event of that name has put on the road: what is called `EVENT:...`."""

    @abstractmethod
    def hide_behind(self, event: str, place: XYHeading, size: Size) -> None:
        """Put up, for the event of that name, a box (length and width in m) that the ego cannot see through.

        Raises SimulationError if it reaches onto the road.
        """

    @abstractmethod
    def hide_behind_things(self, event: str) -> None:
        """Have what the event of that name has put on the road hide what is behind it from the ego, where it
        stands now."""

    @abstractmethod
    def reveal(self, event: str) -> None:
        """Take away the boxes that the event of that name has put up, and see through its things again."""

    # ---- the ego

    @abstractmethod
    def set_noise(self, position: float, speed: float, heading: float) -> None:
        """Standard deviations (m along each axis, m/s, rad) of what the ego perceives of others."""

    @abstractmethod
    def set_own_noise(self, acceleration: float) -> None:
        """Standard deviation (m/s2) of what the ego measures of its own acceleration."""

    @abstractmethod
    def set_dropout(self, probability: float, range_m: float) -> None:
        """How likely the ego is to miss a vehicle at a decision, and how far it sees (m)."""

    @abstractmethod
    def set_friction(self, friction: float | None) -> None:
        """The road's coefficient of friction, for the ego and surrounding vehicles; None if it is dry."""

    @abstractmethod
    def lay_patch(self, event: str, lane: str, at: float, length: float, friction: float) -> None:
        """Give the ego that coefficient of friction while its centre is on a stretch of a lane, which is
        `length` m long from `at` m on. If the road or another patch is more slippery there, theirs counts.
        """

    @abstractmethod
    def remove_patch(self, event: str) -> None:
        """Take away the patch that the event of that name has laid."""

    @abstractmethod
    def set_actuators(self, delay_s: float, lag_s: float) -> None:
        """How late the ego's commands take effect, and the time constant (s) with which they are followed."""
