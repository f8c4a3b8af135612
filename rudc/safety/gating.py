"""Which others the filter constrains: those whose predicted path meets the ego's.

The barrier assumes that others keep their velocity, so that a vehicle which turns off before the ego, or
oncoming traffic on its own lane, looks like a threat. The gate asks first whether the two meet when each
follows its own path (see `prediction`) at its present speed. A vehicle is let through to the rows if at some
instant within the horizon

    |r| < rho_e + rho_o + gate_distance

with the ellipses' support radii (see `barrier`) at the predicted poses.

Not let through is who drives behind the ego on the ego's own path: that distance is theirs to keep. The
barrier has the two push each other apart, so that a vehicle coming up from behind at constant speed makes a
waiting ego drive into the one ahead.
"""

from __future__ import annotations

import math

import numpy as np

from rudc.arrays import Array, Complex, Index
from rudc.safety.config import FilterConfig
from rudc.safety.prediction import Predictor
from rudc.safety.road_points import CLOSEST
from rudc.world.scene import Scene


class Gate:
    """Picks the others that the ego may meet."""

    def __init__(self, config: FilterConfig, predictor: Predictor) -> None:
        steps = math.ceil(config.gate_horizon / config.gate_step - 1e-9)
        self._times: Array = np.linspace(0.0, config.gate_horizon, steps + 1)
        self._horizon = config.gate_horizon
        self._gap = config.gate_distance
        self._predictor = predictor

    def meeting(self, scene: Scene, short: Array, stretch: Array) -> Index:
        """Indices, nearest first, of those whose ellipse comes closer to the ego's than the gate distance.

        `short` and `stretch` (2, N) m2: squares of the half axes across, and along minus across, of ego and
        others.
        """
        now: Complex = scene.position[:, 0] + 1j * scene.position[:, 1]
        speed: Array = np.hypot(scene.velocity[:, 0], scene.velocity[:, 1])
        longest: Array = np.sqrt(short + np.maximum(stretch, 0.0)).sum(axis=0)
        reach = (speed + scene.ego.v) * self._horizon + longest + self._gap
        who = np.flatnonzero(np.abs(now - complex(scene.ego.x, scene.ego.y)) < reach)
        if not len(who):
            return who
        place, facing = self._predictor.ego(scene, scene.ego.v * self._times)
        others, turned = self._predictor.others(scene, who, speed[who, None] * self._times)
        r = place - others
        along, own = r * facing.conj(), r * turned.conj()
        squared = np.maximum(along.real**2 + along.imag**2, CLOSEST)
        ego_radius = np.sqrt(short[0, who, None] + stretch[0, who, None] * (along.real**2 / squared))
        radius = np.sqrt(short[1, who, None] + stretch[1, who, None] * (own.real**2 / squared))
        meet = np.flatnonzero((np.sqrt(squared) < ego_radius + radius + self._gap).any(axis=1))
        if not len(meet):
            return meet
        return who[meet[~self._predictor.following(scene, now[who[meet]], turned[meet, 0])]]
