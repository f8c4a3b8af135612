"""Keeps the wheels on the road: near its edge, the ego does not steer farther outwards than its path.

A policy adjusts the steering that follows the path, and a filter steers away from others. Neither regards the
outline of the road surface, and in a bend the path itself may come within a few centimetres of it. So where a
corner of the ego is within NEAR of the edge, or beyond it, on that side of the path on which the ego is, the
steering is that which follows the path.
"""

from __future__ import annotations

import math

import numpy as np

from rudc.arrays import Array
from rudc.env.tracking import steering
from rudc.world.scene import Scene

NEAR = 0.1
"""m, distance from the road's edge"""
OFF = 0.05
"""m, offset from the path from which on the ego is brought back"""


def kept_on_road(scene: Scene, u: Array) -> Array:
    """(2,) the command u (2,), m/s2 and rad; near the road's edge with steering that leads back to the
    path.
    """
    if abs(scene.ego_offset) < OFF or _room(scene) > NEAR:
        return u
    back = steering(scene)
    outwards = math.copysign(1.0, scene.ego_offset) * (float(u[1]) - back) > 0.0
    return np.array([u[0], back]) if outwards else u


def _room(scene: Scene) -> float:
    """m from the road's edge to the nearer of the two corners on the ego's outer side; negative beyond it."""
    ego, body, surface = scene.ego, scene.vehicle, scene.network.surface
    ahead = 0.5 * body.length * math.cos(ego.psi), 0.5 * body.length * math.sin(ego.psi)
    half = math.copysign(0.5 * body.width, scene.ego_offset)
    side = ego.x - half * math.sin(ego.psi), ego.y + half * math.cos(ego.psi)
    return min(surface.depth(side[0] + i * ahead[0], side[1] + i * ahead[1]) for i in (1.0, -1.0))
