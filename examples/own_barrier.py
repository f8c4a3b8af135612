"""A barrier of one's own: h(scene) >= 0 and its derivatives; rows, slack and QP are the filter's.

    rudc --import examples/own_barrier.py run random_destination \\
        --agent follower+ttcbf:correction.speed_limit=true,correction.speed_limit_most=5

h = most - v, so h' = -a: as soon as the ego comes near the limit, the filter lets it accelerate no more.
"""

import numpy as np
from pydantic import Field

from rudc.safety.barrier import Barrier, BarrierSettings, Found, Terms
from rudc.safety.barriers import register_barrier


class SpeedLimitSettings(BarrierSettings):
    """Which limit."""

    most: float = Field(default=8.0, gt=0)
    """m/s"""


class SpeedLimit(Barrier):
    """The ego goes no faster than a limit."""

    name = "speed_limit"
    Settings = SpeedLimitSettings

    def find(self, scene):
        """One constraint, always."""
        return Found(("speed_limit",))

    def terms(self, scene, found):
        """h = most - v, in m/s; only acceleration changes it."""
        h, zero = np.array([self.settings.most - scene.ego.v]), np.zeros(1)
        return Terms(h, zero, zero, zero, zero, zero, zero, zero, zero, lg_a=np.array([-1.0]))


register_barrier(SpeedLimit)
