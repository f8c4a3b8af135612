"""What blocks the way for good: bodies that stand and will not move, vehicles that queue behind them or wait
in the ego's path, and vehicles that come the wrong way.

    at once      Whatever stands and is on no path through the junction: accident vehicles, closed lanes
    in time      A vehicle on a path that has stood for PATIENCE s, with nobody before it or with somebody
                 before it who blocks. Near its stop line and in the junction, vehicles wait for others: there
                 it blocks only if, besides, for IDLE s in all nobody came whom it has to let pass, or if it
                 has stood for LONG s
    facing       A vehicle in the junction that has stood for IMPASSE s with the ego standing in its way: each
                 waits for the other
    reaching in  A vehicle that stands at its stop line on another arm and reaches into the ego's path: it may
                 wait for the ego, and then waiting for it is in vain
    coming       Whoever drives against the ego's line and is on no path (coming.py)

Vehicles in an ordinary queue do not block, and pedestrians never do: they walk on.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from rudc.agents.coming import LANE_S, NOBODY, Lanes, lanes_of, strays, swept
from rudc.agents.kernels import all_have_ways
from rudc.agents.standing import Standing
from rudc.arrays import Array, Flags, Index
from rudc.env.remembered import Remembered
from rudc.geometry import NO_RECTANGLES, Rectangles, rectangle_gaps
from rudc.network.course import gaps_along
from rudc.network.route import Route
from rudc.world.scene import STILL, Kind, Scene
from rudc.world.vehicle_types import VEHICLE_TYPES

PATIENCE = 6.0
"""s, how long a vehicle must have stood to count as blocking"""
QUEUE = 10.0
"""m between bumpers up to which a standing vehicle waits for the one before it"""
BESIDE = 2.0
"""m to each side within which another vehicle counts as before it"""
PIECE = 1.0
"""m, steps in which a path is followed to whoever is before a vehicle on it"""
BEFORE_STOP = 15.0
"""m before a stop line from which on vehicles wait for others"""
STEP_S = 0.2
"""s, time that is counted at most when a vehicle is looked at; a decision, if that is longer"""
SOON_S = 6.0
"""s, how far ahead the ground is predicted that somebody who comes the wrong way will cross"""
IDLE, LONG = 4.0, 12.0
"""s, s: how long a vehicle that waits must have waited for nobody, or must have stood, to count as
blocking"""
IMPASSE = 3.0
"""s, for which both the ego and the other must have stood"""
FACING, MEETS = 6.0, 0.3
"""m, m: the ego stands in a vehicle's way if it is nearer than the second to the next metres of it (the
first)"""
AT_LINE, AT_LINE_S = 2.0, 1.0
"""m, s: a vehicle waits at its stop line if its front is nearer to the line than the first, and it has stood
for the second"""
COMING_S, COMING = 5.0, 10.0
"""s, m: a vehicle waits for those who are nearer to the junction than this, whichever is farther"""
WIDEST = np.array(
    [max(kind.length for kind in VEHICLE_TYPES.values()), max(kind.width for kind in VEHICLE_TYPES.values())]
)
"""m, m: the longest and widest vehicle"""
PEDESTRIAN = int(Kind.PEDESTRIAN)
"""a plain number, which numpy compares ten times as fast"""


class Blocks(NamedTuple):
    """What blocks at one instant."""

    standing: Rectangles
    """bodies that stand and block"""
    coming: Lanes
    """lanes of those who come the wrong way"""
    soon: Rectangles
    """where these will be within SOON_S, straight on: the ego must not enter what they cross"""
    later: Rectangles
    """where these will be within LANE_S, straight on: an ego that waits for them waits beside it"""
    resting: Rectangles
    """vehicles on a path that stand, for whatever reason"""
    strays: frozenset[str]
    """names of those who come the wrong way"""

    @property
    def any(self) -> bool:
        """Whether anything blocks."""
        return bool(self.standing.number or self.coming.outside.number)


_rows: Remembered[Route, Flags] = Remembered()
"""`_rows_reaching_in` of each route"""
NOTHING = Blocks(NO_RECTANGLES, NOBODY, NO_RECTANGLES, NO_RECTANGLES, NO_RECTANGLES, frozenset())


class Blocking:
    """Finds what blocks, decision by decision, in one episode."""

    def __init__(self) -> None:
        self._standing = Standing()
        self._since: dict[str, float] = {}
        self._idle: dict[str, float] = {}
        self._seen_s, self._looked_s, self._decision_s = -math.inf, math.inf, 0.0

    def look(self, scene: Scene) -> Blocks:
        """What blocks now; call it once for each decision."""
        self._decision_s, self._looked_s = scene.time_s - self._looked_s, scene.time_s
        seen, scene = scene, self._standing.look(scene)
        if scene is seen and all_have_ways(scene.path, scene.kind, PEDESTRIAN):  # nobody stands
            self._since = {}
            return NOTHING
        speed = scene.speed
        still = speed < STILL
        self._since = {
            name: self._since.get(name, scene.time_s)
            for name, stands in zip(scene.ids, still.tolist(), strict=True)
            if stands
        }
        without_way = (scene.path < 0) & (scene.kind != PEDESTRIAN)
        if not (self._since or without_way.any()):
            return NOTHING
        stuck = without_way | self._stuck(scene, still, without_way) | self._facing(scene)
        stuck = still & (stuck | self._reaching_in(scene))
        stray = strays(scene, without_way & ~still)
        return Blocks(
            _bodies(scene, stuck),
            lanes_of(scene, stray, speed[stray]),
            swept(scene, stray, speed[stray] * SOON_S),
            swept(scene, stray, speed[stray] * LANE_S),
            _bodies(scene, still & (scene.path >= 0)),
            frozenset(scene.ids[i] for i in stray.tolist()),
        )

    def _stuck(self, scene: Scene, still: Flags, without_way: Flags) -> Flags:
        """(N,) whether each vehicle on a path has stood too long for no reason, or behind one that blocks."""
        paths, stuck = scene.network.paths, still & without_way
        if not stuck.any() and scene.time_s - min(self._since.values(), default=math.inf) <= PATIENCE:
            return stuck
        patient = np.array(
            [scene.time_s - self._since.get(name, math.inf) > PATIENCE for name in scene.ids], dtype=bool
        )
        front = scene.path_s + 0.5 * scene.size[:, 0]
        waits = (front > paths.stop_s[scene.path] - BEFORE_STOP) & (front < paths.exit_s[scene.path])
        patient &= still & ~without_way & (scene.path >= 0)
        waits[self._idlers(scene, np.flatnonzero(patient & waits))] = False
        candidates = np.flatnonzero(patient & ~waits)
        before = {int(i): np.flatnonzero(_before(scene, int(i))) for i in candidates}
        for _ in candidates:  # a queue is as long as that at most
            new = [
                i for i, others in before.items() if not stuck[i] and (not len(others) or stuck[others].any())
            ]
            if not new:
                break
            stuck[new] = True
        return stuck

    def _facing(self, scene: Scene) -> Flags:
        """(N,) whether each vehicle in the junction, from another arm than the ego's, has stood for
        IMPASSE s, and the ego too, in its way.
        """
        paths, found = scene.network.paths, np.zeros(scene.count, dtype=np.bool_)
        if scene.waited_s < IMPASSE:
            return found
        front = scene.path_s + 0.5 * scene.size[:, 0]
        inside = (front > paths.stop_s[scene.path] + 1.0) & (front < paths.exit_s[scene.path])
        inside &= (scene.path >= 0) & (paths.origin[scene.path] != paths.origin[scene.route.row])
        for i in np.flatnonzero(inside).tolist():
            if scene.time_s - self._since.get(scene.ids[i], math.inf) > IMPASSE:
                found[i] = _stands_before(scene, i)
        return found

    def _reaching_in(self, scene: Scene) -> Flags:
        """(N,) whether each vehicle has stood at its stop line, on another arm than the ego's, for AT_LINE_S,
        and reaches into the ego's path.
        """
        paths, found = scene.network.paths, np.zeros(scene.count, dtype=np.bool_)
        rows = _rows.get(scene.route, lambda: _rows_reaching_in(scene))
        if not rows.any():
            return found
        beyond = scene.path_s + 0.5 * scene.size[:, 0] - paths.stop_s[scene.path]
        waits = (scene.path >= 0) & rows[scene.path] & (np.abs(beyond) < AT_LINE)
        for i in np.flatnonzero(waits).tolist():
            if scene.time_s - self._since.get(scene.ids[i], math.inf) > AT_LINE_S:
                one = Rectangles(scene.position[i : i + 1], scene.heading[i : i + 1], scene.size[i : i + 1])
                end = scene.destination_s
                _, gap = gaps_along(scene.route.path, scene.ego_s, end, scene.vehicle, one)
                found[i] = gap.min(initial=np.inf) <= 0.0
        return found

    def _idlers(self, scene: Scene, who: Index) -> Index:
        """Those of the others `who` (n,), which stand where vehicles wait, that have waited for nobody
        for IDLE s in all, or have stood for LONG s.
        """
        most = max(STEP_S, self._decision_s)
        passed, self._seen_s = min(max(scene.time_s - self._seen_s, 0.0), most), scene.time_s
        idle = {i: 0.0 if _lets_pass(scene, i) else passed for i in who.tolist()}
        self._idle = {scene.ids[i]: self._idle.get(scene.ids[i], 0.0) + more for i, more in idle.items()}
        vain = [
            i for i in idle
            if self._idle[scene.ids[i]] > IDLE or scene.time_s - self._since[scene.ids[i]] > LONG
        ]  # fmt: skip
        return np.array(vain, dtype=np.int64)


def _rows_reaching_in(scene: Scene) -> Flags:
    """(P,) the rows from other arms on which the widest vehicle, at its stop line or AT_LINE m before or
    beyond it, reaches into the ego's path.
    """
    paths, route = scene.network.paths, scene.route
    found = np.zeros(paths.count, dtype=np.bool_)
    for row in np.flatnonzero(paths.origin != paths.origin[route.row]).tolist():
        x, y, psi = paths.pose(np.array([row]), paths.stop_s[row] - 0.5 * WIDEST[:1])
        place = Rectangles(np.column_stack([x, y]), psi, WIDEST[None] + (2 * AT_LINE, 0.0))
        gap = gaps_along(route.path, 0.0, route.path.length, scene.vehicle, place)[1]
        found[row] = gap.min(initial=np.inf) <= 0.0
    return found


def _stands_before(scene: Scene, i: int) -> bool:
    """Whether the ego is in the way of the vehicle i."""
    ego, body, paths = scene.ego, scene.vehicle, scene.network.paths
    s = scene.path_s[i] + np.arange(0.0, FACING, 0.5)
    x, y, psi = paths.pose(np.full(len(s), scene.path[i]), s)
    size = np.broadcast_to(scene.size[i], (len(s), 2))
    gaps = rectangle_gaps(ego.x, ego.y, ego.psi, body.length, body.width, np.stack([x, y], axis=1), psi, size)
    return bool((gaps < MEETS).any())


def _lets_pass(scene: Scene, i: int) -> bool:
    """Whether the ego, or another vehicle, comes that the vehicle i has to let pass."""
    paths, row, route = scene.network.paths, scene.path[i], scene.route
    if paths.yields[row, route.row] and scene.ego_s < route.exit_s and scene.waited_s < PATIENCE:
        return True
    driven = np.flatnonzero(scene.path >= 0)
    rows, s = scene.path[driven], scene.path_s[driven]
    speed = np.hypot(scene.velocity[driven, 0], scene.velocity[driven, 1])
    near = (s > paths.stop_s[rows] - np.maximum(COMING_S * speed, COMING)) & (
        s - 0.5 * scene.size[driven, 0] < paths.exit_s[rows]
    )
    return bool((near & paths.yields[row, rows]).any())


def _bodies(scene: Scene, who: Flags) -> Rectangles:
    if not who.any():
        return NO_RECTANGLES
    return Rectangles(scene.position[who], scene.heading[who], scene.size[who])


def _before(scene: Scene, i: int) -> Flags:
    """(N,) whether each other is before the vehicle i, which is on a path: straight on or along that path,
    and near enough to wait for.
    """
    away = scene.position - scene.position[i]
    apart = QUEUE + 0.5 * (scene.size[i, 0] + scene.size[:, 0])
    along, across = _turned(away, scene.heading[i])
    straight = (along > 0.5) & (along < apart) & (np.abs(across) < BESIDE)
    way = np.arange(PIECE, apart.max(), PIECE)[:, None]
    x, y, psi = scene.network.paths.pose(np.full(way.shape, scene.path[i]), scene.path_s[i] + way)
    along, across = _turned(scene.position - np.stack([x, y], axis=2), psi)
    found = straight | ((np.abs(along) < PIECE) & (np.abs(across) < BESIDE) & (way < apart)).any(axis=0)
    found[i] = False
    return found


def _turned(away: Array, heading: Array) -> tuple[Array, Array]:
    """m along `heading` (...) rad and m to its left, of `away` (..., N, 2) m."""
    cos, sin = np.cos(heading), np.sin(heading)
    return away[..., 0] * cos + away[..., 1] * sin, away[..., 1] * cos - away[..., 0] * sin
