"""`Batch`: transitions from the replay, as arrays."""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np

from rudc.arrays import Flags, Floats


class Batch(NamedTuple):
    """B transitions, each over k >= 1 decisions."""

    observation: Floats
    """(B, size)"""
    executed: Floats
    """(B, actions), what was executed, after the correction, in [-1, 1]"""
    proposed: Floats
    """(B, actions), what the policy had proposed, in [-1, 1]"""
    reward: Floats
    """(B,), discounted sum of the k rewards"""
    cost: Floats
    """(B,), discounted sum of the k costs, each at least 0"""
    discount: Floats
    """(B,), gamma^k"""
    next_observation: Floats
    """(B, size), after the k decisions"""
    terminal: Flags
    """(B,), whether the episode ended there; False for a time-out, whose value is bootstrapped"""
    mask: Flags
    """(B, masked critics), m_n of Eq. (ensemble_huber_loss): which critics learn from it"""
    cost_change: Floats = np.empty(0, np.float32)
    """(B,), by how much the first of the k decisions changed the step-wise cost; the replay always has it"""

    def action(self, which: Literal["executed", "proposed"]) -> Floats:
        """(B, actions), the action that critics are to learn about."""
        return self.executed if which == "executed" else self.proposed
