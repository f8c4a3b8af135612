"""One update of SAC with a Lagrange multiplier (paper, appendix "Lagrangian Relaxation"; RCPO, SAC-Lag).

With a batch of transitions (s, a, r, c, gamma^k, s') and a' ~ pi(.|s'), a_pi ~ pi(.|s):

    targets     y   = r + gamma^k [ min_i Q_i(s', a'; targets) - alpha log pi(a'|s') ]
                y_c = c + gamma^k   max_i Q_c,i(s', a'; targets)
    critics     L   = sum_i mean_B (Q_i(s, a) - y)^2 / 2,  the same for Q_c and y_c
    policy      L   = mean_B [ alpha log pi(a_pi|s) - min_i Q_i(s, a_pi) + lambda (Q_c(s, a_pi) - d_th) ]
    multiplier  lambda <- max(0, lambda + rate mean_B (Q_c(s, a_pi) - d_th))

with Q_c = max_i Q_c,i.

The larger of two cost critics counts, so that a violation is not underestimated. Costs know no entropy.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch

from rudc.arrays import Arrays
from rudc.learning.algorithms import LagrangianConfig
from rudc.learning.batch import Batch
from rudc.learning.config import Problem
from rudc.learning.learner import Statistics
from rudc.learning.multiplier import Multiplier
from rudc.learning.parameters import COST, grouped
from rudc.learning.sac import SacLearner
from rudc.learning.twins import TwinCritics


@dataclass(frozen=True)
class LagrangianStatistics(Statistics):
    """What there is besides."""

    cost_loss: float
    """mean over the cost critics"""
    cost_value: float
    """Q_c of the policy's actions, mean over the batch"""
    cost_target: float
    """mean of the cost critics' targets"""
    multiplier: float
    """lambda, reward units over units of cost"""


class SacLagrangianLearner(SacLearner):
    """SAC under a limit of the expected cost."""

    statistics = LagrangianStatistics

    def __init__(self, config: LagrangianConfig, problem: Problem, device: str = "cpu") -> None:
        super().__init__(config, problem, device)
        self.limit = config.cost_limit
        self.costs = TwinCritics(config, problem, self.device, tag=COST, scale=config.cost_scale, pick="max")
        self.cost_descent = self.descent(self.costs.trained, config.critic_rate)
        self.multiplier = Multiplier(config.multiplier, config.multiplier_rate, config.cost_limit)
        self.parts |= {"cost": self.costs, "cost_descent": self.cost_descent, "multiplier": self.multiplier}

    def update(self, batch: Batch) -> LagrangianStatistics:
        """One gradient step of critics, policy and temperature, one step of multiplier and targets."""
        seen = self.tensors(batch)
        alpha, lagrange = self.temperature.value, self.multiplier.value
        with torch.no_grad():
            after = self.draw(seen.after)
            future = self.critics.target_value(seen.after, after.action) - alpha * after.log_probability
            target = seen.reward + seen.discount * future
            cost_target = seen.cost + seen.discount * self.costs.target_value(seen.after, after.action)
        critic_loss, critic_norm = self.critics.learn(self.critic_descent, seen.state, seen.action, target)
        cost_loss, _ = self.costs.learn(self.cost_descent, seen.state, seen.action, cost_target)

        drawn = self.draw(seen.state)
        value = self.critics.value(seen.state, drawn.action)
        cost = self.costs.value(seen.state, drawn.action)
        policy_loss = (alpha * drawn.log_probability - value + lagrange * (cost - self.limit)).mean()
        policy_norm = self.policy_descent.differentiate(policy_loss, self.config.value_scale)
        self.policy_descent.step()

        entropy = -drawn.log_probability.detach().mean()
        expected_cost = float(cost.detach().mean())
        self.temperature.step(entropy)
        self.multiplier.step(expected_cost)
        self.critics.follow()
        self.costs.follow()
        self.updates += 1
        return LagrangianStatistics(
            critic_loss=critic_loss,
            policy_loss=float(policy_loss.detach()),
            value=float(value.detach().mean()),
            target=float(target.mean()),
            entropy=float(entropy),
            temperature=float(alpha),
            critic_gradient=critic_norm,
            policy_gradient=float(policy_norm),
            cost_loss=cost_loss,
            cost_value=expected_cost,
            cost_target=float(cost_target.mean()),
            multiplier=lagrange,
        )

    def weights(self) -> Arrays:
        """`policy/...`, `critic/...` and `cost/...`."""
        return super().weights() | grouped(cost=self.costs.arrays())
