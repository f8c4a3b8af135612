"""What blocks the way for good: bodies that stand and go nowhere, who queues behind them, who comes the
wrong way.

    at once      what stands and has no way through the junction: accident vehicles, closed lanes
    in time      a vehicle that has stood for PATIENCE s with nobody before it, or somebody who blocks; before
                 its stop line and in the junction, where one waits for others, only once it has let IDLE s
                 in all go by since, in which nobody came whom it lets pass, or has stood for LONG s;
                 in the junction, after IMPASSE s, one before whom the ego stands: each waits for the other
    ahead        who drives against the ego's line without a way of its own, as far along the road as it
                 gets in LANE_S s

An ordinary queue is none of these. Pedestrians never are: they walk on.
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from rudc.agents.standing import Standing
from rudc.arrays import Array, Flags, Index
from rudc.geometry import Rectangles, rectangle_gaps
from rudc.world.scene import STILL, Kind, Scene

PATIENCE = 6.0
"""s"""
QUEUE = 10.0
"""m between bumpers up to which one who stands waits for the one before it"""
BESIDE = 2.0
"""m to each side within which another is before it"""
BEFORE_STOP = 15.0
"""m before a stop line from where vehicles wait for others"""
STEP_S = 0.2
"""s, most that counts between two looks"""
LANE_S, SOON_S = 12.0, 6.0
"""s"""
AGAINST = -0.5
"""cosine of the angle to the ego's line from which on somebody drives against it"""
IDLE, LONG = 4.0, 12.0
"""s, s"""
IMPASSE = 3.0
"""s, for which both have stood"""
FACING, MEETS = 6.0, 0.3
"""m of its way on which the ego may stand, m of gap below which it does"""
COMING_S, COMING = 5.0, 10.0
"""s and m before the junction from where on somebody is waited for, whichever is farther"""
ALONG, PIECE = 0.35, 4.0
"""rad, angle to the line up to which one who drives against it is taken to follow its bends; m, length of a
piece of the lane that it takes"""
MEETING_S, PACE = 4.0, 4.0
"""s between the ego at a place and one who comes the wrong way there; m/s, speed that the ego is taken to
have at least"""
FAR_BESIDE = 8.0
"""m from the ego's line beyond which nobody is on its road"""


class Blocks(NamedTuple):
    """What blocks at one instant."""

    standing: Rectangles
    """bodies that stand"""
    coming: Rectangles
    """where those who drive the wrong way will be within LANE_S: that lane is theirs"""
    soon: Rectangles
    """where they will be within SOON_S: what they cross on their way is not to be entered"""
    later: Rectangles
    """where they will be within LANE_S, straight on: who waits for them does so beside that"""
    resting: Rectangles
    """vehicles that stand on their way, for whatever reason"""

    @property
    def any(self) -> bool:
        """Whether there is anything."""
        return bool(self.standing.number or self.coming.number)


_NOBODY = Rectangles(np.zeros((0, 2)), np.zeros(0), np.zeros((0, 2)))
NOTHING = Blocks(_NOBODY, _NOBODY, _NOBODY, _NOBODY, _NOBODY)


class Blocking:
    """Watches one episode."""

    def __init__(self) -> None:
        self._standing = Standing()
        self._since: dict[str, float] = {}
        self._idle: dict[str, float] = {}
        self._seen_s = -math.inf

    def look(self, scene: Scene) -> Blocks:
        """What blocks now; called once a decision."""
        scene = self._standing.look(scene)
        speed = np.hypot(scene.velocity[:, 0], scene.velocity[:, 1])
        still = speed < STILL
        self._since = {
            name: self._since.get(name, scene.time_s)
            for name, stands in zip(scene.ids, still.tolist(), strict=True)
            if stands
        }
        without_way = (scene.path < 0) & (scene.kind != Kind.PEDESTRIAN)
        if not (self._since or without_way.any()):
            return NOTHING
        stuck = still & (without_way | self._stuck(scene, still, without_way) | self._facing(scene))
        stray = np.array(
            [i for i in np.flatnonzero(without_way & ~still).tolist() if _against(scene, i)], dtype=np.int64
        )
        return Blocks(
            _bodies(scene, stuck),
            _lane_taken(scene, stray, speed[stray]),
            _swept(scene, stray, speed[stray] * SOON_S),
            _swept(scene, stray, speed[stray] * LANE_S),
            _bodies(scene, still & (scene.path >= 0)),
        )

    def _stuck(self, scene: Scene, still: Flags, without_way: Flags) -> Flags:
        """(N,) whether vehicles on their way have stood too long for no reason, or behind one that has."""
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
        """(N,) who in the junction has stood for IMPASSE s, as the ego has, which stands on its way."""
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

    def _idlers(self, scene: Scene, who: Index) -> Index:
        """Those of the others `who` (n,), who stand where one waits, that have waited for nobody for IDLE s,
        or too long.
        """
        passed, self._seen_s = min(scene.time_s - self._seen_s, STEP_S), scene.time_s
        idle = {i: 0.0 if _lets_pass(scene, i) else passed for i in who.tolist()}
        self._idle = {scene.ids[i]: self._idle.get(scene.ids[i], 0.0) + more for i, more in idle.items()}
        vain = [
            i for i in idle
            if self._idle[scene.ids[i]] > IDLE or scene.time_s - self._since[scene.ids[i]] > LONG
        ]  # fmt: skip
        return np.array(vain, dtype=np.int64)


def _stands_before(scene: Scene, i: int) -> bool:
    """Whether the ego stands on the way of the vehicle i."""
    ego, body, paths = scene.ego, scene.vehicle, scene.network.paths
    s = scene.path_s[i] + np.arange(0.0, FACING, 0.5)
    x, y, psi = paths.pose(np.full(len(s), scene.path[i]), s)
    size = np.broadcast_to(scene.size[i], (len(s), 2))
    gaps = rectangle_gaps(ego.x, ego.y, ego.psi, body.length, body.width, np.stack([x, y], axis=1), psi, size)
    return bool((gaps < MEETS).any())


def _lets_pass(scene: Scene, i: int) -> bool:
    """Whether somebody comes, or the ego, whom the vehicle i has to let pass."""
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
    return Rectangles(scene.position[who], scene.heading[who], scene.size[who])


def _swept(scene: Scene, who: Index, way: Array) -> Rectangles:
    """What others sweep over on a straight way (n,) m."""
    if not len(who):
        return _NOBODY
    course = np.stack([np.cos(scene.heading[who]), np.sin(scene.heading[who])], axis=1)
    return Rectangles(
        scene.position[who] + 0.5 * way[:, None] * course,
        scene.heading[who],
        scene.size[who] + way[:, None] * (1.0, 0.0),
    )


def _lane_taken(scene: Scene, who: Index, speed: Array) -> Rectangles:
    """What others who drive against the ego's line at (n,) m/s sweep over in LANE_S: a lane as far beside it
    as they are now, in pieces that follow its bends; straight on where they head elsewhere.

    Where they drive on the same stretch of road as the ego, that lane ends at the place which they reach
    MEETING_S after the ego: what lies nearer to the ego it has passed by then.
    """
    path, route, here = scene.route.path, scene.route, scene.ego_s
    beyond, pace = here + 0.5 * scene.vehicle.length > route.exit_s, max(scene.ego.v, PACE)
    pieces: list[tuple[float, float, float, float, float]] = []
    ahead = list[int]()
    for k, i in enumerate(who.tolist()):
        s, offset = path.project(*scene.position[i].tolist())
        turned = float(scene.heading[i]) - float(path.pose(s)[2]) + math.pi
        if abs(math.remainder(turned, 2 * math.pi)) > ALONG:
            ahead.append(k)
            continue
        theirs = float(speed[k])
        last = max(s - theirs * LANE_S, route.exit_s if s > route.exit_s else 0.0)
        if beyond or s <= route.exit_s:  # (s - meeting) / theirs = (meeting - here) / pace + MEETING_S
            meeting = (s * pace + here * theirs - MEETING_S * theirs * pace) / (pace + theirs)
            last = max(last, meeting)
        cuts = np.linspace(s, min(last, s), max(math.ceil((s - last) / PIECE), 1) + 1)
        length, width = scene.size[i].tolist()
        for near, far in pairwise(cuts.tolist()):
            x, y, psi = (float(v) for v in path.pose(0.5 * (near + far)))
            at = x - offset * math.sin(psi), y + offset * math.cos(psi)
            pieces.append((*at, psi, length + near - far, width))
    straight = _swept(scene, who[ahead], speed[ahead] * LANE_S)
    if not pieces:
        return straight
    table = np.array(pieces)
    return Rectangles(
        np.concatenate([straight.position, table[:, :2]]),
        np.concatenate([straight.heading, table[:, 2]]),
        np.concatenate([straight.size, table[:, 3:]]),
    )


def _before(scene: Scene, i: int) -> Flags:
    """(N,) who is before the vehicle i, near enough to wait for."""
    cos, sin = math.cos(scene.heading[i]), math.sin(scene.heading[i])
    away: Array = scene.position - scene.position[i]
    along, across = away[:, 0] * cos + away[:, 1] * sin, away[:, 1] * cos - away[:, 0] * sin
    near = along < QUEUE + 0.5 * (scene.size[i, 0] + scene.size[:, 0])
    return (along > 0.5) & near & (np.abs(across) < BESIDE)


def _against(scene: Scene, i: int) -> bool:
    """Whether somebody ahead on the ego's road drives against its line."""
    path = scene.route.path
    s, offset = path.project(*scene.position[i].tolist())
    if not scene.ego_s < s < path.length or abs(offset) > FAR_BESIDE:
        return False
    return math.cos(float(scene.heading[i]) - float(path.pose(s)[2])) < AGAINST
