"""Ends the waiting of a policy that would stand for ever without need: on courses, and on roads that it never
saw in training, above all roundabouts.

Once the ego has stood for PATIENCE s and the driver `planner` (rudc/agents/gap_acceptance.py) would go, its
acceleration replaces the policy's, up to PACE m/s, until the policy goes by itself or `planner` stops.
Steering stays the policy's. The result counts as the policy's proposal, not as an intervention, and a
correction treats it as such.
"""

from __future__ import annotations

import numpy as np

from rudc.agents.gap_acceptance import ACCELERATION, Planner
from rudc.arrays import Array
from rudc.env.tracking import acceleration_towards
from rudc.world.scene import Scene

PATIENCE = 5.0
"""s, how long the ego must have stood"""
PACE = 3.0
"""m/s, speed up to which the policy's acceleration is replaced"""


class Patience:
    """Urges one agent's policy on in one episode."""

    def __init__(self) -> None:
        self._rules = Planner()
        self._going = False

    def urge(self, scene: Scene, u: Array) -> Array:
        """(2,) m/s2 and rad: the policy's proposal u (2,), or the same with the acceleration of `planner`."""
        if not self._going and scene.waited_s < PATIENCE:
            return u
        a = float(self._rules.act(scene).u[0])
        self._going = a > 0.0 and (u[0] < a or scene.ego.v < PACE)
        a = min(a, acceleration_towards(PACE, scene, ACCELERATION))
        return np.array([a, u[1]]) if self._going and u[0] < a else u
