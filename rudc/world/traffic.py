"""Surrounding vehicles (SVs): who they are, how many there are, and where they come from.

The density is the number of SVs per km of two-way road. It is kept constant: each SV that leaves at the end
of an arm is replaced by one that enters at the start of an arm where there is room, so that the number of SVs
stays at round(density * road_km) while there is room.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from rudc.scenario.events.event import HARDEST
from rudc.world.bends import Bends
from rudc.world.demand import Demand
from rudc.world.sumo import HEEDLESS, OWN_SPEED, Sumo
from rudc.world.vehicle_types import EGO, EMERGENCY_DECEL, VEHICLE_TYPES, VehicleType

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from rudc.network.network import Lane, Movement, Network
    from rudc.scenario.plan import TrafficPlan
    from rudc.world.spawn import Entry

RESERVE = 0.5
"""of the grip, that an SV's comfortable braking may take; hard braking takes all"""
BESIDE_M = 0.2
"""m beside an SV that must be free so that it drives on: less, and the yielding layer stops it"""


@dataclass(slots=True)
class Driver:
    """One SV: its body, its movement, and its driver's character."""

    type: VehicleType
    origin: str
    destination: str
    accel: float
    """m/s2, on a dry road"""
    decel: float
    """m/s2, comfortable on a dry road"""
    speed_factor: float
    """desired speed divided by the speed limit"""
    overridden: int = 0
    """how many events command its speed at present; if there are any, the yielding layer brakes it only
    harder than they do
    """
    heedless: int = 0
    """how many events make it disregard the right of way at present; if there are any, the yielding layer
    brakes it only behind the ego"""
    slips: bool = False
    """whether the road's friction keeps it from braking or accelerating as hard as it could"""
    keeps_lane: bool = False
    """whether it leads or follows the ego for an event: it then stays in its lane up to the junction"""
    keeps_turn: bool = False
    """whether an event asks for one that turns as it does: it then waits where its way is blocked"""

    @property
    def mode(self) -> int:
        """SUMO's speed mode, by the events that act on it at present."""
        return HEEDLESS if self.heedless and not self.overridden else OWN_SPEED


class Traffic:
    """Keeps the SVs of one episode at their density.

    `density` (veh/km) may be changed at any time; a surplus shrinks as SVs leave the network.
    """

    def __init__(self, sumo: Sumo, network: Network) -> None:
        self._sumo = sumo
        self._network = network
        self._arms = {arm.name: arm for arm in network.arms}
        self._lanes: dict[str, list[Lane]] = {}
        """lanes of each edge"""
        for lane in network.lanes.values():
            self._lanes.setdefault(lane.edge, []).append(lane)
        self._inbound = {
            (movement.origin, movement.destination): [
                self._lanes_for(movement, edge) for edge in self._arms[movement.origin].in_edges
            ]
            for movement in network.movements
        }
        """lanes that each movement uses on each edge of its arm, outermost edge first"""
        self.entries = list({lane.id: lane for edges in self._inbound.values() for lane in edges[0]}.values())
        """lanes on which further SVs enter"""
        self.bends = Bends(sumo, network)

    def begin(self, plan: TrafficPlan, rng: np.random.Generator) -> None:
        """Forget the last episode; the roads stay empty until `populate`."""
        self._plan = plan
        self._rng = rng
        self._occupied: dict[str, list[tuple[float, float]]] = {}
        self._closed: set[tuple[str, str]] = set()
        self.grip = math.inf
        """m/s2, how hard the road lets an SV brake and accelerate"""
        self.waiting: dict[str, str] = {}
        """SVs that are not yet on the road, and the edges on which they will be"""
        self.bends.forget()
        self._slow_in_bends()
        self._count = 0
        self._ego: Driver | None = None
        self.drivers: dict[str, Driver] = {}
        names = sorted(plan.mix)
        weights = np.array([plan.mix[name] for name in names], dtype=float)
        self._mix = names, weights / weights.sum()
        self._kind_waiting: str | None = None
        """the kind of the next SV, where one was drawn for which there was no room yet"""
        types = [VEHICLE_TYPES[name] for name in names if plan.mix[name]]
        self.needs_m = 0.5 * max(kind.width for kind in types) + BESIDE_M
        """m to each side of a lane's centre line that must be free so that every SV of the mix drives on"""
        self.lengths_m = sorted({kind.length for kind in types})
        """m, the lengths of the mix's vehicles"""
        self.density = self.usual_density = plan.density
        self._demand = Demand(self._network, plan.origins, plan.turns)
        for movement in self._network.onward:
            self._sumo.add_route(_route(movement), movement.edges)
        for arm in self._arms.values():
            if arm.out_edges:
                self._sumo.add_route(f"leave:{arm.name}", arm.out_edges)

    def reserve(self, lane: str, start: float, end: float) -> None:
        """Keep a lane free from `start` to `end` m when the roads are populated."""
        self._occupied.setdefault(lane, []).append((start, end))

    def populate(self) -> None:
        """Put SVs on the roads, towards the junction and away from it, until the density is reached."""
        for _ in range(self.target):
            self._place_somewhere()

    @property
    def target(self) -> int:
        """How many SVs the density asks for."""
        return round(self.density * self._network.road_km)

    @property
    def missing(self) -> int:
        """How many SVs are missing to reach `target`; negative for a surplus."""
        return self.target - len(self.drivers)

    def refill(self, rears: Iterable[tuple[str, float, float]]) -> None:
        """Let new SVs enter where there is room, up to the target. `rears`: see `Reader.rears`."""
        entry: dict[str, tuple[float, float]] = {}
        for lane, rear, speed in rears:
            if rear < entry.get(lane, (math.inf, 0.0))[0]:
                entry[lane] = (rear, speed)
        for _ in range(self.missing):
            self._enter(entry)

    def add(self, driver: Driver, place: Entry, speed: float) -> str:
        """Add an SV beyond those that the density asks for; it enters at the next step. Returns its name."""
        route = f"added:{self._count}"
        self._sumo.add_route(route, place.edges)
        return self._add(driver, route, place.lane, place.front, speed)

    def draw_driver(self, movement: Movement, kind: str) -> Driver:
        """Who will drive a further SV of that kind."""
        plan, rng = self._plan, self._rng
        return Driver(
            VEHICLE_TYPES[kind],
            movement.origin,
            movement.destination,
            plan.accel.sample(rng),
            plan.decel.sample(rng),
            plan.speed_factor.sample(rng),
        )

    def entry_speed(self, driver: Driver, lane: Lane, wanted: float) -> float:
        """m/s, the speed with which an SV enters on a lane, if `wanted` m/s are wanted."""
        # SUMO ends the simulation over a vehicle that departs faster than it would ever drive on its lane,
        # and refuses one that departs faster than its edge's limit or than it can, whatever its speed factor.
        usual = 0.99 * driver.speed_factor * min(self.bends.limit(lane), driver.type.max_speed)
        return min(wanted, usual, driver.type.max_speed, self.bends.edge_limit(lane.edge))

    def may_go(self, name: str, origin: str, destination: str) -> bool:
        """Whether all roads of a movement are open to an SV's class of vehicles."""
        return self.drivers[name].type.vclass not in self._network.refused[origin, destination]

    def redirect(self, name: str, origin: str, destination: str) -> None:
        """Send an SV that has not reached its stop line to another arm; its lane must lead there."""
        driver = self.drivers[name]
        driver.origin, driver.destination = origin, destination
        self._sumo.redirect(name, f"{origin}>{destination}")

    def draw_speed(self) -> float:
        """m/s, drawn initial speed of a further SV."""
        return self._plan.speed.sample(self._rng)

    def avoid(self, closed: set[tuple[str, str]]) -> None:
        """From now on no SV enters for these movements (origin, destination), if its arm has any other."""
        self._closed = closed

    def lose_grip(self, limit: float) -> None:
        """From now on no vehicle that SUMO drives brakes, accelerates or turns harder than `limit` m/s2."""
        self.grip = limit
        self._slow_in_bends()
        for name, driver in self.drivers.items():
            self._slip(name, driver)
        if self._ego is not None:
            self._slip(EGO, self._ego)

    def comfortable(self, decel: float) -> float:
        """m/s2, how hard the road lets a driver brake who brakes with `decel` m/s2 where it is dry."""
        return min(decel, RESERVE * self.grip)

    def set_mode(self, name: str, *, hard: bool = False) -> None:
        """Have SUMO limit a vehicle's speed as the events say that act on it. Without `hard`, commands brake
        it comfortably at most, unless they are an event's.
        """
        driver = self.drivers.get(name) or self._ego
        assert driver is not None, "neither an SV nor an ego that SUMO drives"
        most = HARDEST if driver.overridden else EMERGENCY_DECEL if hard else self.comfortable(driver.decel)
        self._sumo.set_mode(name, driver.mode, min(most, self.grip))

    def drives(self, name: str) -> bool:
        """Whether SUMO drives a vehicle, an SV or the ego, that has not left."""
        return name in self.drivers or (name == EGO and self._ego is not None)

    def drive_ego(self) -> None:
        """From now on SUMO drives the ego, too; the road's friction limits it as it does the SVs."""
        self._ego = Driver(
            VEHICLE_TYPES["car"], "", "", self._plan.accel.mean, self._plan.decel.mean, speed_factor=1.0
        )
        self._slip(EGO, self._ego)

    def _slip(self, name: str, driver: Driver) -> None:
        slips = self.grip < max(EMERGENCY_DECEL, driver.accel, driver.decel / RESERVE)
        if slips or driver.slips:
            driver.slips = slips
            self._sumo.personality(
                name,
                accel=min(driver.accel, self.grip),
                decel=self.comfortable(driver.decel),
                emergency_decel=min(EMERGENCY_DECEL, self.grip),
            )
            if driver.overridden:
                self.set_mode(name)

    def forget(self, active: tuple[str, ...]) -> None:
        """Forget who has left, of the SVs and an ego that SUMO drives; SVs that were added but are not yet on
        the road are kept."""
        present = set(active)
        if EGO not in present:
            self._ego = None
        came = self.waiting.keys() & present
        for name in came:
            del self.waiting[name]
        if came and self._slow_later:
            self._slow_in_bends()
        for name in self.drivers.keys() - present - self.waiting.keys():
            del self.drivers[name]

    def _slow_in_bends(self) -> None:
        self._slow_later = self.bends.slow(self.grip, self.waiting.values())
        """whether limits wait for vehicles to enter"""

    def draw_type(self) -> str:
        """The kind of a further SV, drawn from the scenario's mix."""
        names, weights = self._mix
        return names[0] if len(names) == 1 else names[self._rng.choice(len(names), p=weights)]

    def takes(self, movement: Movement) -> bool:
        """Whether the scenario lets vehicles turn as a movement does."""
        return self._demand.takes(movement)

    def may_drive(self, kind: str, movement: Movement, lane: Lane) -> bool:
        """Whether a kind of vehicle may enter on a lane and drive a movement."""
        vclass = VEHICLE_TYPES[kind].vclass
        return vclass not in self._network.refused[movement.origin, movement.destination] | {*lane.refuses}

    def _lanes_for(self, movement: Movement, edge: str) -> list[Lane]:
        """The lanes of an edge that a movement uses; all of them if its own begin on a later edge."""
        own = {name for row in movement.rows for name in self._network.paths.lane_ids[row]}
        lanes = sorted(self._lanes.get(edge, []), key=lambda lane: lane.id)
        return [lane for lane in lanes if lane.id in own] or lanes

    def _add(self, driver: Driver, route: str, lane: Lane, front: float, speed: float) -> str:
        name = f"sv{self._count}"
        self._count += 1
        plan, rng = self._plan, self._rng
        speed = self.entry_speed(driver, lane, speed)
        self._sumo.add(name, route, driver.type.kind.name.lower(), lane.index, front, speed)
        character = {
            "tau": (plan.headway_s.sample(rng), plan.headway_s.mean),
            "min_gap": (plan.min_gap_m.sample(rng), plan.min_gap_m.mean),
            "accel": (driver.accel, plan.accel.mean),
            "decel": (driver.decel, plan.decel.mean),
            "speed_factor": (driver.speed_factor, 1.0),
        }
        # Values that equal those of its type are not set again, since SUMO makes a type of its own for each
        # vehicle that is set.
        self._sumo.personality(
            name, **{trait: own for trait, (own, usual) in character.items() if own != usual}
        )
        self.drivers[name] = driver
        self._slip(name, driver)
        self.waiting[name] = lane.edge
        return name

    def _place_somewhere(self) -> None:
        kind = None
        for _ in range(40):
            movement, kind = self._demand.draw(self._closed, self._rng), kind or self.draw_type()
            inbound = self._rng.random() < 0.5
            arm = self._arms[movement.origin if inbound else movement.destination]
            edges = arm.in_edges if inbound else arm.out_edges
            k = self._draw_edge(edges)
            lanes = (
                self._inbound[movement.origin, movement.destination][k] if inbound else self._lanes[edges[k]]
            )
            lane = lanes[self._rng.integers(len(lanes))]
            length = VEHICLE_TYPES[kind].length
            first = length + 1.0 if k == 0 else 0.0
            if not self.may_drive(kind, movement, lane):
                kind = None
                continue
            if len(edges) > 1 and lane.length < first + 0.5:
                continue
            front = self._rng.uniform(first, max(lane.length - 1.0, first + 0.5))
            further = sum(self._length(edge) for edge in edges[k + 1 :])
            to_stop = lane.length - front + further if inbound else math.inf
            most = math.sqrt(1.6 * self.comfortable(self._plan.decel.mean) * max(to_stop, 0.1))
            speed = min(self._plan.speed.sample(self._rng), VEHICLE_TYPES[kind].max_speed, most)
            room = 4.0 + 0.7 * speed
            there = self._there(edges, k, lane)
            if all(front < r - room or front - length > f + room for r, f in there):
                self.reserve(lane.id, front - length, front)
                route = _route(movement) if inbound else f"leave:{arm.name}"
                if k > 0:
                    route = f"added:{self._count}"
                    self._sumo.add_route(route, (movement.edges if inbound else edges)[k:])
                self._add(self.draw_driver(movement, kind), route, lane, front, speed)
                return

    def _draw_edge(self, edges: Sequence[str]) -> int:
        """Index of one of an arm's edges, drawn with probabilities in proportion to their lengths."""
        if len(edges) == 1:
            return 0
        lengths = np.array([max(self._length(edge) - 1.0, 0.0) for edge in edges])
        return int(self._rng.choice(len(edges), p=lengths / lengths.sum()))

    def _length(self, edge: str) -> float:
        """Length of an edge, m; 0 for an edge without lanes in the network (it is too short to be drawn)."""
        return self._lanes[edge][0].length if edge in self._lanes else 0.0

    def _there(self, edges: Sequence[str], k: int, lane: Lane) -> list[tuple[float, float]]:
        """Occupied stretches (rear, front) on a lane of edge k, and on all lanes of the arm's other edges; m
        along the lane, negative before it."""
        starts = np.cumsum([0.0, *map(self._length, edges)])
        return [
            (rear + starts[j] - starts[k], front + starts[j] - starts[k])
            for j, edge in enumerate(edges)
            for one in ([lane] if j == k else self._lanes.get(edge, []))
            for rear, front in self._occupied.get(one.id, [])
        ]

    def _enter(self, entry: dict[str, tuple[float, float]]) -> None:
        """Let one SV enter if there is room. A kind for which there is none comes next, so that long vehicles
        keep their share of the mix on crowded roads.
        """
        kind, self._kind_waiting, refused = self._kind_waiting, None, True
        for _ in range(8):
            movement, kind = self._demand.draw(self._closed, self._rng), kind or self.draw_type()
            lanes = self._inbound[movement.origin, movement.destination][0]
            lane = lanes[self._rng.integers(len(lanes))]
            if not self.may_drive(kind, movement, lane):
                continue
            refused = False
            length = VEHICLE_TYPES[kind].length
            rear, leader_speed = entry.get(lane.id, (math.inf, 0.0))
            room = rear - length - 2.0
            if room < 4.0:
                continue
            speed = min(self._plan.speed.sample(self._rng), VEHICLE_TYPES[kind].max_speed)
            if room < math.inf:
                braking = self.comfortable(self._plan.decel.mean)
                speed = min(speed, math.sqrt(leader_speed**2 + braking * room))
            self._add(self.draw_driver(movement, kind), _route(movement), lane, length + 0.1, speed)
            entry[lane.id] = (0.1, speed)
            return
        self._kind_waiting = None if refused else kind


def _route(movement: Movement) -> str:
    return f"{movement.origin}>{movement.destination}"
