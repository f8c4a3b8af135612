"""Keeps the wheels on the road: near its edge, the ego does not steer farther outwards than its path, and in
a bend its front does not swing out, nor does its rear cut the corner.

A policy adjusts the steering that follows the path, and a filter steers away from others. Neither regards the
outline of the road surface, and in a bend the path itself may come within a few centimetres of it. So where a
corner of the ego is within NEAR of the edge, or beyond it, on that side of the path on which the ego is, the
steering is that which follows the path.

That is not enough where the ego stands on the inner side of a bend: its rear follows farther inside than
its front. So if a corner on that side is within LOOK of the edge, the next WAY m are predicted.
If the rear would leave the road, the ego turns less now, or a little to the other side, and follows its path
afterwards.

In a bend that takes nearly all its steering, an ego that is on its line may turn too late: the outer corner
of its front swings over the edge. Once that corner is within NEAR of the edge, the ego turns more sharply.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from rudc.arrays import Array
from rudc.env.tracking import steering
from rudc.network.paths import SPACING
from rudc.vehicle import Actuation
from rudc.world.ego import EgoPlant
from rudc.world.scene import EgoState, Scene

NEAR = 0.1
"""m, distance from the road's edge"""
OFF = 0.05
"""m, offset from the path from which on the ego is brought back"""
LOOK, WAY, STEP = 0.6, 7.0, 0.5
"""m: distance from the road's edge, length and step of the prediction"""
TIGHT = 0.05
"""1/m, curvature from which on the rear may cut the corner"""
SHARP, SHARPER = 0.3, 0.1
"""rad, rad: steering from which on the ego's front may swing out, and how much more it then steers"""
STRAIGHTER, HELD = (0.5, 0.0, -0.5, -1.0), 0.5
"""shares of the steering that are tried, below 0 to the other side, and m for which they are held"""


def kept_on_road(scene: Scene, u: Array) -> Array:
    """(2,) the command u (2,), m/s2 and rad; near the road's edge with steering that leads back to the
    path, and in a bend with steering that keeps the ego's front and its rear on the road.
    """
    if _swings_out(scene, float(u[1])):
        sharper = min(abs(float(u[1])) + SHARPER, scene.vehicle.delta_max)
        return np.array([u[0], math.copysign(sharper, u[1])])
    if abs(scene.ego_offset) < OFF:
        return u
    side, room = math.copysign(1.0, scene.ego_offset), _room(scene, scene.ego)
    if room > LOOK:
        return u
    delta = float(u[1])
    if room <= NEAR:
        back = steering(scene)
        delta = back if side * (delta - back) > 0.0 else delta
    if side * delta > 0.0 and _bend(scene, side) > TIGHT:
        delta = _round_the_corner(scene, delta)
    return u if delta == u[1] else np.array([u[0], delta])


def _swings_out(scene: Scene, delta: float) -> bool:
    """Whether the ego turns sharply with the steering `delta` (rad), as its path does, and the outer corner
    of its front is all but over the edge, while there is room at its inner side."""
    turns, ego = math.copysign(1.0, delta), scene.ego
    return (
        abs(delta) > SHARP
        and turns * steering(scene) > SHARP
        and _corner(scene, ego, 1.0, -turns) <= NEAR
        and min(_corner(scene, ego, end, turns) for end in (1.0, -1.0)) > LOOK
    )


def _room(scene: Scene, ego: EgoState) -> float:
    """m from the road's edge to the nearer of the two corners on the ego's outer side; negative beyond it."""
    return min(_corner(scene, ego, end, math.copysign(1.0, scene.ego_offset)) for end in (1.0, -1.0))


def _corner(scene: Scene, ego: EgoState, end: float, side: float) -> float:
    """m from the road's edge to a corner of the ego, negative beyond it: of its front (`end` 1) or rear (-1),
    left (`side` 1) or right (-1)."""
    half_length, half_width = 0.5 * end * scene.vehicle.length, 0.5 * side * scene.vehicle.width
    cos, sin = math.cos(ego.psi), math.sin(ego.psi)
    x, y = half_length * cos - half_width * sin, half_length * sin + half_width * cos
    return scene.network.surface.depth(ego.x + x, ego.y + y)


def _bend(scene: Scene, side: float) -> float:
    """1/m, greatest curvature of the path to that side (1 left, -1 right) on the next WAY m."""
    first = max(int(scene.ego_s / SPACING), 0)
    ahead = scene.route.path.curvature[first : first + int(WAY / SPACING)]
    return float((side * ahead).max(initial=0.0))


def _round_the_corner(scene: Scene, delta: float) -> float:
    """rad, the steering `delta`, or the first of the others that keeps the ego's inner side on the road; if
    none does, the one with which it leaves the road least.
    """
    best, most = delta, _least_room(scene, delta)
    for share in STRAIGHTER:
        if most >= 0.0:
            break
        least = _least_room(scene, share * delta)
        if least > most:
            best, most = share * delta, least
    return best


def _least_room(scene: Scene, delta: float) -> float:
    """m, least `_room` on the next WAY m with the steering `delta` (rad) for HELD m, then along the path."""
    plant, path, least = EgoPlant(scene.vehicle), scene.route.path, math.inf
    plant.resume(replace(scene.ego, v=1.0, acceleration=0.0), Actuation())
    now = scene
    for k in range(round(WAY / STEP)):
        ego = plant.step(0.0, delta if k * STEP < HELD else steering(now), STEP)
        s, offset = path.project(ego.x, ego.y, now.ego_s)
        now = replace(scene, ego=ego, ego_s=s, ego_offset=offset)
        least = min(least, _room(scene, ego))
    return least
