"""Who yields to whom at an instant: what pictures show of the traffic's manners. Nothing is driven by it.

Surrounding vehicles (SVs) yield for two reasons, and this names for each SV the one it yields to first:

    the yielding layer (rudc/world/yielding.py): the ego if the SV brakes for it, or else the obstacle or SV
        that alone makes it brake hardest;
    SUMO's right of way: an SV that stands or brakes, as the first of its arm, before a way that meets its own
        and has priority; whoever is there, or comes there within GAP_S, is yielded to.

SUMO does not say for whom its drivers wait, so that the second is read off the scene.
"""

from __future__ import annotations

import math

import numpy as np

from rudc.arrays import Array
from rudc.network.conflicts import meeting
from rudc.network.paths import SPACING
from rudc.world.scene import STANDING, Scene
from rudc.world.traffic import EGO
from rudc.world.yielding import must_yield
from rudc.world.yielding_kernels import CREEPS

GAP_S = 6.0
"""s, within which somebody comes to where the ways meet who is waited for"""
NEAR_M = 20.0
"""m from there within which an SV that brakes does so for who has priority"""
BRAKES = -0.5
"""m/s2, below which an SV brakes"""
BESIDE_M = 1.5
"""m off a way within which a centre is on it"""


def who_yields(scene: Scene) -> dict[str, str]:
    """Name of each SV that yields -> whom it yields to first: a name of the scene's, or `ego`."""
    speed = np.hypot(*scene.velocity.T)
    found = {}
    for i in np.flatnonzero(scene.path >= 0).tolist():
        first = _first_with_priority(scene, i, speed)
        if first is not None:
            found[scene.ids[i]] = scene.ids[first]
    for i in must_yield(scene).rows:
        whom = _braked_for(scene, i)
        if whom is not None:
            found[scene.ids[i]] = whom
    return found


def _braked_for(scene: Scene, i: int) -> str | None:
    """Whom an SV i that the yielding layer brakes yields to; None if no single one makes it."""
    if must_yield(scene.only(np.array([i]))).rows:
        return EGO
    hardest, whom = -math.inf, None
    for j in range(scene.count):
        layer = must_yield(scene.only(np.array([i, j])), ego_present=False)
        needed = dict(zip(layer.rows, layer.deceleration, strict=True)).get(0, -math.inf)
        if j != i and needed > hardest:
            hardest, whom = needed, scene.ids[j]
    return whom


def _first_with_priority(scene: Scene, i: int, speed: Array) -> int | None:
    """Who of those to whom SUMO makes an SV i give way is first where their ways meet; None if i goes on."""
    if speed[i] >= STANDING and scene.acceleration[i] >= BRAKES:
        return None
    paths, row, front = scene.network.paths, int(scene.path[i]), scene.path_s[i] + 0.5 * scene.size[i, 0]
    soonest, first = GAP_S, None
    for j in np.flatnonzero(scene.path >= 0).tolist():
        other = int(scene.path[j])
        where = meeting(paths, row, other) if paths.yields[row, other] else None
        if where is None or not -1.0 < where[0] - front < NEAR_M:
            continue
        half, s = 0.5 * scene.size[j, 0], scene.path_s[j]
        if s - half > where[3] or (s + half < where[2] and speed[j] < STANDING):
            continue
        arrives = max(where[2] - s - half, 0.0) / max(speed[j], CREEPS)
        if arrives < soonest and not _follows(scene, i, front, where[0]):
            soonest, first = arrives, j
    return first


def _follows(scene: Scene, i: int, front: float, until: float) -> bool:
    """Whether somebody from the same arm is on an SV i's way from its front up to `until` m."""
    paths, row = scene.network.paths, int(scene.path[i])
    stations = paths.xy[row, max(int(front / SPACING), 0) : max(int(until / SPACING), 0) + 2]
    others = [j for j in range(scene.count) if j != i and scene.path[j] >= 0]
    same = [j for j in others if paths.origin[scene.path[j]] == paths.origin[row] and scene.path_s[j] > front]
    return any(np.hypot(*(stations - scene.position[j]).T).min(initial=math.inf) < BESIDE_M for j in same)
