"""A surrounding vehicle (SV) that stands nose to nose with the ego goes back a little.

If two vehicles have stopped in each other's way, each waits for the other. Neither the ego's plant nor SUMO
has a reverse gear, so they would stand for good; real drivers go back. Once the ego has stood for STOOD_S,
an SV that stands in the ego's way goes back along its lane at PACE m/s, if the ego bars its own way, or that
of another SV that stands and bars it. It stops as soon as ROOM m are free between it and the ego's way. From
the junction it does not go back over its stop line, and it keeps CLEAR_M from everybody. Then it waits until
its way is free of the ego, for PATIENCE_S at most. It does so once. Where others stand right behind it, they
go back first, the last of them before all others, if they are QUEUE at most with it.

SUMO has no negative speed, so in the meantime the scene says that it stands.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rudc.arrays import Array, Index
from rudc.geometry import gaps_between, rectangle_gaps
from rudc.network.conflicts import PASSING
from rudc.network.paths import SPACING
from rudc.world.scene import STANDING

if TYPE_CHECKING:
    from rudc.world.scene import Scene
    from rudc.world.sumo import Sumo
    from rudc.world.traffic import Traffic

STOOD_S = 10.0
"""s, s for which the ego must have stood"""
NOSE_M = 3.0
"""m, gap between bodies; an SV that is farther from the ego is not at its nose"""
AHEAD_M = 8.0
"""m of the ego's way, and of the SV's, on which the other must not stand"""
OPPOSITE = 0.7
"""cosine of the angle between the ego's heading and the opposite of an SV's, above which it faces the SV"""
PACE = 0.5
"""m/s, how fast it goes back"""
ROOM = 1.0
"""m that it leaves free between itself and the ego's way"""
CLEAR_M = 0.4
"""m that it leaves between itself and others, unless there is less already"""
QUEUE = 3
"""how many SVs go back at once, at most"""
PATIENCE_S = 20.0
"""s from when it begins to go back until it drives on, whatever the ego does"""


class _Back(NamedTuple):
    """An SV that goes back."""

    row: int
    """of `network.paths`"""
    s: float
    """m along that row where it is"""
    until_s: float
    """s until when it waits"""
    ahead: str
    """name of the SV ahead of it for which it makes room; empty for the one at the ego's nose"""


class BackingOff:
    """The SVs that go back, in one episode."""

    def __init__(self, sumo: Sumo, traffic: Traffic) -> None:
        self._sumo, self._traffic = sumo, traffic
        self._back: dict[str, _Back] = {}
        self._done: set[str] = set()

    def step(self, scene: Scene, decision_s: float) -> None:
        """Move the SVs that go back by one decision of `decision_s` s, and release those that need wait no
        longer."""
        step = PACE * decision_s
        if scene.waited_s >= STOOD_S:
            for i in _at_its_nose(scene).tolist():
                meets = self._may_begin(scene, i) and _in_its_way(scene, i, PASSING)
                if meets and _waits_for_ego(scene, i):
                    first = self._who_first(scene, i, step)
                    if first is not None:
                        self._begin(scene, i, "")
                        self._follow(scene, i, first)
        for name, back in list(self._back.items()):
            i = scene.ids.index(name) if name in scene.ids else -1
            if i < 0 or scene.path[i] != back.row or self._is_over(scene, i, back):
                del self._back[name]
                if i >= 0:
                    self._sumo.slow_down(name, 0.0, decision_s)
                continue
            (x, y), psi = scene.position[i].tolist(), float(scene.heading[i])
            if self._must_move(scene, i, back, step):
                if _may_go_back(scene, i, back.s, step):
                    self._back[name] = back._replace(s=back.s - step)
                    x, y, psi = _place(scene, i, back.s - step)
                elif all(other.ahead != name for other in self._back.values()):
                    self._follow(scene, i, self._who_first(scene, i, step) or [])
            self._sumo.place(name, x, y, psi, 0.0, float(scene.size[i, 0]))

    def _who_first(self, scene: Scene, i: int, step: float) -> list[int] | None:
        """Rows of those right behind the SV of row i who must go back before it can, by `step` m at first,
        the nearest first; None if it cannot."""
        queue = [i]
        while not _may_go_back(scene, queue[-1], self._s(scene, queue[-1]), step):
            behind = _right_behind(scene, queue[-1])
            together = {*self._back, *(scene.ids[k] for k in queue)}
            if behind is None or behind in queue or len(together) >= QUEUE:
                return None
            if not self._may_begin(scene, behind):
                return None
            queue.append(behind)
        return queue[1:]

    def _s(self, scene: Scene, i: int) -> float:
        """m along its way where the SV of row i is. SUMO may say something else of one that goes back."""
        back = self._back.get(scene.ids[i])
        return float(scene.path_s[i]) if back is None else back.s

    def _may_begin(self, scene: Scene, i: int) -> bool:
        driver = self._traffic.drivers.get(scene.ids[i])
        return scene.ids[i] not in self._done and driver is not None and not driver.overridden

    def _follow(self, scene: Scene, i: int, rows: list[int]) -> None:
        """Let those of `rows` make room for the SV of row i, each for the one before it."""
        for ahead, row in pairwise([i, *rows]):
            self._begin(scene, row, scene.ids[ahead])

    def _begin(self, scene: Scene, i: int, ahead: str) -> None:
        until = scene.time_s + PATIENCE_S
        self._back[scene.ids[i]] = _Back(int(scene.path[i]), float(scene.path_s[i]), until, ahead)
        self._done.add(scene.ids[i])

    def _is_over(self, scene: Scene, i: int, back: _Back) -> bool:
        """Whether the SV of row i drives on."""
        if scene.time_s >= back.until_s:
            return True
        return back.ahead not in self._back if back.ahead else not _waits_for_ego(scene, i)

    def _must_move(self, scene: Scene, i: int, back: _Back, step: float) -> bool:
        """Whether the SV of row i must go back farther: the one at the ego's nose until it has left the ego
        room, the others while the one ahead must and cannot go back by `step` m."""
        if not back.ahead:
            return _in_its_way(scene, i, ROOM)
        k, ahead = scene.ids.index(back.ahead), self._back[back.ahead]
        return self._must_move(scene, k, ahead, step) and not _may_go_back(scene, k, ahead.s, step)


def bars(scene: Scene, i: int, ahead_m: float, *, beyond: bool = False) -> bool:
    """Whether the ego stands in the way of the SV of row i of the scene, on the next `ahead_m` m of its lane
    or up to where the junction ends, whichever is nearer; with `beyond`, there too, if the ego faces it.
    """
    ego, body = scene.ego, scene.vehicle
    beyond = beyond and math.cos(scene.heading[i] - ego.psi) < -OPPOSITE
    return _on_its_way(scene, i, ahead_m, (ego.x, ego.y, ego.psi, body.length, body.width), beyond=beyond)


def _on_its_way(scene: Scene, i: int, ahead_m: float, body: Sequence[float], *, beyond: bool = False) -> bool:
    """Whether a body (centre, m; heading, rad; length and width, m) stands in the way of the SV of row i, as
    `bars` has it.
    """
    paths, size, end = scene.network.paths, scene.size[i], ahead_m
    if not beyond:
        end = min(end, float(paths.exit_s[scene.path[i]] + size[0] - scene.path_s[i]))
    s = scene.path_s[i] + np.arange(0.0, max(end, SPACING), SPACING)
    position, heading = paths.body_pose(np.full(len(s), scene.path[i]), s, float(size[0]))
    x, y, psi, length, width = body
    gaps = rectangle_gaps(x, y, psi, length, width, position, heading, np.tile(size, (len(s), 1)))
    return bool(gaps.min() < PASSING)


def _waits_for_ego(scene: Scene, i: int) -> bool:
    """Whether the ego bars the SV of row i, or another SV that stands and bars that one."""
    if bars(scene, i, AHEAD_M, beyond=True):
        return True
    stand = ((scene.path >= 0) & (scene.speed < STANDING)).nonzero()[0]
    return any(
        k != i
        and _on_its_way(scene, i, AHEAD_M, [*scene.position[k], scene.heading[k], *scene.size[k]])
        and bars(scene, k, AHEAD_M, beyond=True)
        for k in stand.tolist()
    )


def _at_its_nose(scene: Scene) -> Index:
    """Rows of the SVs that stand at most NOSE_M from the ego."""
    ego, body = scene.ego, scene.vehicle
    stand = ((scene.path >= 0) & (scene.speed < STANDING)).nonzero()[0]
    gaps = rectangle_gaps(
        ego.x, ego.y, ego.psi, body.length, body.width,
        scene.position[stand], scene.heading[stand], scene.size[stand],
    )  # fmt: skip
    return stand[gaps < NOSE_M]


def _in_its_way(scene: Scene, i: int, gap: float) -> bool:
    """Whether the SV of row i is less than `gap` m beside the ego's way: its route, moved to where the ego
    stands."""
    body, path = scene.vehicle, scene.route.path
    x, y, psi = path.pose(scene.ego_s + np.arange(SPACING, AHEAD_M, SPACING))
    x, y, n = x - scene.ego_offset * np.sin(psi), y + scene.ego_offset * np.cos(psi), len(psi)
    gaps = gaps_between(
        np.stack([x, y], axis=1), psi, np.array([body.length, body.width]),
        np.tile(scene.position[i], (n, 1)), np.full(n, scene.heading[i]), np.tile(scene.size[i], (n, 1)),
    )  # fmt: skip
    return bool(gaps.min() < gap)


def _right_behind(scene: Scene, i: int) -> int | None:
    """Row of the SV that stands where the SV of row i would go back, less than CLEAR_M from it."""
    x, y, psi = _place(scene, i, float(scene.path_s[i]) - CLEAR_M)
    stand = ((scene.path >= 0) & (scene.speed < STANDING)).nonzero()[0]
    stand = stand[stand != i]
    length, width = scene.size[i].tolist()
    gaps = rectangle_gaps(
        x, y, psi, length, width, scene.position[stand], scene.heading[stand], scene.size[stand]
    )
    return int(stand[gaps.argmin()]) if len(stand) and gaps.min() < CLEAR_M else None


def _place(scene: Scene, i: int, s: float) -> tuple[float, float, float]:
    """m, m, rad: centre and heading of the SV of row i at s m on its way."""
    row, length = scene.path[i : i + 1], float(scene.size[i, 0])
    position, heading = scene.network.paths.body_pose(row, np.array([s]), length)
    return float(position[0, 0]), float(position[0, 1]), float(heading[0])


def _may_go_back(scene: Scene, i: int, s: float, step: float) -> bool:
    """Whether the SV of row i, now at s m on its way, may go back by `step` m: it stays on its arm, its front
    does not cross its stop line, and it is nearer to nobody than CLEAR_M or than it is now.
    """
    ego, body, (length, width) = scene.ego, scene.vehicle, scene.size[i].tolist()
    stop_s = scene.network.paths.stop_s[scene.path[i]] - 0.5 * length
    if s - step < stop_s <= s or s - step < 0.5 * length:
        return False
    others = np.arange(scene.count) != i
    position = np.vstack([scene.position[others], (ego.x, ego.y)])
    heading = np.append(scene.heading[others], ego.psi)
    size = np.vstack([scene.size[others], (body.length, body.width)])

    def gaps(x: float, y: float, psi: float) -> Array:
        return rectangle_gaps(x, y, psi, length, width, position, heading, size)

    # In a bend SUMO puts it a few cm beside where its way has it, which may bring it nearer to somebody.
    x, y = scene.position[i].tolist()
    now = gaps(x, y, float(scene.heading[i]))
    least = np.minimum(np.minimum(now, gaps(*_place(scene, i, s))), CLEAR_M)
    then = gaps(*_place(scene, i, s - step))
    return bool(((then >= least) & ((then > 0.0) | (now == 0.0))).all())
