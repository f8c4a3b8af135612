"""Which part of a lane a body takes, and where the ego comes towards those who enter the road."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from rudc.arrays import Array
from rudc.geometry import rectangle_corners
from rudc.network.polyline import arc_length, beside
from rudc.world.ego import grip_of
from rudc.world.spawn import BRAKING, ROUNDED_M

if TYPE_CHECKING:
    from rudc.network.road import Lane
    from rudc.world.ego import EgoPlant
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


def ego_against(traffic: Traffic, plant: EgoPlant) -> Iterator[tuple[str, float, float]]:
    """The lanes on which SVs enter and in which the ego comes towards them, leaving no room beside it. For
    each: its id, up to where (m along it) an SV could drive while the ego brakes, and 0 m/s, as in
    `Reader.rears`. SUMO takes the ego to be only in the lane of its own direction.
    """
    ego, size = plant.state, np.array([plant.vehicle.length, plant.vehicle.width])
    for lane in traffic.entries:
        if math.dist(lane.xy[0], (ego.x, ego.y)) > NEAR_M or math.cos(ego.psi - lane.heading[0]) > 0.0:
            continue
        corners = rectangle_corners(np.array([ego.x, ego.y]), np.array(ego.psi), size)
        span = obstructed(lane, corners, traffic.needs_m)
        if span is not None:
            yield lane.id, span[0] - ego.v**2 / (2.0 * min(BRAKING, grip_of(plant.actuation))), 0.0
