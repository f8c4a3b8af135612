"""The distances that observation, reward and cost share (paper, Sec. "MDP Formulation").

d_veh   gap between the rectangles of the ego and of the nearest other road user or obstacle, inf when alone
d_road  from the ego's centre of gravity to the nearest edge of the drivable area, negative off the road
d_des   along the reference path to the destination, never negative
"""

from __future__ import annotations

from typing import NamedTuple

from rudc.world.kernels import around
from rudc.world.scene import Scene


class Distances(NamedTuple):
    """d_veh, d_road and d_des of one scene, in m."""

    vehicle_m: float
    road_m: float
    destination_m: float


def measure(scene: Scene, vehicle_m: float | None = None) -> Distances:
    """The distances of a scene; `vehicle_m` is d_veh in m, if it is known already."""
    ego, body = scene.ego, scene.vehicle
    nearest = vehicle_m
    if nearest is None:
        nearest, _, _ = around(
            ego.x, ego.y, ego.psi, body.length, body.width, scene.position, scene.heading, scene.size, 0.0
        )
    road = scene.network.surface.depth(ego.x, ego.y)
    return Distances(nearest, road, max(scene.goal_s - scene.ego_s, 0.0))
