"""`Layout`: a junction with its arms, lanes, movements, paths, right of way and drivable area, from a
.net.xml: all of a `Network` that does not depend on who drives.

World frame: x east, y north, as in the file; angles counter-clockwise from x; SI units. Nothing here knows
any particular junction. Lanes are numbered as in SUMO: 0 is the rightmost in driving direction.

Right of way is SUMO's request matrix, as netconvert computed it from the node's type. Where all have
the same right (all-way stop), that matrix says of any two crossing ways that each must yield to the other,
and no arm is major.
"""

from __future__ import annotations

from itertools import chain, pairwise
from pathlib import Path
from weakref import WeakKeyDictionary

import numpy as np

from rudc.arrays import Array, Flags
from rudc.errors import NetworkError
from rudc.hints import did_you_mean
from rudc.network import assembly, reader, sides
from rudc.network.conflicts import Crossings, conflict_table, crossings, departure_table, silent
from rudc.network.net_file import read_net
from rudc.network.paths import PathTable
from rudc.network.polyline import without_repeats
from rudc.network.road import Arm, Lane, Movement, may_mean
from rudc.network.route import ReferencePath, Route
from rudc.network.surface import Surface


class Layout:
    """One junction and its arms. Immutable; conflict tables are computed once and kept."""

    def __init__(self, path: Path, junction: str | None = None) -> None:
        """Reads the .net.xml at `path`; `junction` names the node (or one of the roundabout's) if there are
        several."""
        chosen = reader.choose_junction(read_net(path), junction, path)
        self.path = path
        """the .net.xml"""
        self.junction = junction
        """what was asked for"""
        self.name = path.name.removesuffix(".gz").removesuffix(".net.xml").removesuffix(".xml")
        """file name without its endings"""
        self.nodes: tuple[str, ...] = tuple(node.getID() for node in chosen.nodes)
        """SUMO nodes of the junction: one, or all of a roundabout"""
        self.node_type = str(chosen.nodes[0].getType())
        """SUMO's type of the junction's (first) node: priority, allway_stop, ..."""
        self.is_roundabout = chosen.is_roundabout
        """whether the junction is a whole roundabout"""
        self.ring_edges: frozenset[str] = chosen.ring
        """edges of a roundabout's ring"""
        self.center: Array = assembly.centre_of(chosen)
        """(2,) m, what positions in scenario files are relative to"""
        raw_arms = assembly.in_order(reader.find_arms(chosen), self.center)
        self.lights = assembly.lights_at(chosen, raw_arms)
        """nodes of the junction and of its arms that have traffic lights"""
        self.tracks = assembly.tracks_across(raw_arms)
        """where tracks cross an arm: its place in `arms`, and (2,) m"""
        ways = reader.find_ways(chosen, raw_arms)
        if not ways:
            raise NetworkError(f"{path}: no connection leads through the junction {self.nodes[0]!r}")
        yields = reader.right_of_way(chosen, ways)
        self.lanes: dict[str, Lane] = assembly.make_lanes(chosen, raw_arms, ways)
        """all lanes by SUMO's id: of the arms, of the ring, and inside the nodes"""
        self.left_out = assembly.lanes_without_cars(chosen, raw_arms)
        """arms' lanes without cars, which are no part of the road, by SUMO's id -> who may use them"""
        self.reserved = assembly.reserved_lanes(chosen, raw_arms)
        """lanes without cars, also of the ring, and pavements: what pictures show beside the road"""
        self.stopping = assembly.stopping_lanes(raw_arms)
        """lanes, by SUMO's id, that end at a stop sign"""
        arms = assembly.make_arms(raw_arms, self.lanes, self.center)
        self.arms: tuple[Arm, ...] = tuple(assembly.decide_major(arms, ways, yields, self.node_type))
        """counter-clockwise from the east"""
        self.road_km = sum(arm.two_way_m for arm in self.arms) / 1000.0
        """km of two-way road on the arms: density is vehicles / road_km"""
        self.movements: tuple[Movement, ...] = tuple(assembly.make_movements(self.arms, ways, yields))
        """permitted ways between arms"""
        self.refused = assembly.refused_classes(chosen.net, self.movements, self.lanes.values())
        """(origin, destination) of each movement -> SUMO's classes of vehicles that may not drive it: on some
        edge all its lanes for cars are closed to them, or no connection from one edge to the next is open
        """
        self.onward = tuple(movement for movement in self.movements if movement.turn != "u_turn")
        """those that do not lead back: nobody turns back, neither the ego nor an SV"""
        self._sources = [way.source for way in ways]
        edges: dict[str, list[str]] = {}
        for lane in self.lanes.values():
            edges.setdefault(lane.edge, []).append(lane.id)
        self.paths = PathTable(self._sources, [arm.name for arm in self.arms], edges, yields)
        """all lane-to-lane ways"""
        self.node_polygons: tuple[Array, ...] = tuple(sides.shape_of(node) for node in chosen.nodes)
        """(K, 2) m each, shapes of the junction's nodes"""
        directed = [(lane.xy, lane.polygon) for lane in self.lanes.values() if not lane.internal]
        self.surface = Surface(assembly.drivable_polygons(chosen, raw_arms, self.lanes), directed)
        """the drivable area"""
        self._conflicts: WeakKeyDictionary[ReferencePath, Array] = WeakKeyDictionary()
        self._giving_way: WeakKeyDictionary[ReferencePath, Flags] = WeakKeyDictionary()
        self._silent: WeakKeyDictionary[ReferencePath, Array] = WeakKeyDictionary()
        self._crossings: WeakKeyDictionary[ReferencePath, Crossings] = WeakKeyDictionary()
        self._departures: WeakKeyDictionary[ReferencePath, Array] = WeakKeyDictionary()
        self.center.flags.writeable = False

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.name!r}, arms={[arm.name for arm in self.arms]})"

    def refuse_lights(self) -> None:
        """Raise NetworkError if the junction has traffic lights, to which nobody here pays attention."""
        if self.lights:
            raise NetworkError(
                f"{self.path}: junction {self.lights[0]!r} has traffic lights, to which the ego pays no "
                f"attention; take them away: netconvert -s {self.path.name} --tls.discard-loaded "
                f"--tls.unset {','.join(self.lights)} -o {self.name}_without_lights.net.xml"
            )

    @property
    def half_extent(self) -> float:
        """m, half the side of the square about the centre that holds all arms."""
        return float(max(np.abs(lane.xy - self.center).max() for lane in self.lanes.values()))

    def arm(self, name: str) -> Arm:
        """The arm of that name; also found by the id of one of its edges, if no arm has that name."""
        for arm in self.arms:
            if name == arm.name:
                return arm
        for arm in self.arms:
            if name in arm.in_edges or name in arm.out_edges:
                return arm
        names = [arm.name for arm in self.arms]
        raise NetworkError(
            f"no arm {name!r} in network {self.name}{did_you_mean(name, may_mean(name, names))}; there are: "
            f"{', '.join(names)}; an arm can also be given by the id of one of its edges"
        )

    def lanes_of(self, arm: Arm) -> list[Lane]:
        """All lanes of an arm's edges, inbound first, outermost edge first."""
        edges = (*arm.in_edges, *arm.out_edges)
        return [lane for edge in edges for lane in self.lanes.values() if lane.edge == edge]

    def speed_limit(self, edge: str) -> float:
        """m/s, the lowest limit among the lanes of an edge."""
        return min(lane.speed for lane in self.lanes.values() if lane.edge == edge)

    def movement(self, origin: str, towards: str) -> Movement:
        """The movement from an arm to another (by name or edge id), or by its turn: left, straight, right,
        u_turn."""
        start = self.arm(origin).name
        options = [m for m in self.movements if m.origin == start]
        if towards in ("left", "straight", "right", "u_turn"):
            found = [m for m in options if m.turn == towards]
        else:
            end = self.arm(towards).name
            found = [m for m in options if m.destination == end]
        if len(found) == 1:
            return found[0]
        known = ", ".join(f"{m.destination} ({m.turn})" for m in options) or "nowhere"
        problem = (
            f"leads {towards} to several arms; name the one meant"
            if found
            else f"does not lead to {towards!r}"
        )
        raise NetworkError(f"network {self.name}: arm {start!r} {problem}; from there one gets to {known}")

    def conflict(self, path: ReferencePath | Route) -> Array:
        """(P, 4) m: s_ego_in, s_ego_out, s_sv_in, s_sv_out of the path's conflict with each row of `paths`.

        From the first to the last place where the two centre lines are closer than 2.2 m; nan where they
        never are.
        """
        line = path.path if isinstance(path, Route) else path
        if line not in self._conflicts:
            table = conflict_table(line, self.paths)
            table.flags.writeable = False
            self._conflicts[line] = table
        return self._conflicts[line]

    def gives_way(self, path: ReferencePath | Route, row: int) -> Flags:
        """(P,) the rows of `paths`, from other arms, to which an ego on a path over `row` gives way: those to
        which it must yield, and those of which the right of way says nothing (`silent`).
        """
        line = path.path if isinstance(path, Route) else path
        if line not in self._giving_way:
            paths = self.paths
            must = paths.yields[row] & (paths.origin != paths.origin[row])
            rows = must | np.isfinite(self.silent(line, row)[:, 0])
            rows.flags.writeable = False
            self._giving_way[line] = rows
        return self._giving_way[line]

    def silent(self, path: ReferencePath | Route, row: int) -> Array:
        """(P, 4) m, where a path over `row` meets the rows of `paths` of which the right of way says nothing
        (`conflicts.silent`); nan elsewhere."""
        line = path.path if isinstance(path, Route) else path
        if line not in self._silent:
            table = silent(line, self.paths, row)
            table.flags.writeable = False
            self._silent[line] = table
        return self._silent[line]

    def yields_on_entering(self, row: int) -> Flags:
        """(P,) the rows of a roundabout that give way to `row` where they enter the ring, and to which `row`
        gives way where it enters; all false elsewhere."""
        yields = self.paths.yields
        return yields[row] & yields[:, row] & self.is_roundabout

    def crossings(self, path: ReferencePath | Route, row: int) -> Crossings:
        """Where a path over `row` meets the rows of `paths`, as `conflict`; those of `yields_on_entering` it
        may meet at two places: where it enters the ring, and where they do."""
        line = path.path if isinstance(path, Route) else path
        if line not in self._crossings:
            twice = self.yields_on_entering(row)
            silent = self.silent(line, row)
            self._crossings[line] = crossings(line, self.paths, twice, self.conflict(line), silent)
        return self._crossings[line]

    def departure(self, course: Route) -> Array:
        """(P, 4) m, as `conflict`, but only of the stretches of a course that lie off its route."""
        line = course.path
        if line not in self._departures:
            table = departure_table(line, self.paths)
            table.flags.writeable = False
            self._departures[line] = table
        return self._departures[line]

    def inbound_lane(self, row: int) -> Lane:
        """The last lane before the junction of a row of `paths`."""
        return self.lanes[self._sources[row].lane_ids[self._sources[row].before_junction - 1]]

    def outbound_lane(self, row: int) -> Lane:
        """The first lane after the junction of a row of `paths`."""
        return self.lanes[self._sources[row].lane_ids[-self._sources[row].after_junction]]

    def centre_line(self, row: int) -> Array:
        """(K, 2) m, the lanes' centre lines of a row of `paths`, joined."""
        return without_repeats(np.concatenate(self._sources[row].shapes))

    def carriageway(self, movement: Movement, both_ways: bool = False) -> list[Array]:
        """Polygons (K, 2) m that a movement's traffic may use: all lanes of its edges, what lies between one
        edge of an arm and the next, and the junction.

        `both_ways`: and the lanes of oncoming traffic on the two arms.
        """
        origin, destination = self.arm(movement.origin), self.arm(movement.destination)
        chains = [origin.in_edges, destination.out_edges]
        if both_ways:
            chains += [origin.out_edges, destination.in_edges]
        edges = {*movement.edges, *self.ring_edges, *chain.from_iterable(chains)}
        lanes = [lane for lane in self.lanes.values() if lane.internal or lane.edge in edges]
        of: dict[str, list[Lane]] = {}
        for lane in lanes:
            of.setdefault(lane.edge, []).append(lane)
        joints = [assembly.joint(of[a], of[b]) for way in chains for a, b in pairwise(way)]
        return [*map(assembly.lane_area, lanes), *joints, *self.node_polygons]

    def span(self, row: int, lane_id: str) -> tuple[float, float]:
        """m, arc lengths at which a lane of a row of `paths` begins and ends."""
        return self.paths.spans[row][lane_id]
