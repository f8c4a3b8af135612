"""Ends the waiting of a policy that stands for good where it need not: on courses, and on roads that it never
met in training, roundabouts above all.

Once the ego has stood for PATIENCE s and gap acceptance (rudc/agents/gap_acceptance.py) would go, its
acceleration takes the policy's place, up to PACE m/s, until the policy goes by itself or gap acceptance
stops. Steering stays the policy's. A correction treats the result as any proposal; it counts as one, not as
an intervention.
"""

from __future__ import annotations

import numpy as np

from rudc.agents.gap_acceptance import ACCELERATION, GapAcceptance
from rudc.arrays import Array
from rudc.env.tracking import acceleration_towards
from rudc.world.scene import Scene

PATIENCE = 5.0
"""s"""
PACE = 3.0
"""m/s"""


class Patience:
    """Of one agent; `reset` begins an episode."""

    def __init__(self) -> None:
        self._rules = GapAcceptance()

    def reset(self) -> None:
        """Begin a new episode."""
        self._going = False

    def urge(self, scene: Scene, u: Array) -> Array:
        """(2,) m/s2 and rad: the policy's proposal u (2,), or that with the rules' acceleration."""
        if not self._going and scene.waited_s < PATIENCE:
            return u
        a = float(self._rules.act(scene).u[0])
        self._going = a > 0.0 and (u[0] < a or scene.ego.v < PACE)
        a = min(a, acceleration_towards(PACE, scene, ACCELERATION))
        return np.array([a, u[1]]) if self._going and u[0] < a else u
