"""Transitions over several decisions (n-step returns).

From s_t, with rewards r_t ... r_{t+k-1} and k = n, or fewer where the episode ends earlier:

    reward = sum_{i<k} gamma^i r_{t+i},   discount = gamma^k,   next state s_{t+k}

An episode that ends by itself (success, violation) is terminal: nothing follows. One that is cut off by the
time limit is not: its transitions are stored with the state it was cut off in, and the value of that state
stands for what would have come. The rewards in between follow the actions that were executed then, also where
the policy has changed since: the usual uncorrected n-step return, good for small n.
"""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

from rudc.arrays import Floats


class Transition(NamedTuple):
    """What `Replay.add` takes."""

    observation: Floats
    """(size,)"""
    action: Floats
    """(actions,), executed"""
    nominal: Floats
    """(actions,), proposed"""
    reward: float
    """discounted sum over the decisions in between"""
    discount: float
    """gamma to the number of those"""
    next_observation: Floats
    """(size,)"""
    terminal: bool
    """whether the episode ended there by itself"""


class NStep:
    """Collects one episode after the other of one environment."""

    def __init__(self, steps: int, discount: float) -> None:
        self._steps = steps
        self._discount = discount
        self._waiting: deque[tuple[Floats, Floats, Floats, float]] = deque()

    def add(
        self,
        observation: Floats,
        action: Floats,
        nominal: Floats,
        reward: float,
        next_observation: Floats,
        *,
        terminal: bool,
        truncated: bool = False,
    ) -> list[Transition]:
        """Take in one decision; give back the transitions it completes, oldest first."""
        self._waiting.append((observation, action, nominal, reward))
        if terminal or truncated:
            return [self._oldest(next_observation, terminal) for _ in range(len(self._waiting))]
        if len(self._waiting) == self._steps:
            return [self._oldest(next_observation, False)]
        return []

    def clear(self) -> None:
        """Forget an episode that was broken off and is of no use."""
        self._waiting.clear()

    def _oldest(self, next_observation: Floats, terminal: bool) -> Transition:
        reward = 0.0
        for *_, later in reversed(self._waiting):
            reward = later + self._discount * reward
        discount = self._discount ** len(self._waiting)
        observation, action, nominal, _ = self._waiting.popleft()
        return Transition(observation, action, nominal, reward, discount, next_observation, terminal)
