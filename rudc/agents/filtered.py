"""A correction behind a driver: the driver's action is corrected before it is applied. If the driver has a
correction of its own (`rudc-t`, `usl`, an own agent whose `u` differs from its `u_rl`), its corrected action
is corrected once more: `rudc-t+ttcbf` has two filters, one behind the other.
"""

from __future__ import annotations

import time

from rudc.agents.base import Agent, Decision
from rudc.agents.seat import Correction, Proposal
from rudc.safety.rules import RULES
from rudc.world.config import EgoDriver
from rudc.world.scene import Scene

UNCHANGED = 1e-6
"""m/s2: a change of the acceleration below this is none"""
_FUNCTIONS = {
    "ttcbf": "truncated Taylor control barrier functions",
    "ecbf": "exponential control barrier functions",
}


def filters() -> dict[str, str]:
    """Suffix of an agent's name -> a sentence on what it puts behind the agent: a filter with that rule.
    Registered rules are included."""
    functions = {name: _FUNCTIONS.get(name, f"the rule {name}") for name in RULES}
    return {name: f"Behind it a safety filter with {text}." for name, text in functions.items()}


class FilteredAgent:
    """Any driver with a correction behind it."""

    ego_driver: EgoDriver = "agent"

    def __init__(self, driver: Agent, name: str, correction: Correction) -> None:
        """`name`: name of driver and correction together, as in tables."""
        self.name = name
        self.inner = driver
        self.correction = correction

    def reset(self, scene: Scene, seed: int) -> None:
        """Reset driver and correction."""
        self.inner.reset(scene, seed)
        self.correction.reset(scene, seed)

    def act(self, scene: Scene) -> Decision:
        """The driver's decision with `u` corrected. `corrected` is the result of this correction; `u_rl`
        stays the driver's. The time of the driver's own correction is added to that of this one.
        """
        proposed = self.inner.act(scene)
        start = time.perf_counter()
        corrected = self.correction.correct(scene, Proposal(proposed.u, sigma=proposed.sigma), None)
        spent = 1000.0 * (time.perf_counter() - start)
        spent += proposed.timing_ms.get("correction", 0.0)
        left = abs(float(corrected.u[0] - proposed.u[0])) < UNCHANGED
        return proposed._replace(
            u=corrected.u,
            corrected=corrected,
            timing_ms={**proposed.timing_ms, "correction": spent},
            still_onwards=proposed.onwards and left,
        )
