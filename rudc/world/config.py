"""How the world is simulated; the same for every scenario unless a study says otherwise."""

import math
from dataclasses import dataclass
from typing import Literal

EgoDriver = Literal["agent", "sumo"]
"""who drives the ego: an agent, or SUMO's own driver"""


@dataclass(frozen=True, slots=True)
class WorldConfig:
    """Time steps and the yielding layer."""

    decision_s: float = 0.1
    """s between two decisions (the paper: 10 Hz)"""
    substep_s: float = 0.05
    """s between two simulation steps: 20 Hz (the paper's 15 Hz would not divide a decision evenly); a whole
    number of milliseconds"""
    yielding: bool = True
    """whether surrounding vehicles look 2 s ahead for what SUMO does not see (paper, Sec. "Simulation
    Environment")"""

    @property
    def substeps(self) -> int:
        """How many simulation steps one decision has."""
        return round(self.decision_s / self.substep_s)

    def __post_init__(self) -> None:
        ms = 1000.0 * self.substep_s
        if not (0.5 < ms < math.inf) or abs(ms - round(ms)) > 1e-6:
            raise ValueError(
                f"substep_s={self.substep_s} must be a whole number of milliseconds: SUMO rounds to them"
            )
        ratio = self.decision_s / self.substep_s
        if not (0.5 < ratio < math.inf) or abs(ratio - round(ratio)) > 1e-9:
            raise ValueError(
                f"decision_s={self.decision_s} must be a whole multiple of substep_s={self.substep_s}"
            )
