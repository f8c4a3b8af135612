"""Named stretches of lane: what a scenario's lane names mean, and how `at` is counted along each.

    ARM_in_INDEX       an arm's lane towards the junction; `at` outwards from the stop line
    ARM_out_INDEX      an arm's lane away from it; `at` outwards from the junction's exit
    ARM_to_ARM_INDEX   a way through the junction from stop line to exit; `at` from the stop line. Ways from
                       one arm to another are counted from the right, by inbound and then by outbound lane
    ring_ARM_INDEX     a roundabout's ring from where an arm's traffic enters it to where the next arm's
                       does; `at` from there
    SUMO's id          of a lane next to the junction as above; of one inside it, `at` from its beginning
    ego_in, ego_out    the lane on which the ego comes, and the one on which it leaves
    left_of_ego        the next lane to the left of ego_in: of the same direction, else the oncoming one
    right_of_ego       the next lane to the right of ego_in, of the same direction

The last four are known once the ego's route is (where that is random: when the episode is set up).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from rudc.arrays import Array
from rudc.errors import NetworkError
from rudc.network.layout import Layout
from rudc.network.paths import SPACING
from rudc.network.polyline import arc_length
from rudc.network.road import Arm, Lane
from rudc.network.route import ReferencePath, Route

EGO_IN, EGO_OUT, LEFT_OF_EGO, RIGHT_OF_EGO = "ego_in", "ego_out", "left_of_ego", "right_of_ego"
EGO_LANES = (EGO_IN, EGO_OUT, LEFT_OF_EGO, RIGHT_OF_EGO)
"""names of lanes relative to the ego"""
EGO_ARMS = (EGO_IN, EGO_OUT)
"""names of arms relative to the ego: the one it comes from, the one it leaves by"""
PIECE = 0.2
"""rad, change of heading over one straight piece of a bend"""
CLEAR_M = 10.0
"""m from a junction, where its arms have their own direction: at its lines they may bend"""
ALIKE = 0.2
"""rad by which two ways through a junction may turn differently and count as equally straight"""
TOUCHES = 1e-3
"""m, places nearer to each other are one"""
STRAIGHT_M, SHORTEST_M = 0.2, 1.0
"""m, how far a lane may lie off the middle line of a straight piece; m, pieces are not made shorter for
that"""


@dataclass(frozen=True, eq=False)
class Stretch:
    """A stretch of lane on which things can be placed, `at` m from one of its ends."""

    name: str
    """the name by which it was asked for"""
    lane: Lane
    """SUMO's lane; of several in a row, the first"""
    reach: float
    """m, the largest `at`"""
    start: float
    """m, arc length on `line` where `at` is 0"""
    sign: float
    """1 where `at` grows in driving direction, -1 where against it"""
    line: ReferencePath | tuple[Layout, int]
    """the line it lies on, or a row of a network's paths"""
    inside: bool
    """whether it lies inside the junction or on its ring"""

    @property
    def counts_from(self) -> str:
        """Where `at` is 0, in words."""
        if self.inside:
            return "its beginning"
        return "the stop line, outwards" if self.sign < 0 else "the junction's exit"

    def place(
        self, at: float, lateral: float = 0.0, heading_offset: float = 0.0
    ) -> tuple[float, float, float]:
        """x m, y m and heading rad `at` m along, `lateral` m to the left of the centre line.

        Raises NetworkError.
        """
        if not 0.0 <= at <= self.reach:
            end = "its beginning" if self.inside else "the junction"
            raise NetworkError(
                f"{at:g} m from {end} is not on lane {self.name!r}, which has {self.reach:.1f} m"
            )
        s = self.start + self.sign * at
        if isinstance(self.line, ReferencePath):
            pose = self.line.pose(s)
        else:
            network, row = self.line
            pose = network.paths.pose(np.array(row), np.array(s))
        x, y, psi = (float(v) for v in pose)
        return x - lateral * math.sin(psi), y + lateral * math.cos(psi), psi + heading_offset

    def pieces(self, begin: float, end: float) -> int:
        """How many straight pieces of equal length follow its bends between two places (m, as `at`)."""
        _, heading = self._line_at(np.linspace(begin, end, 50))
        number = max(1, math.ceil(float(np.ptp(heading)) / PIECE))
        while (end - begin) / number > SHORTEST_M and self._aside(begin, end, number) > STRAIGHT_M:
            number += 1
        return number

    def _aside(self, begin: float, end: float, number: int) -> float:
        """m, farthest that it lies off the middle line of straight pieces of equal length."""
        cuts = np.linspace(begin, end, number + 1)
        middle, heading = self._line_at(0.5 * (cuts[:-1] + cuts[1:]))
        points, _ = self._line_at(np.linspace(cuts[:-1], cuts[1:], 9))
        away = points - middle
        return float(np.abs(away[..., 1] * np.cos(heading) - away[..., 0] * np.sin(heading)).max())

    def _line_at(self, at: Array) -> tuple[Array, Array]:
        """(..., 2) m and (...) rad, its centre line and its heading `at` m (...) along."""
        s = self.start + self.sign * at
        if isinstance(self.line, ReferencePath):
            x, y, heading = self.line.pose(s)
        else:
            network, row = self.line
            x, y, heading = network.paths.pose(np.full(s.shape, row), s)
        return np.stack([x, y], axis=-1), heading

    def behind(self, at: float) -> Array:
        """(K, 2) m, the way against the driving direction that ends at `at`: from the lane's end, or from the
        end of the way through the junction on which the lane lies."""
        if isinstance(self.line, ReferencePath):
            end = self.line.length
        else:
            network, row = self.line
            end = float(network.paths.length[row])
        here = self.start + self.sign * at
        return self._line_at(self.sign * (np.append(np.arange(end, here, -1.0), here) - self.start))[0]

    def against(self, at: float) -> Array:
        """(K, 2) m, the way from `at` against the driving direction, through the junction where it lies
        behind: to the outer end of an arm, or to the beginning of a lane to which no way through the junction
        leads. Of several ways that lead to a lane the straightest is taken, of these the shortest."""
        x, y, psi = self.place(at)
        here, s = np.array([x, y]), self.start + self.sign * at
        if isinstance(self.line, ReferencePath):
            back = self.lane.xy[arc_length(self.lane.xy) < s - TOUCHES][::-1]
        else:
            network, row = self.line
            if self.sign > 0 and not self.inside:
                row = _straightest(network, self.lane)
                s = float(network.paths.exit_s[row]) + at
            back = network.paths.xy[row, : max(math.ceil((s - TOUCHES) / SPACING), 0)][::-1]
        return np.vstack([here, back if len(back) else here - (math.cos(psi), math.sin(psi))])


def arm_stretches(network: Layout) -> dict[str, Stretch]:
    """The arms' lanes next to the junction, by name."""
    found = {}
    for arm in network.arms:
        for way, lane_ids in (("in", arm.in_lanes), ("out", arm.out_lanes)):
            for lane_id in lane_ids:
                name = f"{arm.name}_{way}_{network.lanes[lane_id].index}"
                found[name] = _on_arm(network, name, network.lanes[lane_id], inbound=way == "in")
    return found


def inner_stretches(network: Layout) -> dict[str, Stretch]:
    """Ways through the junction, and the stretches of a roundabout's ring, by name."""
    found = {}
    for movement in network.movements:
        ordered = sorted(
            movement.rows, key=lambda row: (network.inbound_lane(row).index, network.outbound_lane(row).index)
        )
        for k, row in enumerate(ordered):
            name = f"{movement.origin}_to_{movement.destination}_{k}"
            start, end = float(network.paths.stop_s[row]), float(network.paths.exit_s[row])
            after = list(network.paths.lane_ids[row])
            del after[: after.index(network.inbound_lane(row).id)]  # an arm may have nodes, too
            inside = next((i for i in after if i in network.lanes and network.lanes[i].internal), None)
            if inside is not None:
                found[name] = Stretch(
                    name, network.lanes[inside], end - start, start, 1.0, (network, row), True
                )
    for arm in network.arms:
        found |= _ring_of(network, arm)
    return found


def stretch_by_id(network: Layout, lane_id: str) -> Stretch:
    """The stretch of a lane that SUMO's id names. Raises NetworkError if it is not next to the junction."""
    lane = network.lanes[lane_id]
    for arm in network.arms:
        if lane_id in (*arm.in_lanes, *arm.out_lanes):
            return _on_arm(network, lane_id, lane, inbound=lane_id in arm.in_lanes)
    if not lane.internal and lane.edge not in network.ring_edges:
        raise NetworkError(
            f"lane {lane_id!r} of network {network.name} is not next to the junction{_nearer(network, lane)}"
        )
    rows = [row for row, lanes in enumerate(network.paths.lane_ids) if lane_id in lanes]
    if not rows:  # a lane of a ring into which nobody turns
        line = ReferencePath(lane.xy)
        return Stretch(lane_id, lane, line.length, 0.0, 1.0, line, True)
    row = min(rows, key=lambda row: network.paths.lane_ids[row].index(lane_id))
    start, end = network.span(row, lane_id)
    return Stretch(lane_id, lane, end - start, start, 1.0, (network, row), True)


def _nearer(network: Layout, lane: Lane) -> str:
    """A hint for a lane farther out on an arm: the lanes at the junction whose `at` reaches there."""
    for arm in network.arms:
        if lane.edge in (*arm.in_edges, *arm.out_edges):
            lanes = arm.in_lanes if lane.edge in arm.in_edges else arm.out_lanes
            return f"; name one of {', '.join(lanes)}, whose `at` counts on to the end of arm {arm.name}"
    return ""


def lane_of_ego(network: Layout, name: str, route: Route) -> Lane:
    """The lane that a name relative to the ego means on its route. Raises NetworkError if there is none."""
    own = network.inbound_lane(route.row)
    if name == EGO_IN:
        return own
    if name == EGO_OUT:
        return network.outbound_lane(route.row)
    arm = network.arm(route.origin)
    place = arm.in_lanes.index(own.id)
    if name == LEFT_OF_EGO:
        beside = (*arm.in_lanes, *reversed(arm.out_lanes))[place + 1 :]
    else:
        beside = arm.in_lanes[:place][::-1]
    if not beside:
        side = "left" if name == LEFT_OF_EGO else "right"
        raise NetworkError(
            f"{name}: on the way from {route.origin} to {route.destination} the ego comes on lane "
            f"{own.id!r} of network {network.name}, which has no lane to its {side}"
        )
    return network.lanes[beside[0]]


def _on_arm(network: Layout, name: str, lane: Lane, *, inbound: bool) -> Stretch:
    end = network.inbound_lane if inbound else network.outbound_lane
    row = next((row for row in range(network.paths.count) if end(row) is lane), None)
    sign = -1.0 if inbound else 1.0
    if row is None:
        line = ReferencePath(lane.xy)
        return Stretch(name, lane, line.length, line.length if inbound else 0.0, sign, line, False)
    paths = network.paths
    start = float((paths.stop_s if inbound else paths.exit_s)[row])
    reach = start if inbound else float(paths.length[row]) - start
    return Stretch(name, lane, reach, start, sign, (network, row), False)


def _straightest(network: Layout, lane: Lane) -> int:
    """The row of `paths` that turns least on its way through the junction to an arm's lane away from it; of
    several the shortest."""
    paths = network.paths
    rows = [row for row in range(paths.count) if network.outbound_lane(row) is lane]
    ends = (
        (paths.exit_s[rows] + CLEAR_M).clip(0.0, paths.length[rows]),
        (paths.stop_s[rows] - CLEAR_M).clip(0.0),
    )
    turns = np.subtract(*(paths.pose(np.array(rows), s)[2] for s in ends))
    turns = np.abs((turns + math.pi) % (2 * math.pi) - math.pi)
    near = [row for row, turn in zip(rows, turns, strict=True) if turn < turns.min() + ALIKE]
    return min(near, key=lambda row: float(paths.length[row]))


def _ring_of(network: Layout, arm: Arm) -> dict[str, Stretch]:
    """Stretches of the ring that begin where the arm's traffic enters it, one for each lane there."""
    first: dict[str, int] = {}
    entered: set[str] = set()
    longest = sorted(range(network.paths.count), key=lambda row: -float(network.paths.length[row]))
    for row in longest:
        lane_id = next((i for i in network.paths.lane_ids[row] if _edge(i) in network.ring_edges), None)
        if lane_id is None:
            continue
        if network.arms[int(network.paths.origin[row])] is arm:
            first.setdefault(lane_id, row)
        else:
            entered.add(_edge(lane_id))
    entries = {_edge(lane_id) for lane_id in first}
    beside = {i for ids in network.paths.lane_ids for i in ids if _edge(i) in entries} - first.keys()
    for lane_id in sorted(beside):  # nobody enters on it: the way that goes on round the ring farthest
        rounds = [_ring_lanes_from(network, row, lane_id) for row in longest]
        first[lane_id] = longest[rounds.index(max(rounds))]
    found = {}
    for lane_id, row in first.items():
        start, _ = network.span(row, lane_id)
        lanes = network.paths.lane_ids[row]
        after = lanes[lanes.index(lane_id) + 1 :]
        end_lane = next((i for i in after if _edge(i) in entered - {_edge(lane_id)}), None)
        end = float(network.paths.exit_s[row]) if end_lane is None else network.span(row, end_lane)[0]
        lane = network.lanes[lane_id]
        name = f"ring_{arm.name}_{lane.index}"
        found[name] = Stretch(name, lane, end - start, start, 1.0, (network, row), True)
    return found


def ring_past(network: Layout, arm: Arm) -> list[str]:
    """The stretches of the ring, by name, that go on past where an arm leads away from it, each with the `at`
    from which it does."""
    found = dict[str, None]()
    leads_away = [lanes for row, lanes in enumerate(network.paths.lane_ids) if _leads_to(network, row, arm)]
    before = {[i for i in lanes if _edge(i) in network.ring_edges][-1] for lanes in leads_away}
    for name, stretch in inner_stretches(network).items():
        if name.startswith("ring_") and not isinstance(stretch.line, ReferencePath):
            _, row = stretch.line
            ring = [i for i in network.paths.lane_ids[row] if _edge(i) in network.ring_edges]
            for lane_id, after in pairwise(ring):
                at = network.span(row, after)[0] - stretch.start
                if lane_id in before and 0.0 < at < stretch.reach:
                    found[f"{name} from `at: {at:.0f}` on"] = None
    return list(found)


def _leads_to(network: Layout, row: int, arm: Arm) -> bool:
    """Whether a row of `paths` leads over the ring to an arm."""
    on_ring = any(_edge(lane) in network.ring_edges for lane in network.paths.lane_ids[row])
    return on_ring and network.arms[int(network.paths.destination[row])] is arm


def _edge(lane_id: str) -> str:
    return lane_id.rpartition("_")[0]


def _ring_lanes_from(network: Layout, row: int, lane_id: str) -> int:
    """How many of the ring's lanes a row of `paths` leads over from one of them on."""
    lanes = network.paths.lane_ids[row]
    onwards = lanes[lanes.index(lane_id) :] if lane_id in lanes else ()
    return sum(_edge(lane) in network.ring_edges for lane in onwards)
