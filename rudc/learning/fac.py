"""One update of the feasible actor-critic (paper, appendix "Feasible Actor Critic"; Ma et al., 2021).

SAC under a limit of the expected cost in every state instead of on average: the multiplier is a network
lambda(s) = softplus(m(s)), 0.7 everywhere at first, and larger where the limit is hard to keep. With a batch
of transitions (s, a, r, c, gamma^k, s') and a' ~ pi(.|s'), a_pi ~ pi(.|s):

    targets     y   = r + gamma^k [ min_i Q_i(s', a'; targets) - alpha log pi(a'|s') ]
                y_c = c + gamma^k   max_i Q_c,i(s', a'; targets)
    critics     L   = sum_i mean_B (Q_i(s, a) - y)^2 / 2,  the same for Q_c and y_c
    policy      L   = mean_B [ alpha log pi(a_pi|s) - min_i Q_i(s, a_pi) + lambda(s) (Q_c(s, a_pi) - d_th) ]
    multiplier  L   = -mean_B [ lambda(s) (Q_c(s, a_pi) - d_th) ]   in every m-th update only

with Q_c = max_i Q_c,i. The multiplier learns more slowly than the policy, so that the policy can follow it.
"""

from __future__ import annotations

from dataclasses import dataclass

from torch import Tensor
from torch.nn.functional import softplus

from rudc.learning.algorithms import FacConfig
from rudc.learning.batch import Batch
from rudc.learning.config import Problem
from rudc.learning.costs import CostLearner, CostStatistics
from rudc.learning.observer import Observer
from rudc.learning.parameters import MULTIPLIER


@dataclass(frozen=True)
class FacStatistics(CostStatistics):
    """Statistics of SAC with cost critics, and those of the multiplier."""

    multiplier: float
    """lambda(s), mean over the batch, reward units over units of cost"""
    largest_multiplier: float
    """lambda(s), largest of the batch"""


class FacLearner(CostLearner):
    """SAC under a limit of the expected cost in every state."""

    statistics = FacStatistics

    def __init__(self, config: FacConfig, problem: Problem, device: str = "cpu") -> None:
        super().__init__(config, problem, device)
        self.limit, self.delay = config.cost_limit, config.multiplier_delay
        self.multiplier = Observer(config, problem, self.device, tag=MULTIPLIER, outputs=1)
        rates = (config.multiplier_rate, config.multiplier_rate)
        self.multiplier_descent = self.learns("multiplier", self.multiplier, rates)

    def lagrange(self, observation: Tensor) -> Tensor:
        """lambda > 0 at observations (B, size), (B,), reward units over units of cost; differentiable."""
        return softplus(self.multiplier(observation)[:, 0])

    def update(self, batch: Batch) -> FacStatistics:
        """One gradient step of critics, policy and temperature, one step of the targets; of the multiplier in
        every m-th update.
        """
        seen, alpha = self.tensors(batch), self.temperature.value
        after = self.draw_after(seen)
        said = self.learn_critics(seen, after) | self.learn_costs(seen, seen.action, after)

        drawn = self.draw(seen.state)
        value = self.critics.value(seen.state, drawn.action)
        excess = self.costs.value(seen.state, drawn.action) - self.limit
        lagrange = self.lagrange(seen.state)
        policy_loss = (alpha * drawn.log_probability - value + lagrange.detach() * excess).mean()
        said |= self.learn_policy(policy_loss, drawn, value)

        if (self.updates + 1) % self.delay == 0:
            loss = -(lagrange * excess.detach()).mean()
            self.multiplier_descent.differentiate(loss, 1.0)
            self.multiplier_descent.step()
        self.follow()
        return FacStatistics(
            **said,
            cost_value=float(excess.detach().mean()) + self.limit,
            multiplier=float(lagrange.detach().mean()),
            largest_multiplier=float(lagrange.detach().max()),
        )
