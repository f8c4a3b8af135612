"""How the world is simulated; the same for every scenario unless a study says otherwise."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class WorldConfig:
    """Time steps and the yielding layer."""

    decision_s: float = 0.1
    """s between two decisions (the paper: 10 Hz)"""
    substep_s: float = 0.05
    """s between two simulation steps: 20 Hz (the paper's 15 Hz would not divide a decision evenly)"""
    yielding: bool = True
    """whether surrounding vehicles look 2 s ahead for what SUMO does not see (paper, Sec. "Simulation
    Environment")"""
    sumo_options: tuple[str, ...] = ()
    """further options for SUMO's command line, for studies"""

    @property
    def substeps(self) -> int:
        """How many simulation steps one decision has."""
        return round(self.decision_s / self.substep_s)

    def __post_init__(self) -> None:
        ratio = self.decision_s / self.substep_s
        if self.substep_s <= 0 or abs(ratio - round(ratio)) > 1e-9 or round(ratio) < 1:
            raise ValueError(
                f"decision_s={self.decision_s} must be a whole multiple of substep_s={self.substep_s}"
            )
