"""A surrounding vehicle (SV) that stands nose to nose with the ego goes back a little.

If two vehicles have stopped in each other's way, each waits for the other. Neither the ego's plant nor SUMO
has a reverse gear, so they would stand for good; real drivers go back. Once the ego has stood for STOOD_S,
an SV that stands in the ego's way, and whose own way the ego bars, goes back along its lane at PACE m/s. It
stops as soon as ROOM m are free between it and the ego's way. From the junction it does not go back over its
stop line, and it keeps CLEAR_M from everybody. Then it waits until the ego has left its way, for PATIENCE_S
at most. It does so once.

SUMO has no negative speed, so in the meantime the scene says that it stands.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

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
PATIENCE_S = 20.0
"""s from when it begins to go back until it drives on, whatever the ego does"""


class BackingOff:
    """The SVs that go back, in one episode."""

    def __init__(self, sumo: Sumo, traffic: Traffic) -> None:
        self._sumo, self._traffic = sumo, traffic
        self._back: dict[str, tuple[int, float, float]] = {}
        """name -> its row, m along it where it is, and s until when it waits"""
        self._done: set[str] = set()

    def step(self, scene: Scene, decision_s: float) -> None:
        """Move the SVs that go back by one decision of `decision_s` s, and release those that need wait no
        longer."""
        if scene.waited_s >= STOOD_S:
            for i in _at_its_nose(scene).tolist():
                s = float(scene.path_s[i])
                if self._should_back(scene, i) and _may_be_at(scene, i, s - PACE * decision_s):
                    self._done.add(scene.ids[i])
                    self._back[scene.ids[i]] = int(scene.path[i]), s, scene.time_s + PATIENCE_S
        for name, (row, s, until) in list(self._back.items()):
            i = scene.ids.index(name) if name in scene.ids else -1
            if (
                i < 0
                or scene.path[i] != row
                or scene.time_s >= until
                or not bars(scene, i, AHEAD_M, beyond=True)
            ):
                del self._back[name]
                if i >= 0:
                    self._sumo.slow_down(name, 0.0, decision_s)
                continue
            if _in_its_way(scene, i, ROOM) and _may_be_at(scene, i, s - PACE * decision_s):
                s -= PACE * decision_s
                self._back[name] = row, s, until
                x, y, psi = _place(scene, i, s)
            else:
                (x, y), psi = scene.position[i].tolist(), float(scene.heading[i])
            self._sumo.place(name, x, y, psi, 0.0, float(scene.size[i, 0]))

    def _should_back(self, scene: Scene, i: int) -> bool:
        """Whether the SV of row i, which stands at the ego's nose, should go back."""
        name = scene.ids[i]
        driver = self._traffic.drivers.get(name)
        if name in self._done or driver is None or driver.overridden:
            return False
        return _in_its_way(scene, i, PASSING) and bars(scene, i, AHEAD_M, beyond=True)


def bars(scene: Scene, i: int, ahead_m: float, *, beyond: bool = False) -> bool:
    """Whether the ego stands in the way of the SV of row i of the scene, on the next `ahead_m` m of its lane
    or up to where the junction ends, whichever is nearer; with `beyond`, there too, if the ego faces it.
    """
    paths, ego, size = scene.network.paths, scene.ego, scene.size[i]
    end = ahead_m
    if not (beyond and math.cos(scene.heading[i] - ego.psi) < -OPPOSITE):
        end = min(end, float(paths.exit_s[scene.path[i]] + size[0] - scene.path_s[i]))
    s = scene.path_s[i] + np.arange(0.0, max(end, SPACING), SPACING)
    position, heading = paths.body_pose(np.full(len(s), scene.path[i]), s, float(size[0]))
    gaps = rectangle_gaps(
        ego.x, ego.y, ego.psi, scene.vehicle.length, scene.vehicle.width,
        position, heading, np.tile(size, (len(s), 1)),
    )  # fmt: skip
    return bool(gaps.min() < PASSING)


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


def _place(scene: Scene, i: int, s: float) -> tuple[float, float, float]:
    """m, m, rad: centre and heading of the SV of row i at s m on its way."""
    row, length = scene.path[i : i + 1], float(scene.size[i, 0])
    position, heading = scene.network.paths.body_pose(row, np.array([s]), length)
    return float(position[0, 0]), float(position[0, 1]), float(heading[0])


def _may_be_at(scene: Scene, i: int, s: float) -> bool:
    """Whether the SV of row i may go back to s m on its way: it stays on its arm, its front does not cross
    its stop line, and it is nearer to nobody than CLEAR_M or than it is now."""
    ego, body, (length, width) = scene.ego, scene.vehicle, scene.size[i].tolist()
    stop_s = scene.network.paths.stop_s[scene.path[i]] - 0.5 * length
    if s < stop_s <= scene.path_s[i] or s < 0.5 * length:
        return False
    others = np.arange(scene.count) != i
    position = np.vstack([scene.position[others], (ego.x, ego.y)])
    heading = np.append(scene.heading[others], ego.psi)
    size = np.vstack([scene.size[others], (body.length, body.width)])

    def gaps(x: float, y: float, psi: float) -> Array:
        return rectangle_gaps(x, y, psi, length, width, position, heading, size)

    x, y = scene.position[i].tolist()
    now = gaps(x, y, float(scene.heading[i]))
    return bool((gaps(*_place(scene, i, s)) >= np.minimum(now, CLEAR_M)).all())
