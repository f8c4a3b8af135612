"""`Network`: a junction as read from a .net.xml (see `Layout`), and the routes of one ego vehicle over it.

Networks and routes are pickled as keys, and unpickling looks these up in the receiving process. So a `Scene`
that crosses to another process carries neither rasters nor polylines (it takes 1 kB and 95 bytes an SV), and
a route in it is the object that `Network.route` returns there.
"""

from __future__ import annotations

import copyreg
import os
from collections.abc import Callable
from dataclasses import fields
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any

from rudc.data import shipped_networks
from rudc.errors import NetworkError
from rudc.hints import did_you_mean, there_are
from rudc.kernels import as_written
from rudc.network.layout import Layout
from rudc.network.net_file import understood
from rudc.network.road import Arm, Lane, Movement, Turn, may_mean
from rudc.network.route import ReferencePath, Route, RouteKey
from rudc.network.route_builder import build_route
from rudc.network.stretches import (
    EGO_ARMS,
    EGO_IN,
    EGO_LANES,
    Stretch,
    arm_stretches,
    inner_stretches,
    lane_of_ego,
    ring_past,
    stretch_by_id,
)
from rudc.vehicle import EgoVehicle

__all__ = [
    "Arm",
    "Lane",
    "Movement",
    "Network",
    "ReferencePath",
    "Route",
    "Turn",
    "load_network",
    "shipped_networks",
]


class Network(Layout):
    """One junction and its arms, and the routes of `vehicle` over it. Immutable; routes are built once."""

    def __init__(self, path: Path, junction: str | None = None, vehicle: EgoVehicle | None = None) -> None:
        """`path` and `junction` as for `Layout`; `vehicle`: the car that drives the routes, None: an ordinary
        one. Raises NetworkError, and InputError for a vehicle that no car is."""
        super().__init__(path, junction)
        self.vehicle = vehicle or EgoVehicle()
        """the car whose body the routes keep on the road and whose waiting positions are clear of others"""
        self.vehicle.check()
        self._routes: dict[tuple[str, str, int | None], Route] = {}

    def __reduce__(self) -> tuple[Callable[..., Network], tuple[Path, str | None, EgoVehicle]]:
        return load_network, (self.path, self.junction, self.vehicle)

    def arm(self, name: str, route: Route | None = None) -> Arm:
        """The arm of that name, also found by the id of one of its edges.

        With the ego's route also `ego_in`, the arm it comes from, and `ego_out`, the one it leaves by.
        """
        if name not in EGO_ARMS:
            return super().arm(name)
        if route is None:
            raise NetworkError(f"{name} has no meaning before the ego's route is known; name an arm")
        return super().arm(route.origin if name == EGO_IN else route.destination)

    def lane(self, name: str) -> Lane:
        """The lane with a scenario's name (`west_in_0`, `west_to_east_0`: its first) or SUMO's id."""
        if name in self.lanes and name not in self._outer and name not in self._inner:
            return self.lanes[name]
        return self.stretch(name).lane

    @cached_property
    def lane_names(self) -> dict[str, str]:
        """Scenario names of the arms' lanes -> SUMO's ids."""
        return {name: stretch.lane.id for name, stretch in self._outer.items()}

    @property
    def named_stretches(self) -> dict[str, Stretch]:
        """Scenario name -> stretch of lane, of the arms and inside the junction."""
        return {**self._outer, **self._inner}

    def stretch(self, name: str, route: Route | None = None) -> Stretch:
        """What a scenario's lane name means (`rudc.network.stretches`); `route`: for those about the ego."""
        if name in EGO_LANES:
            if route is None:
                raise NetworkError(f"{name} has no meaning before the ego's route is known; name a lane")
            return stretch_by_id(self, lane_of_ego(self, name, route).id)
        for known in (self._outer, self._inner):
            if name in known:
                return known[name]
        if name in self.lanes:
            return stretch_by_id(self, name)
        if name in self.left_out:
            users = ", ".join(self.left_out[name])
            raise NetworkError(
                f"lane {name!r} of network {self.name} is closed to cars (for {users} only); "
                "name a lane that cars use; an `accident` may put vehicles there by `position: [x, y]`"
            )
        same = [known for known in self._outer if known.rpartition("_")[0] == name.rpartition("_")[0]]
        if same:
            raise NetworkError(f"no lane {name!r} in network {self.name}; cars have {', '.join(same)} there")
        for arm in self.arms:
            lanes = {f"{arm.name}_in": arm.in_lanes, f"{arm.name}_out": arm.out_lanes}
            if (
                name.rpartition("_")[0] == f"ring_{arm.name}"
                and not arm.in_lanes
                and (past := ring_past(self, arm))
            ):
                raise NetworkError(
                    f"no lane {name!r} in network {self.name}: nothing enters by arm {arm.name!r}, so that "
                    f"stretch of the ring is part of {', '.join(past)}"
                )
            if lanes.get(name.rpartition("_")[0]) == ():
                raise NetworkError(
                    f"no lane {name!r} in network {self.name}: arm {arm.name!r} is one-way, "
                    f"nothing {'enters' if arm.out_lanes else 'leaves'} by it"
                )
        known = ", ".join([*self._outer, *list(self._inner)[:1]])
        hint = did_you_mean(name, may_mean(name, [*self._outer, *self._inner, *EGO_LANES]))
        hint = hint or f"; there are: {known} and others inside"
        raise NetworkError(f"no lane {name!r} in network {self.name}{hint}")

    def place_on_lane(
        self,
        lane_name: str,
        at: float,
        lateral: float = 0.0,
        heading_offset_rad: float = 0.0,
        route: Route | None = None,
    ) -> tuple[float, float, float]:
        """x m, y m and heading rad of a place on a lane, `lateral` m to the left of its centre line.

        `at` m run outwards from the stop line (inbound) or the junction's exit (outbound), and inside the
        junction in driving direction. `route` is the ego's, for names relative to it. Raises NetworkError.
        """
        return self.stretch(lane_name, route).place(at, lateral, heading_offset_rad)

    @cached_property
    def _outer(self) -> dict[str, Stretch]:
        return arm_stretches(self)

    @cached_property
    def _inner(self) -> dict[str, Stretch]:
        return inner_stretches(self)

    def route(self, origin: str, towards: str, lane: int | None = None) -> Route:
        """The ego's route from an arm to another, or by its turn; `lane` is the index of the inbound lane.

        Without `lane`, left turns start on the leftmost lane that permits them, all others on the rightmost.
        """
        movement = self.movement(origin, towards)
        key = (movement.origin, movement.destination, lane)
        if key not in self._routes:
            allowed = sorted({self.inbound_lane(row).index for row in movement.rows})
            if lane is not None and lane not in allowed:
                raise NetworkError(
                    f"network {self.name}: {movement.turn} from {movement.origin!r} is not permitted from "
                    f"lane {lane}, only from {', '.join(map(str, allowed))}"
                )
            with understood(self.path), as_written():  # few calls, also by commands that never drive
                self._routes[key] = build_route(self, movement, lane, self.vehicle)
        return self._routes[key]


def load_network(
    source: str | Path, junction: str | None = None, vehicle: EgoVehicle | None = None
) -> Network:
    """A shipped network by name, or any .net.xml by its path, with the routes of `vehicle` (None: an ordinary
    car's); read once per process. Raises NetworkError, and InputError for a vehicle that no car is.
    """
    shipped = shipped_networks()
    path = shipped.get(str(source))
    if path is None:
        path = Path(source)
        if not os.path.isfile(path):  # unlike Path.is_file, no error for a name that is too long
            if os.path.isdir(path):
                raise NetworkError(
                    f"{path} is a folder; `rudc network build` makes a .net.xml from the sources in one"
                )
            known = there_are(source, shipped)
            raise NetworkError(f"no network {str(source)!r}, neither shipped nor a file{known}")
    return _load(path.resolve(), junction, vehicle or EgoVehicle(), path.stat().st_mtime_ns)


@lru_cache(maxsize=32)
def _load(path: Path, junction: str | None, vehicle: EgoVehicle, _modified: int) -> Network:
    with understood(path):
        return Network(path, junction, vehicle)


def find_route(key: RouteKey) -> Route:
    """The route of that key, from its network (read if need be)."""
    return load_network(key.network, key.junction, key.vehicle).route(key.origin, key.destination, key.lane)


def _pickled(route: Route) -> tuple[Callable[..., Route], tuple[Any, ...]]:
    """A route of a network as its key; a course, which no network knows, whole."""
    if find_route(route.key) is route:
        return find_route, (route.key,)
    return _course, (tuple(getattr(route, field.name) for field in fields(route)),)


def _course(values: tuple[Any, ...]) -> Route:
    return Route(*values)


# Registered here and not in `Route.__reduce__`, since a route knows nothing of networks.
copyreg.pickle(Route, _pickled)
