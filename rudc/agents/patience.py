"""Where a course leads round something, a policy can be somewhere it has never been, and stand for good.

An ego that has stood on a course for PATIENCE s, although a driver by rules (rudc/agents/gap_acceptance.py)
would go, goes as that driver would, at PACE m/s at most, until the policy goes by itself, or the rules stop
it. What corrects the policy corrects that, too.
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
        """(2,) what the policy proposes on a course, m/s2 and rad, or that with the acceleration of rules."""
        if not self._going and scene.waited_s < PATIENCE:
            return u
        a = float(self._rules.act(scene).u[0])
        self._going = a > 0.0 and (u[0] < a or scene.ego.v < PACE)
        a = min(a, acceleration_towards(PACE, scene, ACCELERATION))
        return np.array([a, u[1]]) if self._going and u[0] < a else u
