"""What of a lane a body takes, and where the ego drives against those who enter at its beginning."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from rudc.arrays import Array
from rudc.geometry import rectangle_corners
from rudc.network.polyline import arc_length, beside
from rudc.world.spawn import BRAKING, ROUNDED_M

if TYPE_CHECKING:
    from rudc.network.road import Lane
    from rudc.vehicle import EgoVehicle
    from rudc.world.scene import EgoState
    from rudc.world.traffic import Traffic

NEAR_M = 60.0
"""m from a lane's beginning, beyond which the ego does not concern those who enter there"""


def obstructed(lane: Lane, corners: Array, free: float) -> tuple[float, float] | None:
    """From where to where (m of SUMO's positions on the lane) a rectangle with these corners (4, 2) leaves
    less than `free` m to a side of a lane's centre line; None if it does nowhere."""
    s, aside = beside(lane.xy, corners)
    drawn = float(arc_length(lane.xy)[-1])
    if abs(drawn - lane.length) > ROUNDED_M:  # SUMO gives all lanes of an edge the same length, also in bends
        s = s * (lane.length / drawn)
    if aside.max() < -free or aside.min() > free or s.max() < 1.0 or s.min() > lane.length - 1.0:
        return None
    start, end = max(float(s.min()), 0.2), min(float(s.max()), lane.length - 0.2)
    return (start, end) if end > start else None  # none on a stub: the lanes before and after it are blocked


def ego_against(traffic: Traffic, ego: EgoState, body: EgoVehicle) -> Iterator[tuple[str, float, float]]:
    """Those of the lanes on which SVs enter against whose direction the ego drives, so that somebody there
    has no room beside it. For each: its id, up to where the way is open if the ego brakes (m along the lane),
    and 0 m/s. SUMO takes the ego to be in the lane of its own direction.
    """
    for lane in traffic.entries:
        if math.dist(lane.xy[0], (ego.x, ego.y)) > NEAR_M or math.cos(ego.psi - lane.heading[0]) > 0.0:
            continue
        place, size = np.array([ego.x, ego.y]), np.array([body.length, body.width])
        span = obstructed(lane, rectangle_corners(place, np.array(ego.psi), size), traffic.needs_m)
        if span is not None:
            yield lane.id, span[0] - ego.v**2 / (2.0 * BRAKING), 0.0
