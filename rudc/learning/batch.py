"""`Batch`: transitions from the replay, as arrays."""

from __future__ import annotations

from typing import NamedTuple

from rudc.arrays import Flags, Floats


class Batch(NamedTuple):
    """B transitions, each over k >= 1 decisions."""

    observation: Floats
    """(B, size)"""
    action: Floats
    """(B, actions), what was executed, after the safety filter, in [-1, 1]"""
    nominal: Floats
    """(B, actions), what the policy had proposed, in [-1, 1]"""
    reward: Floats
    """(B,), discounted sum of the k rewards"""
    discount: Floats
    """(B,), gamma^k"""
    next_observation: Floats
    """(B, size), after the k decisions"""
    terminal: Flags
    """(B,), whether the episode ended there; False for a time-out, whose value is bootstrapped"""
    mask: Flags
    """(B, members), m_n of Eq. (ensemble_huber_loss): which critics learn from it"""
