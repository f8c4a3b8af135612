"""One update of SAC with an exact penalty, for unrolled corrections (paper, appendix "Unrolling Safety
Layer"; Zhang et al., 2023).

With a batch of transitions (s, a, r, c, gamma^k, s') and a' ~ pi(.|s'), a_pi ~ pi(.|s):

    targets  y   = r + gamma^k [ min_i Q_i(s', a'; targets) - alpha log pi(a'|s') ]
             y_c = c + gamma^k   max_i Q_c,i(s', a'; targets)
    critics  L   = sum_i mean_B (Q_i(s, a) - y)^2 / 2,  the same for Q_c and y_c
    policy   L   = mean_B [ alpha log pi(a_pi|s) - min_i Q_i(s, a_pi) + kappa [Q_c(s, a_pi) - d_th]^+ ]

with Q_c = max_i Q_c,i. With the penalty the limit is kept in most states; in the others the policy's action
is corrected before it is executed, at most K times (rudc/agents/of_actions.py, `usl`):

    a <- a - eta / Z grad_a [Q_c(s, a) - d_th]^+,  Z = max |grad_a [Q_c(s, a) - d_th]^+|
"""

from __future__ import annotations

from rudc.learning.algorithms import UslConfig
from rudc.learning.batch import Batch
from rudc.learning.config import Problem
from rudc.learning.costs import CostLearner, CostStatistics


class UslLearner(CostLearner):
    """SAC with a penalty on what exceeds the limit."""

    def __init__(self, config: UslConfig, problem: Problem, device: str = "cpu") -> None:
        super().__init__(config, problem, device)
        self.limit, self.penalty = config.cost_limit, config.penalty

    def update(self, batch: Batch) -> CostStatistics:
        """One gradient step of critics, policy and temperature, one step of the targets."""
        seen, alpha = self.tensors(batch), self.temperature.value
        after = self.draw_after(seen)
        said = self.learn_critics(seen, after) | self.learn_costs(seen, seen.action, after)

        drawn = self.draw(seen.state)
        value = self.critics.value(seen.state, drawn.action)
        cost = self.costs.value(seen.state, drawn.action)
        excess = (cost - self.limit).clamp(min=0)
        policy_loss = (alpha * drawn.log_probability - value + self.penalty * excess).mean()
        said |= self.learn_policy(policy_loss, drawn, value)

        self.follow()
        return CostStatistics(**said, cost_value=float(cost.detach().mean()))
