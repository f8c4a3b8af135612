"""Transitions over several decisions (n-step returns).

From s_t, with rewards r_t ... r_{t+k-1}, costs c_t ... c_{t+k-1} and k = n, or fewer where the episode ends
earlier:

    reward = sum_{i<k} gamma^i r_{t+i},   cost = sum_{i<k} gamma^i c_{t+i},   discount = gamma^k,
    next state s_{t+k}

An episode that ends by itself (success, violation) is terminal: nothing follows. One that is cut off by the
time limit is not: its transitions are stored with the state it was cut off in, and the value of that state
stands for what would have followed. The rewards in between follow the actions that were executed then, also
where the policy has changed since: the usual uncorrected n-step return, good for small n.
"""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

from rudc.arrays import Floats


class Transition(NamedTuple):
    """One transition, as it is stored in the replay."""

    observation: Floats
    """(size,)"""
    executed: Floats
    """(actions,)"""
    proposed: Floats
    """(actions,)"""
    reward: float
    """discounted sum over the decisions in between"""
    cost: float
    """discounted sum over the decisions in between"""
    discount: float
    """gamma to the number of those"""
    next_observation: Floats
    """(size,)"""
    terminal: bool
    """whether the episode ended there by itself"""
    cost_change: float = 0.0
    """c_t - c_{t-1}: the step-wise cost of the first decision less that of the scene it was taken in"""


class NStep:
    """Collects transitions from one environment, episode after episode."""

    def __init__(self, steps: int, discount: float) -> None:
        self._steps = steps
        self._discount = discount
        self._waiting: deque[tuple[Floats, Floats, Floats, float, float, float]] = deque()

    def add(
        self,
        observation: Floats,
        executed: Floats,
        proposed: Floats,
        reward: float,
        cost: float,
        next_observation: Floats,
        *,
        terminal: bool,
        truncated: bool = False,
        cost_before: float = 0.0,
    ) -> list[Transition]:
        """Take in one decision; give back the transitions it completes, oldest first. `cost_before`: the
        step-wise cost of the scene it was taken in.
        """
        self._waiting.append((observation, executed, proposed, cost - cost_before, reward, cost))
        if terminal or truncated:
            return [self._oldest(next_observation, terminal) for _ in range(len(self._waiting))]
        if len(self._waiting) == self._steps:
            return [self._oldest(next_observation, False)]
        return []

    def clear(self) -> None:
        """Forget an episode that was broken off and is not to be used."""
        self._waiting.clear()

    def _oldest(self, next_observation: Floats, terminal: bool) -> Transition:
        reward = cost = 0.0
        for *_, later_reward, later_cost in reversed(self._waiting):
            reward = later_reward + self._discount * reward
            cost = later_cost + self._discount * cost
        discount = self._discount ** len(self._waiting)
        observation, executed, proposed, change, *_ = self._waiting.popleft()
        return Transition(
            observation, executed, proposed, reward, cost, discount, next_observation, terminal, change
        )
