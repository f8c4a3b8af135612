"""Surrounding vehicles (SVs) go round things that block their way for good, or wait where they block nobody.

A row of `network.paths` is blocked for SVs of some length where one of them has no room to pass something
that stands on the road for good (an accident, a closed lane, a stalled vehicle; rudc/world/passing.py). It
may be blocked in several places. An SV whose row is blocked ahead of it

    changes to another lane, if its movement has a row that is free from there on (inside the junction, too);
        it waits before the stop line until it has changed, if no free row begins on its own lane;
    otherwise, if it is before the stop line and its movement is blocked for good, takes another movement from
        its arm that is free;
    otherwise drives on, if its row is free for CHANGE_M m behind the junction and another lane of the road
        there is free: it changes lanes there;
    otherwise, if it is before the stop line, waits there: no SV drives into a junction if the way out of it
        is blocked.

An SV whose row is free stays on it for the last STAY_M m before its stop line, if another row of its movement
is blocked. SUMO knows nothing of what stands inside the junction, and might have it change to that row.

An SV that leads or follows the ego for an event changes lanes only once it is on the road that is blocked,
not already before the junction for something behind the junction, and takes another movement only where none
of this helps, from its own lane. One whose turn an event names (`Driver.keeps_turn`) takes no other movement.

SVs that enter the road choose among the movements that are not blocked for good. What an event takes away
within PATIENT_S does not block for good: SVs wait for it to go.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rudc.arrays import Array
from rudc.network.paths import SPACING
from rudc.world.passing import Passing

if TYPE_CHECKING:
    from rudc.network.network import Movement, Network
    from rudc.network.road import Lane
    from rudc.world.events import WorldStage
    from rudc.world.scene import Scene
    from rudc.world.sumo import Sumo
    from rudc.world.traffic import Traffic

PASSED = 0.5
"""m by which a front bumper may be before a place and still count as past it"""
WAIT = 1.0
"""m before the stop line where an SV waits if no way is free"""
CHANGE_M = 8.0
"""m of free road behind the junction on which an SV can change lanes"""
STAY_M = 10.0
"""m before its stop line on which an SV keeps a row that is free"""
COMFORT = 2.5
"""m/s2: an SV begins to brake for that place once it needs more than this, or, on a slippery road, more than
what is comfortable there"""
PATIENT_S = 15.0
"""s; SVs wait for a thing that stands no longer than this to go, and do not take another way"""
HOLD_S = 2.0
"""s for which SUMO is asked to keep an SV on another lane"""


class Detours:
    """The detours of one episode's SVs."""

    def __init__(self, sumo: Sumo, network: Network, traffic: Traffic) -> None:
        self._sumo, self._network, self._traffic = sumo, network, traffic
        self._passing = Passing(sumo, network, traffic)
        self._seen: tuple[tuple[str, float, float, bool], ...] = ()
        self._begins, self._end, self._end_for_good = self._blocks()
        self.redirected = False
        """whether the last step gave an SV another movement"""

    @property
    def round_something(self) -> bool:
        """Whether something stood on the road at the last step."""
        return bool(self._seen)

    def move_aside(
        self, scene: Scene, stage: WorldStage, decision_s: float, ego: tuple[int, float] | None = None
    ) -> None:
        """Let SVs pass what leaves them room in their lanes; see `Passing.step`."""
        waited_for = {name for name, for_s in stage.for_now.items() if for_s <= PATIENT_S}
        self._passing.look(stage.props, stage.obstructed.passable, waited_for)
        self._passing.step(scene, decision_s, ego)

    def step(self, scene: Scene) -> dict[str, tuple[float, float]]:
        """Redirect SVs; `move_aside` comes first. Returns those that have to wait: name -> (speed in m/s,
        deceleration in m/s2).
        """
        self.redirected = False
        if self._passing.standing != self._seen:
            self._seen = self._passing.standing
            self._begins, self._end, self._end_for_good = self._blocks()
            self._traffic.avoid(self._closed())
        if not self._seen:
            return {}
        waits = {}
        rows = np.flatnonzero(scene.path >= 0)
        front = scene.path_s[rows] + 0.5 * scene.size[rows, 0]
        classes = self._passing.classes(scene.size[rows, 0])
        station = np.floor((front - PASSED - 0.5 * self._passing.lengths[classes]) / SPACING).astype(int) + 1
        block = self._begins[classes, scene.path[rows], np.clip(station, 0, self._begins.shape[2] - 1)]
        ahead = np.isfinite(block)
        for i, c, *places in zip(
            *(part[ahead].tolist() for part in (rows, classes, front, block)), strict=True
        ):
            need = self._redirect(scene, i, self._end[c], self._end_for_good[c], *places)
            if need is not None:
                waits[scene.ids[i]] = need
        to_line = self._network.paths.stop_s[scene.path[rows]] - front
        near = ~ahead & (to_line > 0.0) & (to_line < STAY_M)
        for i, c, at in zip(*(part[near].tolist() for part in (rows, classes, front)), strict=True):
            self._stay(scene, i, self._end[c], at)
        return waits

    def _blocks(self) -> tuple[Array, Array, Array]:
        """Where rows are blocked for each length, as arc lengths (m) of a front bumper.

        (C, P, stations + 1): where the next block begins at or after each station of each row, inf for none.
        (C, P): where the last block of each row ends, -inf for none.
        (C, P): likewise the last that is there for good.
        """
        blocked = self._passing.blocked
        front = np.arange(blocked.shape[2]) * SPACING + 0.5 * self._passing.lengths[:, None, None]
        begins = np.full((*blocked.shape[:2], blocked.shape[2] + 1), np.inf)
        begins[..., :-1] = np.where(np.diff(blocked, axis=2, prepend=False) & blocked, front, np.inf)
        begins = np.minimum.accumulate(begins[..., ::-1], axis=2)[..., ::-1]
        ends = [np.where(b, front, -np.inf).max(axis=2) for b in (blocked, self._passing.blocked_for_good)]
        return begins, *ends

    def _closed(self) -> set[tuple[str, str]]:
        """(origin, destination) of the movements that are blocked for good for the shortest."""
        return {
            (movement.origin, movement.destination)
            for movement in self._network.movements
            if not any(_is_free(self._end_for_good[0], row, -np.inf) for row in movement.rows)
        }

    def _redirect(
        self, scene: Scene, i: int, end: Array, end_for_good: Array, front: float, block: float
    ) -> tuple[float, float] | None:
        """Let an SV change lanes or movements, whose front bumper is at `front` m and whose row is blocked
        from `block` m on. `end`, `end_for_good` (P,) m: where rows are blocked last for it, and last for
        good. Returns (speed in m/s, deceleration in m/s2) if it has to brake to wait, else None.
        """
        network, paths, name = self._network, self._network.paths, scene.ids[i]
        row = int(scene.path[i])
        driver = self._traffic.drivers.get(name)
        if driver is None or driver.overridden or driver.heedless:
            return None
        movement = network.movement(driver.origin, driver.destination)
        before = front < paths.stop_s[row]
        free = [other for other in movement.rows if _is_free(end, other, front)]
        if not before and front < paths.exit_s[row]:
            if free:
                self._move_over(name, row, free[0], front)
            return None
        here = not before or block < paths.stop_s[row]
        if free and driver.keeps_lane and not here:
            return None
        if free:
            own = [other for other in free if network.inbound_lane(other) is network.inbound_lane(row)]
            self._move_over(name, row, (own or free)[0], front)
            if here or own:
                return None
        beside = None if free else self._free_beside(row, end)
        if not before:
            if beside is not None and driver.keeps_lane:  # SUMO lets the others change by themselves
                self._sumo.ask_lane(name, beside.index, HOLD_S)
            return None
        if not free:
            later = beside is not None and block > paths.exit_s[row] + CHANGE_M
            kept = network.inbound_lane(row) if driver.keeps_lane else None
            if later and kept:
                return None
            stays = driver.keeps_turn or any(_is_free(end_for_good, k, front) for k in movement.rows)
            if not stays and self._take_another(name, movement, end, front, kept):
                return None
            if later:
                return None
        room = float(paths.stop_s[row]) - WAIT - front
        speed = float(np.hypot(*scene.velocity[i]))
        need = speed**2 / (2 * max(room, 0.1))
        return (speed, need) if need > self._traffic.comfortable(COMFORT) or room < 0.5 else None

    def _stay(self, scene: Scene, i: int, end: Array, front: float) -> None:
        """Keep an SV whose row is free, its front bumper at `front` m, off blocked rows beside it. `end` (P,)
        m: where rows are blocked last for it."""
        network, name = self._network, scene.ids[i]
        driver = self._traffic.drivers.get(name)
        if driver is None:
            return
        movement = network.movement(driver.origin, driver.destination)
        if not all(_is_free(end, other, front) for other in movement.rows):
            self._sumo.ask_lane(name, network.inbound_lane(int(scene.path[i])).index, HOLD_S)

    def _move_over(self, name: str, row: int, other: int, front: float) -> None:
        """Have an SV take the lane of another row on the edge where it is, if that row has one there."""
        network, ids = self._network, self._network.paths.lane_ids
        here = next((i for i in ids[row] if network.span(row, i)[1] > front), ids[row][-1])
        if here in network.lanes:
            for lane in (network.lanes[i] for i in ids[other] if i in network.lanes):
                if lane.edge == network.lanes[here].edge:
                    self._sumo.ask_lane(name, lane.index, HOLD_S)

    def _free_beside(self, row: int, end: Array) -> Lane | None:
        """A lane beside that on which a row leaves the junction, if nothing blocks it; `end` as above."""
        lane = self._network.outbound_lane(row)
        free = np.flatnonzero(end <= self._network.paths.exit_s)
        lanes = [self._network.outbound_lane(other) for other in free.tolist()]
        return next((other for other in lanes if other.edge == lane.edge and other is not lane), None)

    def _take_another(
        self, name: str, movement: Movement, end: Array, front: float, kept: Lane | None
    ) -> bool:
        """Give the SV another movement from its arm that is free, on the lane that it keeps if it keeps one.
        Returns whether there was one.
        """
        for other in self._network.onward:
            begun = [row for row in other.rows if kept in (None, self._network.inbound_lane(row))]
            free = any(_is_free(end, row, front) for row in begun)
            may_go = self._traffic.may_go(name, other.origin, other.destination)
            if other.origin == movement.origin and free and may_go:
                self._traffic.redirect(name, other.origin, other.destination)
                self.redirected = True
                return True
        return False


def _is_free(end: Array, row: int, front: float) -> bool:
    """Whether nothing blocks a row from `front` m on, given where rows are blocked last (P,) m."""
    return bool(end[row] <= front - PASSED)
