"""Where everybody will be if each follows its own path: the predictions of the gate and the last resort.

The others follow their row of `network.paths` with both ends of the vehicle on it, as SUMO moves them; those
without a row go straight on. All keep the offset from the path, and the angle to it, that they have now. So
does the ego for the gate; for the last resort it steers along its route (rudc/env/tracking.py).

Two other places predict too. Where surrounding vehicles yield (rudc/world/yielding.py), they are predicted in
the same way, except that they turn with their lane. rudc/env/conflict.py needs no poses: it looks gaps up by
arc length.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rudc.arrays import Array, Complex, Flags, Index
from rudc.safety.kernels import driving_behind, others_ahead
from rudc.world.scene import Scene

GO_ACCELERATION = 2.0
"""m/s2, acceleration of an ego that goes on along its route, if its vehicle can"""
GO_SPEED = 9.0
"""m/s, up to which it then accelerates, unless it is faster already"""
TAIL = 120.0
"""m behind the ego on its path within which those who follow it are looked for: in the last resort's 2.5 s
nobody slower than 45 m/s comes from farther"""
LANE = 1.5
"""m, a vehicle less than this beside a path drives on it"""
ALONG = 0.7
"""a vehicle drives along a path if the cosine of the angle between them is above this"""


def bodies(scene: Scene) -> tuple[Array, Array, Array, Array, Index, Array]:
    """The arrays of the others that kernels take: positions, headings, velocities, sizes, paths and arc
    lengths on them.
    """
    return scene.position, scene.heading, scene.velocity, scene.size, scene.path, scene.path_s


def lines(scene: Scene) -> tuple[Array, int]:
    """The P ways through the junction as kernels take them: poses (P * M, 3), and their number of stations
    M.
    """
    paths = scene.network.paths
    return paths.poses, paths.stations


def those_ahead(scene: Scene, who: Index, way: Array) -> tuple[Complex, Complex]:
    """(n, T) m and (n, T): position and direction of the others `who` (n,) after `way` (n, T) m."""
    return others_ahead(*bodies(scene), *lines(scene), who, way)


def following(scene: Scene, who: Index) -> Flags:
    """(n,) whether each of the others `who` (n,) drives behind the ego on its path."""
    poses, s = scene.route.path.poses, scene.ego_s
    return driving_behind(*bodies(scene), *lines(scene), poses, s, TAIL, LANE, ALONG, who)


def others_later(scene: Scene, later: float) -> Scene:
    """The scene `later` s later as far as the others go: each has driven on along its path at its speed. The
    ego stays as it is.
    """
    if not scene.count:
        return replace(scene, time_s=scene.time_s + later)
    speed = scene.speed
    way = np.stack([np.zeros_like(speed), speed * later], axis=1)
    place, facing = those_ahead(scene, np.arange(scene.count), way)
    turned = facing[:, 1] * facing[:, 0].conj()
    velocity = (scene.velocity[:, 0] + 1j * scene.velocity[:, 1]) * turned
    return replace(
        scene,
        time_s=scene.time_s + later,
        position=np.stack([place[:, 1].real, place[:, 1].imag], axis=1),
        heading=scene.heading + np.angle(turned),
        velocity=np.stack([velocity.real, velocity.imag], axis=1),
        path_s=scene.path_s + speed * later,
    )
