"""A driver that follows its path at 8 m/s and ignores everybody: the reference for reckless driving."""

from __future__ import annotations

from rudc.agents.base import Decision, unfiltered
from rudc.env.tracking import CALM_S, acceleration_towards, speed_allowed, speeds_in_bends, steering
from rudc.world.config import EgoDriver
from rudc.world.scene import Scene

CRUISE = 8.0
"""m/s, desired speed"""
ACCELERATION = 2.0
"""m/s2, largest acceleration"""


class Follower:
    """Follows the reference path at 8 m/s, slower in bends, and ignores traffic."""

    name = "follower"
    ego_driver: EgoDriver = "agent"

    def reset(self, scene: Scene, seed: int) -> None:
        """Nothing is kept from one decision to the next."""

    def act(self, scene: Scene) -> Decision:
        """Steer along the path and hold the speed."""
        speed = speed_allowed(scene, speeds_in_bends(scene.route.path), CRUISE)
        return unfiltered(acceleration_towards(speed, scene, ACCELERATION), steering(scene, CALM_S))
