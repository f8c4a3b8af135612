"""One update of SAC with a Lagrange multiplier (paper, appendix "Lagrangian Relaxation"; RCPO, SAC-Lag).

With a batch of transitions (s, a, r, c, gamma^k, s') and a' ~ pi(.|s'), a_pi ~ pi(.|s):

    targets     y   = r + gamma^k [ min_i Q_i(s', a'; targets) - alpha log pi(a'|s') ]
                y_c = c + gamma^k   max_i Q_c,i(s', a'; targets)
    critics     L   = sum_i mean_B (Q_i(s, a) - y)^2 / 2,  the same for Q_c and y_c
    policy      L   = mean_B [ alpha log pi(a_pi|s) - min_i Q_i(s, a_pi) + lambda (Q_c(s, a_pi) - d_th) ]
    multiplier  lambda <- max(0, lambda + rate mean_B (Q_c(s, a_pi) - d_th))

with Q_c = max_i Q_c,i.
"""

from __future__ import annotations

from dataclasses import dataclass

from rudc.learning.algorithms import LagrangianConfig
from rudc.learning.batch import Batch
from rudc.learning.config import Problem
from rudc.learning.costs import CostLearner, CostStatistics
from rudc.learning.multiplier import Multiplier


@dataclass(frozen=True)
class LagrangianStatistics(CostStatistics):
    """Statistics of SAC with cost critics, and that of the multiplier."""

    multiplier: float
    """lambda, reward units over units of cost"""


class SacLagrangianLearner(CostLearner):
    """SAC under a limit of the expected cost."""

    statistics = LagrangianStatistics

    def __init__(self, config: LagrangianConfig, problem: Problem, device: str = "cpu") -> None:
        super().__init__(config, problem, device)
        self.limit = config.cost_limit
        self.multiplier = Multiplier(config.multiplier, config.multiplier_rate, config.cost_limit)
        self.parts["multiplier"] = self.multiplier

    def update(self, batch: Batch) -> LagrangianStatistics:
        """One gradient step of critics, policy and temperature, one step of multiplier and targets."""
        seen, alpha, lagrange = self.tensors(batch), self.temperature.value, self.multiplier.value
        after = self.draw_after(seen)
        said = self.learn_critics(seen, after) | self.learn_costs(seen, seen.action, after)

        drawn = self.draw(seen.state)
        value = self.critics.value(seen.state, drawn.action)
        cost = self.costs.value(seen.state, drawn.action)
        policy_loss = (alpha * drawn.log_probability - value + lagrange * (cost - self.limit)).mean()
        said |= self.learn_policy(policy_loss, drawn, value)

        said["cost_value"] = float(cost.detach().mean())
        self.multiplier.step(said["cost_value"])
        self.follow()
        return LagrangianStatistics(**said, multiplier=lagrange)
