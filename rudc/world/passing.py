"""Surrounding vehicles (SVs) pass what stands at the edge of their lane, if it leaves them room there.

SUMO moves each vehicle along the middle of its lane. Where something stands there for good, and the lane
beside it is wide enough for the widest SV of the scenario, an SV moves aside within its lane: SIDEWAYS m for
each m of its way, early enough for the yielding layer, which looks 2 s ahead, not to brake it, and as if it
crept if it stands. SUMO knows nothing of such a thing (`Obstructed.passable`). So all this is for roads of
one lane, away from nodes, from where vehicles enter, and from other things. Any other thing closes its lane
for SUMO (rudc/world/events/stage.py), and blocks a row of `network.paths` where its middle is not free
(rudc/world/detours.py says what SVs do then). In bends, long vehicles cut across.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import TYPE_CHECKING

import numpy as np

from rudc.arrays import Array, Flags, Index
from rudc.geometry import gaps_between
from rudc.network.paths import SPACING
from rudc.world.entering import obstructed
from rudc.world.scene import Kind
from rudc.world.traffic import BESIDE_M
from rudc.world.vehicle_types import EGO
from rudc.world.yielding_kernels import HORIZON_S

if TYPE_CHECKING:
    from rudc.network.network import Network
    from rudc.network.paths import PathTable
    from rudc.network.road import Lane
    from rudc.world.props import Prop
    from rudc.world.scene import Scene
    from rudc.world.sumo import Sumo
    from rudc.world.traffic import Traffic

LEAST_LENGTH = 5.0
"""m; SVs that are shorter count as if they were that long"""
TOUCH = 0.1
"""m, gap between an SV and a thing below which the SV cannot pass"""
SPARE = 0.02
"""m more than that gap, beside which an SV moves aside"""
SIDEWAYS = 0.15
"""m that an SV moves aside for each m of its way"""
SHIFT_M = 8.0
"""m of its way in which an SV moves aside, and a little more"""
ENTRY_M, END_M, APART_M = 25.0, 12.0, 20.0
"""m that a thing that is passed is away from where SVs enter, from a lane's other ends, and from others"""
CREEP = 1.0
"""m/s; SVs that are slower move aside as fast as if they drove so"""
SHARES = (0.0, 0.2, -0.2, 0.4, -0.4, 0.6, -0.6, 0.8, -0.8, 1.0, -1.0)
"""of the room that its lane gives an SV beside its middle, to the left or, negative, to the right: those that
are tried, the least first"""


class Obstructed:
    """Which lanes things obstruct, in one episode, and which of these things SVs pass."""

    def __init__(self, network: Network, traffic: Traffic) -> None:
        self._network, self._traffic = network, traffic
        self._spans: dict[str, dict[str, tuple[float, float]]] = {}
        """lane -> name -> from where to where (m) a thing obstructs it"""
        self.passable: set[str] = set()
        """names of things that SVs pass within their lanes"""

    def add(self, name: str, corners: Array) -> list[tuple[Lane, float, float]]:
        """The lanes outside nodes that a thing with these corners (4, 2) m obstructs, from where to where
        (m)."""
        lanes = [lane for lane in self._network.lanes.values() if not lane.internal]
        spans = [(lane, obstructed(lane, corners, self._traffic.needs_m)) for lane in lanes]
        found = [(lane, *span) for lane, span in spans if span is not None]
        if found and all(self._leaves_room(lane, corners, start, end) for lane, start, end in found):
            self.passable.add(name)
        for lane, start, end in found:
            self._spans.setdefault(lane.id, {})[name] = start, end
        return found

    def remove(self, names: Collection[str]) -> None:
        """Things that have gone."""
        self.passable.difference_update(names)
        for there in self._spans.values():
            for name in there.keys() & set(names):
                del there[name]

    def _leaves_room(self, lane: Lane, corners: Array, start: float, end: float) -> bool:
        """Whether all SVs can pass a rectangle that obstructs a lane from `start` to `end` m."""
        room = self._traffic.needs_m - max(_room(lane.width, self._traffic) - SPARE, 0.0)
        enters = any(lane is entry for entry in self._traffic.entries)
        apart = all(
            start - b > APART_M or a - end > APART_M for a, b in self._spans.get(lane.id, {}).values()
        )
        clear = start > (ENTRY_M if enters else END_M) and end < lane.length - END_M
        alone = _is_alone(self._network, lane)
        return alone and apart and clear and obstructed(lane, corners, room) is None


def _is_alone(network: Network, lane: Lane) -> bool:
    """Whether a lane is the only one of its road in its direction."""
    return sum(other.edge == lane.edge for other in network.lanes.values()) == 1


def _room(lane: float, traffic: Traffic) -> float:
    """m that the widest SV may be beside the middle of a lane of that width (m)."""
    return max(0.5 * lane - (traffic.needs_m - BESIDE_M), 0.0)


class Passing:
    """Where SVs have room to pass, and how far aside they are, in one episode."""

    def __init__(self, sumo: Sumo, network: Network, traffic: Traffic) -> None:
        self._sumo, self._network, self._traffic = sumo, network, traffic
        self.lengths: Array = np.unique(np.maximum(traffic.lengths_m, LEAST_LENGTH))
        """(C,) m, the lengths for which room is sought, each its own; the shortest first"""
        self._room: Array | None = None
        self._aside: dict[str, float] = {}
        """name -> m that an SV is to the left of its lane's middle; only of those who are not on it"""
        self.standing: tuple[tuple[str, float, float, bool], ...] = ()
        """of each thing that stands on the road, its name and place (m), and whether it is waited for"""
        self._find([], (), ())

    def look(self, props: list[Prop], passable: Collection[str], waited_for: Collection[str]) -> None:
        """Find out what stands on the road now, and where SVs have room beside it: beside things of the names
        `passable` within their lane. Those `waited_for` do not block a row for good.
        """
        standing = [prop for prop in props if not prop.moves and prop.kind != Kind.PEDESTRIAN]
        key = tuple((prop.name, *prop.pose()[:2], prop.name in waited_for) for prop in standing)
        if key != self.standing:
            self.standing = key
            self._find(standing, passable, waited_for)

    def classes(self, lengths: Array) -> Index:
        """(N,) which of `lengths` stands for vehicles with these lengths (N,) m."""
        return np.minimum(np.searchsorted(self.lengths, lengths), len(self.lengths) - 1)

    def step(self, scene: Scene, decision_s: float, ego: tuple[int, float] | None = None) -> None:
        """Move the SVs aside, or back, by as much as they can within a decision, and a SUMO-driven ego on
        row `ego[0]`, at `ego[1]` m, too.
        """
        if not (self._aside or self._any_sought):
            return
        rows = np.flatnonzero(scene.path >= 0)
        names = [scene.ids[i] for i in rows.tolist()]
        path, s, lengths = scene.path[rows], scene.path_s[rows], scene.size[rows, 0]
        speed = np.hypot(scene.velocity[rows, 0], scene.velocity[rows, 1])
        if ego is not None and ego[0] >= 0:
            names.append(EGO)
            path, s = np.append(path, ego[0]), np.append(s, ego[1])
            lengths, speed = np.append(lengths, scene.vehicle.length), np.append(speed, scene.ego.v)
        now = np.array([self._aside.get(name, 0.0) for name in names])
        most = SIDEWAYS * np.maximum(speed, CREEP) * decision_s
        after = now + np.clip(self._wanted(path, s, lengths, speed) - now, -most, most)
        for name, before, aside in zip(names, now.tolist(), after.tolist(), strict=True):
            if before or aside:
                self._sumo.shift(name, aside)
        self._aside = {name: aside for name, aside in zip(names, after.tolist(), strict=True) if aside}

    def _wanted(self, path: Index, s: Array, lengths: Array, speed: Array) -> Array:
        """(N,) m to the left of their lane's middle where SVs should be, whose middles are at `s` m on rows
        `path`, given their lengths (m) and speeds (m/s): as far aside as they must be next, on the stretch
        that the yielding layer looks at, and no farther than their lane lets them now.
        """
        classes, wanted = self.classes(lengths), np.zeros(len(s))
        first = np.clip((s / SPACING).astype(int), 0, self._next.shape[2] - 1)
        last = ((s + HORIZON_S * speed + SHIFT_M) / SPACING).astype(int)
        for i in (self._next[classes, path, first] <= last).nonzero()[0].tolist():
            sought = self._sought[classes[i], path[i], first[i] : last[i] + 1]
            sought = sought[sought != 0.0]
            other_side = np.flatnonzero(sought * sought[0] < 0.0)  # of a later thing
            sought = sought[: other_side[0]] if len(other_side) else sought
            wanted[i] = sought[np.abs(sought).argmax()]
        room = self._rooms()[path, first]
        return np.clip(wanted, -room, room)

    def _find(self, standing: list[Prop], passable: Collection[str], waited_for: Collection[str]) -> None:
        paths = self._network.paths
        shape = len(self.lengths), *paths.xy.shape[:2]
        self.blocked: Flags = np.zeros(shape, dtype=np.bool_)
        """(C, P, M) at which stations of each row an SV with its middle there has no room"""
        self.blocked_for_good: Flags = self.blocked
        """(C, P, M) as `blocked`, but for things that are waited for"""
        self._sought: Array = np.zeros(shape)
        """(C, P, M) m to the left of its lane's middle where such an SV has room"""
        for c, length in enumerate(self.lengths.tolist() if standing else ()):
            self.blocked[c], self._sought[c] = self._beside(standing, passable, length)
        lasting = [prop for prop in standing if prop.name not in waited_for]
        if len(lasting) < len(standing):
            self.blocked_for_good = np.zeros_like(self.blocked)
            for c, length in enumerate(self.lengths.tolist() if lasting else ()):
                self.blocked_for_good[c] = self._beside(lasting, passable, length)[0]
        self._any_sought = bool(self._sought.any())
        beyond = np.where(self._sought != 0.0, np.arange(shape[2]), 2 * shape[2])
        self._next: Index = np.minimum.accumulate(beyond[..., ::-1], axis=2)[..., ::-1]
        """(C, P, M) the next station where an SV must be aside; 2 M where there is none"""

    def _beside(self, standing: list[Prop], passable: Collection[str], length: float) -> tuple[Flags, Array]:
        """(P, M) where an SV of that length (m) has no room on each row, and how far aside it has some."""
        paths, room = self._network.paths, self._rooms()
        body = np.array([length, 2.0 * (self._traffic.needs_m - TOUCH)])
        hits = np.zeros((len(SHARES), *paths.xy.shape[:2]), dtype=np.bool_)
        for prop in standing:
            x, y, psi = prop.pose()
            size = np.array([prop.length, prop.width])
            reach = 0.5 * float(np.hypot(*size) + np.hypot(*body) + length) + TOUCH + float(room.max())
            row, station = np.nonzero(np.hypot(paths.xy[..., 0] - x, paths.xy[..., 1] - y) < reach)
            inside = station * SPACING < paths.length[row]
            row, station = row[inside], station[inside]
            n = len(row)
            if not n:
                continue
            position, heading = _bodies_on_lines(paths, row, station, length)
            left = np.stack([-np.sin(heading), np.cos(heading)], axis=1) * room[row, station, None]
            for k, share in enumerate(SHARES if prop.name in passable else SHARES[:1]):
                gaps = gaps_between(
                    position + share * left, heading, body, np.tile([x, y], (n, 1)), np.full(n, psi), size
                )
                hits[k, row, station] |= gaps < (TOUCH + SPARE if share else TOUCH)
            if prop.name not in passable:
                hits[1:, row, station] |= hits[0, row, station]
        first = hits.argmin(axis=0)
        blocked: Flags = np.logical_and.reduce(hits)
        return blocked, np.where(blocked, 0.0, np.array(SHARES)[first] * room)

    def _rooms(self) -> Array:
        """(P, M) m that an SV may be beside the middle of each row; 0 but on roads of one lane."""
        if self._room is None:
            network, paths = self._network, self._network.paths
            self._room = np.zeros(paths.xy.shape[:2])
            for row, spans in enumerate(paths.spans):
                for name, (begin, end) in spans.items():
                    lane = network.lanes.get(name)
                    if lane is not None and not lane.internal and _is_alone(network, lane):
                        reach = slice(int(np.ceil(begin / SPACING)), int(end / SPACING) + 1)
                        self._room[row, reach] = _room(lane.width, self._traffic)
        return self._room


def _bodies_on_lines(paths: PathTable, rows: Index, stations: Index, length: float) -> tuple[Array, Array]:
    """(N, 2) m and (N,) rad: centres and headings of bodies of that length (m) whose ends are on rows (N,),
    as SUMO moves its vehicles, their middles at stations (N,)."""
    s = stations.astype(np.float64) * SPACING
    front, rear = (np.stack(paths.pose(rows, s + way)[:2], axis=1) for way in (0.5 * length, -0.5 * length))
    along = front - rear
    heading = np.arctan2(along[:, 1], along[:, 0])
    return front - 0.5 * length * np.stack([np.cos(heading), np.sin(heading)], axis=1), heading
