"""The only file that imports libsumo and that converts between SUMO's conventions and ours.

SUMO measures angles in degrees clockwise from north and places a vehicle by the centre of its front bumper;
outside this file, angles are in radians counter-clockwise from east, and a vehicle is placed by its centre
(except in `Motion` and on lanes, where positions are those of front bumpers).

libsumo holds one simulation per process. A second `start` would silently destroy the first, so a second
`Sumo` is refused.
"""

from __future__ import annotations

import contextlib
import functools
import math
import os
import tempfile
import weakref
from collections.abc import Callable, Iterator, Sequence
from itertools import chain
from pathlib import Path
from typing import Any, NamedTuple, TypeVar, cast

import numpy as np

from rudc.arrays import Array
from rudc.errors import SimulationError, WorldBusyError

try:
    import libsumo
except ImportError as error:  # pragma: no cover - only on a machine without it
    raise SimulationError(
        f"libsumo cannot be imported ({error}); install it with: pip install libsumo"
    ) from error

OWN_SPEED = 31
"""SUMO's speed mode with every check on"""
HEEDLESS = 55
"""as OWN_SPEED, but right of way is ignored, before and inside a junction"""
ONLY_WHEN_ASKED = 0b111100000000
"""the bits of SUMO's lane-change mode that say how requests are obeyed; the others hold SUMO's own reasons"""
OBEDIENT = 0
"""SUMO's speed mode without any check: the speed that is set is the speed that is driven"""

_OPTIONS = (
    "--no-step-log", "--no-warnings", "--time-to-teleport", "-1", "--collision.action", "none",
    "--insertion-checks", "collision", "--default.speeddev", "0",
)  # fmt: skip

_QUARTER, _RADIAN = math.pi / 2, math.pi / 180
MATCH_M = 5.0
"""m within which SUMO looks for the lane under a vehicle that is placed; it searches all of them"""
_owner: int | None = None


def _function(name: str) -> Callable[..., Any]:
    """A function of libsumo.vehicle, without its Python wrapper if libsumo allows: that is a third faster."""
    inner = getattr(libsumo, "_libsumo", None)
    return getattr(inner, f"vehicle_{name}", getattr(libsumo.vehicle, name))


_place, _lane, _angle = _function("getPosition"), _function("getLaneID"), _function("getAngle")
_NUMBERS = [_angle, *map(_function, ("getSpeed", "getAcceleration", "getLanePosition"))]
_move, _set_speed = _function("moveToXY"), _function("setSpeed")


def _set(vehicle: str, values: dict[str, float]) -> None:
    for name, value in values.items():
        getattr(libsumo.vehicle, f"set{name.title().replace('_', '')}")(vehicle, value)


class Motion(NamedTuple):
    """Where n vehicles are and how they move."""

    position: Array
    """(n, 2) m, centres of front bumpers"""
    heading: Array
    """(n,) rad"""
    course: Array
    """(n, 2), unit vectors of the headings"""
    speed: Array
    """(n,) m/s"""
    acceleration: Array
    """(n,) m/s2"""
    lane: list[str]
    """ids of the lanes their front bumpers are on"""
    lane_pos: Array
    """(n,) m, front bumper along its lane"""


def sumo_pose(x: float, y: float, psi: float, length: float) -> tuple[float, float, float]:
    """Front bumper (m, m) and angle (degrees clockwise from north) of what has its centre at (x, y) m, heads
    psi rad and is `length` m long.
    """
    front_x, front_y = x + 0.5 * length * math.cos(psi), y + 0.5 * length * math.sin(psi)
    return front_x, front_y, (90.0 - math.degrees(psi)) % 360.0


Method = TypeVar("Method", bound=Callable[..., Any])


def _to(what: str) -> Callable[[Method], Method]:
    """Decorate a method so that it raises SimulationError where SUMO refuses, with `what` SUMO was asked to
    do and the arguments."""

    def decorate(method: Method) -> Method:
        @functools.wraps(method)
        def asked(self: Sumo, *args: Any, **kwargs: Any) -> Any:
            try:
                return method(self, *args, **kwargs)
            except (libsumo.TraCIException, libsumo.FatalTraCIError) as error:
                given = ", ".join([*map(str, args), *(f"{key}={value}" for key, value in kwargs.items())])
                raise self.refused(f"{what} ({given})" if given else what, error) from error

        return cast(Method, asked)

    return decorate


@contextlib.contextmanager
def _as_file(text: str) -> Iterator[str]:
    """Path of a temporary file with that text. It exists only while SUMO loads, so that a process that is
    killed later leaves no file."""
    try:
        descriptor, path = tempfile.mkstemp(prefix="rudc-", suffix=".add.xml")
    except OSError as error:
        raise SimulationError(f"no place for a temporary file: {error}; set TMPDIR") from error
    try:
        try:
            with open(descriptor, "w", encoding="utf-8") as file:
                file.write(text)
        except OSError as error:
            raise SimulationError(
                f"cannot write {path}: {error.strerror}; make room or set TMPDIR"
            ) from error
        yield path
    finally:
        os.unlink(path)


@contextlib.contextmanager
def _plain(path: str) -> Iterator[str]:
    """A path by which SUMO can open a file: SUMO splits paths at commas and replaces ${...} by variables, so
    a path with either is given as /dev/fd/N.
    """
    if "," not in path and "${" not in path:
        yield path
        return
    try:
        descriptor = os.open(path, os.O_RDONLY)
    except OSError as error:
        raise SimulationError(f"cannot read {path}: {error.strerror}") from error
    try:
        yield f"/dev/fd/{descriptor}"
    finally:
        os.close(descriptor)


class _Running:
    """Whether libsumo holds a simulation for one `Sumo`; kept apart, so that it outlives the `Sumo`."""

    def __init__(self) -> None:
        self.pid = os.getpid()
        self.started = False


def _release(running: _Running) -> None:
    """End the simulation, so that this process may have another. Does nothing in a fork of that process."""
    global _owner
    if running.pid != os.getpid():
        return
    if running.started:
        libsumo.close()
    _owner = None


class Sumo:
    """A running simulation of one road network, ended by `close` or when no reference to it is left.

    Raises WorldBusyError when this process already runs one; its methods raise SimulationError where SUMO
    refuses.
    """

    def __init__(self, net_file: Path, step_s: float) -> None:
        global _owner
        if _owner == os.getpid():
            raise WorldBusyError(
                "this process already runs a world, and libsumo holds only one; close it first, "
                "or run the second in a process of its own"
            )
        self._net_file = net_file
        self._arguments = ["--step-length", f"{step_s:g}", *_OPTIONS]
        self._running = _Running()
        self._release = weakref.finalize(self, _release, self._running)
        _owner = os.getpid()

    def refused(self, what: str, error: Exception) -> SimulationError:
        """The error to raise where SUMO could not do `what`."""
        if isinstance(error, libsumo.FatalTraCIError):
            self._running.started = False  # SUMO has ended the simulation; the next load starts it anew
        return SimulationError(f"network {self._net_file.name}: SUMO could not {what}: {error}")

    def close(self) -> None:
        """End the simulation; a world may then be made anew in this process."""
        self._release()

    def load(self, seed: int, additional: str, options: Sequence[str] = ()) -> None:
        """Begin a new simulation: empty roads, vehicle types of `additional` (text of SUMO's additional
        file), SUMO's random generator seeded. Raises SimulationError after `close`."""
        if not self._release.alive:
            raise SimulationError("this world is closed; make another")
        with _as_file(additional) as path, _plain(path) as types, _plain(str(self._net_file)) as network:
            files = ("--net-file", network, "--additional-files", types)
            self._load([*files, *self._arguments, "--seed", str(seed), *options])

    def _load(self, arguments: list[str]) -> None:
        try:
            if self._running.started:
                libsumo.load(arguments)
            else:
                libsumo.start(["sumo", *arguments])
                self._running.started = True
        except (libsumo.TraCIException, libsumo.FatalTraCIError) as error:
            self._running.started = False
            raise self.refused("begin", error) from error

    @_to("take a step")
    def step(self) -> None:
        """Advance by one simulation step."""
        libsumo.simulationStep()

    @_to("say the time")
    def time(self) -> float:
        """Simulated time since `load`, s."""
        return libsumo.simulation.getTime()

    @_to("name a route")
    def add_route(self, name: str, edges: Sequence[str]) -> None:
        """Define a route: a name for a sequence of edges."""
        libsumo.route.add(name, list(edges))

    @_to("add a vehicle")
    def add(self, vehicle: str, route: str, kind: str, lane: int, front: float, speed: float) -> None:
        """Ask for a vehicle on a lane of its route's first edge, front bumper at `front` m, at speed m/s."""
        libsumo.vehicle.add(
            vehicle, route, typeID=kind, departLane=str(lane), departPos=f"{front:.3f}",
            departSpeed=f"{speed:.3f}",
        )  # fmt: skip

    @_to("remove a vehicle")
    def remove(self, vehicle: str) -> None:
        """Take a vehicle off the road."""
        libsumo.vehicle.remove(vehicle)

    @_to("list its vehicles")
    def vehicles(self) -> tuple[str, ...]:
        """Names of the vehicles on the road."""
        return libsumo.vehicle.getIDList()

    @_to("say where vehicles are")
    def motion(self, vehicles: Sequence[str]) -> Motion:
        """Read n vehicles at once."""
        count = len(vehicles)
        numbers = [*chain.from_iterable(map(_place, vehicles))]
        for get in _NUMBERS:
            numbers += map(get, vehicles)
        table = np.array(numbers)
        position = table[: 2 * count].reshape(count, 2)
        angle, speed, acceleration, along = table[2 * count :].reshape(len(_NUMBERS), count)
        heading = _QUARTER - angle * _RADIAN
        course = np.empty((count, 2))
        course[:, 0], course[:, 1] = np.cos(heading), np.sin(heading)
        return Motion(position, heading, course, speed, acceleration, list(map(_lane, vehicles)), along)

    @_to("say where a vehicle is")
    def pose(self, vehicle: str, length: float) -> tuple[float, float, float]:
        """Centre (m, m) and heading (rad) of a vehicle `length` m long."""
        x, y = _place(vehicle)
        psi = _QUARTER - _angle(vehicle) * _RADIAN
        return x - 0.5 * length * math.cos(psi), y - 0.5 * length * math.sin(psi), psi

    @_to("say how fast a vehicle is")
    def drive(self, vehicle: str) -> tuple[float, float]:
        """Speed m/s and acceleration m/s2 of a vehicle."""
        return libsumo.vehicle.getSpeed(vehicle), libsumo.vehicle.getAcceleration(vehicle)

    @_to("say how long a vehicle has stood")
    def stood(self, vehicle: str) -> float:
        """How long a vehicle has stood, s; 0 if it moves or is gone."""
        return libsumo.vehicle.getWaitingTime(vehicle) if vehicle in libsumo.vehicle.getIDList() else 0.0

    @_to("say how long a vehicle is")
    def length(self, vehicle: str) -> float:
        """Length of a vehicle, m."""
        return libsumo.vehicle.getLength(vehicle)

    @_to("say on which lane a vehicle is")
    def lane_place(self, vehicle: str) -> tuple[str, float]:
        """Lane of a vehicle, and position of its front bumper along it, m."""
        return libsumo.vehicle.getLaneID(vehicle), libsumo.vehicle.getLanePosition(vehicle)

    @_to("say how a lane runs")
    def lane_line(self, lane: str) -> tuple[Array, float]:
        """A lane's centre line (K, 2) m, and its length as stated in the network file, m."""
        return np.array(libsumo.lane.getShape(lane)), libsumo.lane.getLength(lane)

    @_to("place a vehicle")
    def place(self, vehicle: str, x: float, y: float, psi: float, v: float, length: float) -> None:
        """Put a vehicle's centre at (x, y) m with heading psi rad and speed v m/s, whatever its lane."""
        front_x, front_y, angle = sumo_pose(x, y, psi, length)
        _move(vehicle, "", -1, front_x, front_y, angle, 2, MATCH_M)
        _set_speed(vehicle, v)

    @_to("block a lane")
    def block(self, vehicle: str, edge: str, lane: int, start: float, end: float) -> None:
        """Add a vehicle that stands for good on a lane of an edge, from `start` to `end` m."""
        self.add_route(vehicle, [edge])
        self.add(vehicle, vehicle, "car", lane, end - 0.1, 0.0)
        libsumo.vehicle.setLength(vehicle, end - start)
        libsumo.vehicle.setLaneChangeMode(vehicle, 0)
        libsumo.vehicle.setStop(vehicle, edge, end, lane, 1e6)

    @_to("lengthen what blocks a lane")
    def lengthen(self, vehicle: str, length: float) -> None:
        """Set a vehicle's length in m; its front stays where it is."""
        libsumo.vehicle.setLength(vehicle, length)

    @_to("hand a vehicle over")
    def take_over(self, vehicle: str) -> None:
        """From now on `place` alone moves this vehicle."""
        libsumo.vehicle.setSpeedMode(vehicle, OBEDIENT)
        libsumo.vehicle.setLaneChangeMode(vehicle, 0)

    @_to("give a driver its character")
    def personality(self, vehicle: str, **values: float) -> None:
        """Set values of a driver: `tau` (headway, s), `min_gap` (m), `accel`, `decel` and `emergency_decel`
        (m/s2), `max_speed` (m/s), `speed_factor`; others stay as they are.

        IDM looks ahead with 2 sqrt(accel * decel), which SUMO works out only when it makes a type: so one is
        made of these values, rounded to 0.01, and they are set again. With another type, also with the first
        value of its own, a vehicle would get that type's speed factor."""
        factor = values.pop("speed_factor", None) or libsumo.vehicle.getSpeedFactor(vehicle)
        _set(vehicle, values)
        if values.keys() & {"accel", "decel"}:
            libsumo.vehicletype.copy(own := libsumo.vehicle.getTypeID(vehicle), f"{own}*")
            libsumo.vehicle.setType(vehicle, f"{own}*")
            _set(vehicle, values)
        libsumo.vehicle.setSpeedFactor(vehicle, factor)

    @_to("redirect a vehicle")
    def redirect(self, vehicle: str, route: str) -> None:
        """Give a vehicle that has not reached its junction another route, by name."""
        libsumo.vehicle.setRouteID(vehicle, route)

    @_to("hold a vehicle in its lane")
    def hold_lane(self, vehicle: str) -> int:
        """Have a vehicle change lanes only when asked to, and if there is room. Returns its previous mode."""
        mode = libsumo.vehicle.getLaneChangeMode(vehicle)
        libsumo.vehicle.setLaneChangeMode(vehicle, mode & ONLY_WHEN_ASKED)
        return mode

    @_to("set how a vehicle changes lanes")
    def set_lane_changes(self, vehicle: str, mode: int) -> None:
        """Set a vehicle's lane-change mode, as `hold_lane` returned it."""
        libsumo.vehicle.setLaneChangeMode(vehicle, mode)

    @_to("slow a vehicle down")
    def slow_down(self, vehicle: str, speed: float, duration: float) -> None:
        """Bring a vehicle to a speed (m/s) evenly within `duration` s; then SUMO sets its speed again."""
        libsumo.vehicle.slowDown(vehicle, speed, duration)

    @_to("have a vehicle change lanes")
    def ask_lane(self, vehicle: str, lane: int, duration: float) -> None:
        """Have a vehicle change to a lane of its edge as soon as there is room, and stay for `duration` s."""
        libsumo.vehicle.changeLane(vehicle, lane, duration)

    @_to("move a vehicle aside")
    def shift(self, vehicle: str, aside: float) -> None:
        """Put a vehicle `aside` m to the left of its lane's middle."""
        libsumo.vehicle.setLateralLanePosition(vehicle, aside)

    @_to("set what limits a vehicle's speed")
    def set_mode(self, vehicle: str, mode: int, hardest: float) -> None:
        """Set which of SUMO's checks limit a vehicle's speed (its speed mode), and how hard it may brake on
        command, m/s2. How far IDM looks ahead stays as it is."""
        _set(vehicle, {"decel": hardest, "speed_factor": libsumo.vehicle.getSpeedFactor(vehicle)})
        libsumo.vehicle.setSpeedMode(vehicle, mode)

    @_to("limit the speed on a lane")
    def limit_lane(self, lane: str, speed: float) -> None:
        """Set a lane's speed limit, m/s."""
        libsumo.lane.setMaxSpeed(lane, speed)

    @_to("have a vehicle overlook another")
    def overlook(self, vehicle: str, other: str, *, ahead: bool = False) -> None:
        """From now on a vehicle gives way at junctions to all but one other or, `ahead`, follows all but one
        other; empty: all."""
        model = "carFollowModel" if ahead else "junctionModel"
        libsumo.vehicle.setParameter(vehicle, f"{model}.ignoreIDs", other)
