"""A safety filter put behind a driver: what the driver proposes is corrected before it is applied."""

from __future__ import annotations

import time

from rudc.agents.base import Agent, Decision, EgoDriver
from rudc.safety.filter import FilterConfig, SafetyFilter
from rudc.safety.residual import ResidualPredictor
from rudc.world.scene import Scene

FILTERS = {
    "ttcbf": "Behind it a safety filter with truncated Taylor control barrier functions.",
    "ecbf": "Behind it a safety filter with exponential control barrier functions.",
}
"""suffix of an agent's name -> what it puts behind the agent"""


class FilteredAgent:
    """Any driver with a safety filter behind it."""

    ego_driver: EgoDriver = "agent"

    def __init__(
        self,
        driver: Agent,
        kind: str,
        config: FilterConfig | None = None,
        predictor: ResidualPredictor | None = None,
    ) -> None:
        """`kind`: `ttcbf` or `ecbf`, with its preset unless `config` says otherwise; `predictor`: of the
        residuals that its rows take in.
        """
        self.name = f"{driver.name}+{kind}"
        self._driver = driver
        self._predictor = predictor
        self.filter = SafetyFilter(config or FilterConfig.preset(kind))

    def reset(self, scene: Scene, seed: int) -> None:
        """Reset driver and filter."""
        self._driver.reset(scene, seed)
        self.filter.reset()

    def act(self, scene: Scene) -> Decision:
        """The driver's proposal, corrected."""
        proposed = self._driver.act(scene)
        start = time.perf_counter()
        residual = None
        if self._predictor is not None:
            residual = self._predictor(scene, self.filter.constraints(scene), proposed.u_rl)
        filtered = self.filter.filter(scene, proposed.u_rl, residual=residual)
        spent = 1000.0 * (time.perf_counter() - start)
        timing = {**proposed.timing_ms, "filter": spent}
        return Decision(filtered.u, proposed.u_rl, proposed.uncertainty, filtered, timing)
