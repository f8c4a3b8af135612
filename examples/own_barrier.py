"""A barrier of one's own: h(scene) >= 0 and its derivatives; rows, slack and QP are the filter's.

    rudc --import examples/own_barrier.py run random_destination \\
        --agent follower+ttcbf:correction.speed_limit=true,correction.speed_limit_most=5

h = 10 (most - v), so h' = -10 a: as soon as the ego comes near the limit, the filter lets it accelerate no
more. TTCBF holds the ego at h = 1, whatever the unit of h; with the factor 10 that is 0.1 m/s below the
limit.
"""

import numpy as np
from pydantic import Field

from rudc.safety.barrier import Barrier, BarrierSettings, Found, Terms
from rudc.safety.barriers import register_barrier

SCALE = 10.0
"""of h, per m/s"""


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
        """h = SCALE (most - v); only acceleration changes it."""
        h, zero = np.array([SCALE * (self.settings.most - scene.ego.v)]), np.zeros(1)
        return Terms(h, zero, zero, zero, zero, zero, zero, zero, zero, lg_a=np.array([-SCALE]))


register_barrier(SpeedLimit)
