"""Who yields to whom at an instant, for pictures only: nothing in the simulation depends on it.

Surrounding vehicles (SVs) yield for two reasons. For each SV, this module names whom it yields to first:

    the yielding layer (rudc/world/yielding.py): the ego if the SV brakes for it, or else the obstacle or SV
        that alone makes it brake hardest;
    SUMO's right of way: an SV that is the first of its arm and stands or brakes before a way that meets its
        own and has priority yields to the SV that is there, or comes there first within GAP_S.

SUMO does not say for whom its drivers wait, so the second is concluded from the scene.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection
from functools import partial

import numpy as np

from rudc.arrays import Array
from rudc.network.conflicts import meeting
from rudc.network.paths import SPACING
from rudc.vehicle import Actuation
from rudc.world.ego import grip_of
from rudc.world.scene import STANDING, Scene
from rudc.world.vehicle_types import EGO
from rudc.world.yielding import BRAKE_MOST, Yielding, must_yield
from rudc.world.yielding_kernels import CREEPS

GAP_S = 6.0
"""s: an SV is taken to wait for another that comes to where their ways meet within this time"""
NEAR_M = 20.0
"""m before that place within which an SV that brakes is taken to brake for those with priority"""
BRAKES = -0.5
"""m/s2, an SV with an acceleration below this brakes"""
BESIDE_M = 1.5
"""m from a way within which a vehicle's centre counts as on it"""


def who_yields(scene: Scene, heedless: Collection[str] = ()) -> dict[str, str]:
    """Name of each SV that yields -> name of whom it yields to first, as in `Scene.ids`, or `ego`.

    `heedless`: names of those who disregard the right of way, as in `must_yield`.
    """
    most = min(BRAKE_MOST, grip_of(Actuation(friction=scene.road_friction)))
    layer = partial(must_yield, heedless=heedless, brake_most=most)
    speed = scene.speed
    found = {}
    for i in np.flatnonzero(scene.path >= 0).tolist():
        first = _first_with_priority(scene, i, speed)
        if first is not None:
            found[scene.ids[i]] = scene.ids[first]
    for i in layer(scene).rows:
        whom = _braked_for(scene, i, layer)
        if whom is not None:
            found[scene.ids[i]] = whom
    return found


def _braked_for(scene: Scene, i: int, layer: Callable[..., Yielding]) -> str | None:
    """Whom SV i, which the yielding layer brakes, yields to; None if no single road user alone makes it
    brake.
    """
    if layer(scene.only(np.array([i]))).rows:
        return EGO
    hardest, whom = -math.inf, None
    for j in range(scene.count):
        found = layer(scene.only(np.array([i, j])), ego_present=False)
        needed = dict(zip(found.rows, found.deceleration, strict=True)).get(0, -math.inf)
        if j != i and needed > hardest:
            hardest, whom = needed, scene.ids[j]
    return whom


def _first_with_priority(scene: Scene, i: int, speed: Array) -> int | None:
    """Row of the SV with priority over SV i that comes first to where their ways meet; None if i goes on."""
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
    """Whether another SV from the same arm is on SV i's way, from its front up to `until` m."""
    paths, row = scene.network.paths, int(scene.path[i])
    stations = paths.xy[row, max(int(front / SPACING), 0) : max(int(until / SPACING), 0) + 2]
    others = [j for j in range(scene.count) if j != i and scene.path[j] >= 0]
    same = [j for j in others if paths.origin[scene.path[j]] == paths.origin[row] and scene.path_s[j] > front]
    return any(np.hypot(*(stations - scene.position[j]).T).min(initial=math.inf) < BESIDE_M for j in same)
