"""What soft actor-critics share that learn costs beside the return (paper, "Safe Reinforcement Learning").

With a batch of transitions (s, a, r, c, gamma^k, s') and a' ~ pi(.|s'):

    target   y_c = c + gamma^k max_i Q_c,i(s', a'; targets)
    critics  L   = sum_i mean_B (Q_c,i(s, a) - y_c)^2 / 2
    Q_c      = max_i Q_c,i

The larger of two cost critics counts, so that a violation is not underestimated. Their targets have no
entropy term.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

from rudc.arrays import Arrays
from rudc.learning.config import CostConfig, Problem
from rudc.learning.learner import Statistics, Tensors
from rudc.learning.parameters import COST, grouped
from rudc.learning.policy import Drawn
from rudc.learning.sac import SacLearner
from rudc.learning.twins import TwinCritics


@dataclass(frozen=True)
class CostStatistics(Statistics):
    """SAC's statistics, and those of the cost critics."""

    cost_loss: float
    """mean over the cost critics"""
    cost_value: float
    """Q_c of the policy's actions, mean over the batch"""
    cost_target: float
    """mean of the cost critics' targets"""


class CostLearner(SacLearner):
    """SAC with cost critics; an algorithm writes down its `update`."""

    statistics = CostStatistics

    def __init__(self, config: CostConfig, problem: Problem, device: str = "cpu") -> None:
        super().__init__(config, problem, device)
        self.costs = TwinCritics(config, problem, self.device, tag=COST, scale=config.cost_scale, pick="max")
        self.cost_descent = self.learns("cost", self.costs, config.critic_rate)

    def learn_costs(self, seen: Tensors, action: Tensor, after: Drawn) -> dict[str, float]:
        """One step of the cost critics at (s, a) towards y_c with a' = `after`; gives their statistics."""
        with torch.no_grad():
            target = seen.cost + seen.discount * self.costs.target_value(seen.after, after.action)
        loss, _ = self.costs.learn(self.cost_descent, seen.state, action, target)
        return {"cost_loss": loss, "cost_target": float(target.mean())}

    def follow(self) -> None:
        """One step of all targets, which ends an update."""
        self.critics.follow()
        self.costs.follow()
        self.updates += 1

    def weights(self) -> Arrays:
        """`policy/...`, `critic/...` and `cost/...`."""
        return super().weights() | grouped(cost=self.costs.arrays())
