"""Shared by the tests of learners under constraints: problems with a known answer, and an update's terms."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from torch import Tensor

from rudc.learning.batch import Batch
from rudc.learning.config import NetworkConfig, ObservationLayout, Problem
from rudc.learning.costs import CostLearner
from rudc.learning.learner import Tensors
from rudc.learning.policy import Drawn

_NETWORK = NetworkConfig(encoder="mlp", hidden=32)
SETTINGS: Mapping[str, Any] = {
    "policy": _NETWORK,
    "critic": _NETWORK,
    "value_scale": 10.0,
    "cost_scale": 1.0,
    "critic_rate": (3e-3, 3e-4),
    "actor_rate": (3e-3, 1e-3),
    "temperature": 0.02,
    "temperature_rate": 0.0,
}
"""of learners that find the answer in some hundred updates"""


def bandit_problem(updates: int) -> Problem:
    """Of `bandit`."""
    return Problem(ObservationLayout(ego=1, vehicles=0, waypoints=0, task=0), actions=1, updates=updates)


def bandit(rng: np.random.Generator, count: int = 32) -> Batch:
    """One state, one step. The stake x = (1 + a) / 2 earns 20 x - 10 x^2 and costs 2 x: free, x = 1; where
    the cost may be 1, x = 1/2, and there d reward / d cost = (20 - 20 x) / 2 = 5.
    """
    action = rng.uniform(-1, 1, size=(count, 1)).astype(np.float32)
    x = (1 + action[:, 0]) / 2
    one = np.ones((count, 1), np.float32)
    return Batch(
        observation=one,
        executed=action,
        proposed=action,
        reward=20 * x - 10 * x**2,
        cost=2 * x,
        discount=np.full(count, 0.9, np.float32),
        next_observation=one,
        terminal=np.ones(count, np.bool_),
        mask=np.zeros((count, 0), np.bool_),
    )


def toll(rng: np.random.Generator, count: int = 64) -> Batch:
    """The bandit behind a first state, whatever is done there: a cost of 1, and on to the second. With the
    stake x there, costs to come are 1 + 0.9 * 2 x and 2 x, on average 1/2 + 1.9 x: where that may be 1.45,
    x = 1/2, and the multiplier is the bandit's, 5.
    """
    plain, first = bandit(rng, count), rng.random(count) < 0.5
    here, there = np.float32([1.0, 0.0]), np.float32([0.0, 1.0])
    return plain._replace(
        observation=np.where(first[:, None], here, there),
        reward=np.where(first, np.float32(0), plain.reward),
        cost=np.where(first, np.float32(1), plain.cost),
        next_observation=np.tile(there, (count, 1)),
        terminal=~first,
    )


def updated(
    learner: CostLearner, before: CostLearner, b: Batch
) -> tuple[Any, Tensors, Drawn, Tensor, Tensor]:
    """What an update says; then what it saw, the policy's actions, and (B,) Q and (B,) Q_c of these.

    `before`: the same learner, which has not learnt.
    """
    seen = before.tensors(b)
    before.draw_after(seen)
    said = learner.update(b)
    drawn = before.draw(seen.state)  # the policy had not stepped yet, the critics had
    q = learner.critics.both(learner.critics.trained, seen.state, drawn.action).min(dim=0).values
    q_c = learner.costs.both(learner.costs.trained, seen.state, drawn.action).max(dim=0).values
    return said, seen, drawn, q, q_c
