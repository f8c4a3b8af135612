"""How episodes end.

Every episode ends in exactly one outcome; where several hold at once, the first of:

    collision   the ego's rectangle touches anything
    off_road    the ego leaves the drivable area
    wrong_way   the ego drives against the direction of the lane under it, and no lane of the other direction
                overlaps that lane there
    success     its centre has reached the destination along the path, at most 6 m beside it
    frozen      the time limit has passed (in Gymnasium's terms, a truncation and no termination)
"""

from __future__ import annotations

from enum import StrEnum


class Outcome(StrEnum):
    """How an episode ended."""

    SUCCESS = "success"
    FROZEN = "frozen"
    COLLISION = "collision"
    OFF_ROAD = "off_road"
    WRONG_WAY = "wrong_way"

    @property
    def is_violation(self) -> bool:
        """Whether it counts in the violation rate."""
        return self in (Outcome.COLLISION, Outcome.OFF_ROAD, Outcome.WRONG_WAY)
