"""`Network`: a junction as read from a .net.xml (see `Layout`), and the routes of one ego vehicle over it.

Networks and routes are pickled as what they are found again by, and unpickling gives the process's own: a
`Scene` that crosses to another process carries neither rasters nor polylines (1 kB and 95 bytes an SV), and
a route in it is the object that `Network.route` returns there.
"""

from __future__ import annotations

import copyreg
from collections.abc import Callable, Mapping
from functools import cache, lru_cache
from pathlib import Path
from types import MappingProxyType

from rudc.data import data_folder
from rudc.errors import NetworkError
from rudc.hints import there_are
from rudc.network.layout import Layout
from rudc.network.road import Arm, Lane, Movement, Turn
from rudc.network.route import ReferencePath, Route, RouteKey
from rudc.network.route_builder import build_route
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
        """`path` and `junction` as for `Layout`; `vehicle`: who drives the routes, None: an ordinary car."""
        super().__init__(path, junction)
        self.vehicle = vehicle or EgoVehicle()
        """whose routes keep its body on the road, and who waits clear of others"""
        self._routes: dict[tuple[str, str, int | None], Route] = {}

    def __reduce__(self) -> tuple[Callable[..., Network], tuple[Path, str | None, EgoVehicle]]:
        return load_network, (self.path, self.junction, self.vehicle)

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
            self._routes[key] = build_route(self, movement, lane, self.vehicle)
        return self._routes[key]


@cache
def shipped_networks() -> Mapping[str, Path]:
    """Name -> .net.xml of the networks that come with RUDC; looked for once."""
    folder = data_folder("sumo_networks")
    found = sorted(folder.glob("*/*.net.xml"))
    return MappingProxyType({path.name.removesuffix(".net.xml"): path for path in found})


def load_network(
    source: str | Path, junction: str | None = None, vehicle: EgoVehicle | None = None
) -> Network:
    """A shipped network by name, or any .net.xml by its path, with the routes of `vehicle` (None: an ordinary
    car's); read once per process. Raises NetworkError.
    """
    shipped = shipped_networks()
    path = shipped.get(str(source))
    if path is None:
        path = Path(source)
        if not path.is_file():
            known = there_are(source, shipped)
            raise NetworkError(f"no network {str(source)!r}, neither shipped nor a file{known}")
    return _load(path.resolve(), junction, vehicle or EgoVehicle(), path.stat().st_mtime_ns)


@lru_cache(maxsize=32)
def _load(path: Path, junction: str | None, vehicle: EgoVehicle, _modified: int) -> Network:
    return Network(path, junction, vehicle)


def find_route(key: RouteKey) -> Route:
    """The route of that key, from its network (read if need be)."""
    return load_network(key.network, key.junction, key.vehicle).route(key.origin, key.destination, key.lane)


def _as_key(route: Route) -> tuple[Callable[[RouteKey], Route], tuple[RouteKey]]:
    return find_route, (route.key,)


# Said here and not in `Route.__reduce__`, since a route knows nothing of networks.
copyreg.pickle(Route, _as_key)
