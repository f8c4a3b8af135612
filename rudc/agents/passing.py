"""Passing close beside bodies that stand and block: how fast, and what counts as close.

Beside bodies an ego drives at most SLOW + PER_METRE x gap, and in bends as rudc/env/tracking.py says.
"""

from __future__ import annotations

import math

import numpy as np

from rudc.arrays import Array
from rudc.env.tracking import COMFORT, planned, speeds_on_road
from rudc.geometry import Rectangles
from rudc.network.course import gaps_along
from rudc.network.paths import SPACING
from rudc.world.scene import Scene

SLOW, PER_METRE = 2.5, 4.0
"""m/s, and m/s for each m of gap: the speed beside bodies"""
BACK = 4.0
"""m behind the ego's centre from where on bodies slow it down"""
NARROW, NARROW_AHEAD = 1.2, 12.0
"""m, m: a passage is close if the gap is below the first within the second ahead"""


def is_narrow(scene: Scene, standing: Rectangles) -> bool:
    """Whether the ego passes close beside a body of `standing`, or is about to."""
    here = scene.ego_s
    _, gap = gaps_along(scene.route.path, here - BACK, here + NARROW_AHEAD, scene.vehicle, standing)
    return bool((gap < NARROW).any())


def speeds_beside(scene: Scene, standing: Rectangles, look: float) -> Array:
    """(M,) m/s, speed at each station of the ego's path that its bends allow, and the gaps beside bodies on
    its next `look` m.
    """
    path = scene.route.path
    s, gap = gaps_along(path, scene.ego_s - BACK, scene.ego_s + look, scene.vehicle, standing)
    profile = speeds_on_road(scene).copy()
    station = np.minimum((s / SPACING).astype(np.int64), len(path.s) - 1)
    np.minimum.at(profile, station, SLOW + PER_METRE * gap)
    return profile


def speed_now(scene: Scene, profile: Array, look: float) -> float:
    """m/s, speed from which comfortable braking keeps to `profile` (M,) m/s on the next `look` m."""
    s = scene.route.path.s
    near = (s > scene.ego_s - BACK - SPACING) & (s < scene.ego_s + look)
    if not near.any():
        return math.inf
    braking = planned(scene, COMFORT)
    return float(np.sqrt(profile[near] ** 2 + 2 * braking * np.maximum(s[near] - scene.ego_s, 0.0)).min())
