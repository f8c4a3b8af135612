"""One update of Recovery RL on SAC (paper, appendix "Safety Recovery"; Thananjeyan et al., 2021).

There are two policies: the task policy pi maximises the return alone, the recovery policy pi_rec minimises
the risk. With a batch of transitions (s, a, a_task, r, c, gamma^k, s'), where a was executed and a_task was
what pi proposed, and a' ~ pi(.|s'), a_pi ~ pi(.|s):

    targets   y   = r + gamma^k [ min_i Q_i(s', a'; targets) - alpha log pi(a'|s') ]
              y_c = c + gamma^k   max_i Q_risk,i(s', a'; targets)
    critics   L   = sum_i mean_B (Q_i(s, a_task) - y)^2 / 2
              L   = sum_i mean_B (Q_risk,i(s, a) - y_c)^2 / 2
    policy    L   = mean_B [ alpha log pi(a_pi|s) - min_i Q_i(s, a_pi) ]
    recovery  L   = mean_B Q_risk(s, pi_rec(s)),  pi_rec deterministic

with Q_risk = max_i Q_risk,i, of the unified step-wise cost as the paper has it (in Recovery RL itself, of the
event of a violation). What follows when the recovery policy takes over is counted for the task policy's
proposal (`learns_from=proposed`), so that the task policy learns to stay away from there. pi_rec acts where
Q_risk(s, a_task) > d_th (rudc/agents/of_actions.py, `recovery`).
"""

from __future__ import annotations

from dataclasses import dataclass

from rudc.arrays import Arrays
from rudc.learning.algorithms import RecoveryConfig
from rudc.learning.batch import Batch
from rudc.learning.config import Problem
from rudc.learning.costs import CostLearner, CostStatistics
from rudc.learning.parameters import RECOVERY, grouped
from rudc.learning.policy import Policy


@dataclass(frozen=True)
class RecoveryStatistics(CostStatistics):
    """Statistics of SAC with cost critics, and that of the recovery policy."""

    recovery_cost: float
    """Q_risk of the recovery policy's actions, mean over the batch"""


class RecoveryLearner(CostLearner):
    """SAC, and a second policy that minimises the risk."""

    statistics = RecoveryStatistics

    def __init__(self, config: RecoveryConfig, problem: Problem, device: str = "cpu") -> None:
        super().__init__(config, problem, device)
        self._cost_scale = config.cost_scale
        self.recovery = Policy(config, problem, self.device, tag=RECOVERY)
        self.recovery_descent = self.learns("recovery", self.recovery, config.actor_rate)

    def update(self, batch: Batch) -> RecoveryStatistics:
        """One gradient step of critics, both policies and temperature, one step of the targets."""
        seen, executed, alpha = self.tensors(batch), self.tensor(batch.executed), self.temperature.value
        after = self.draw_after(seen)
        said = self.learn_critics(seen, after) | self.learn_costs(seen, executed, after)

        drawn = self.draw(seen.state)
        value = self.critics.value(seen.state, drawn.action)
        policy_loss = (alpha * drawn.log_probability - value).mean()
        said |= self.learn_policy(policy_loss, drawn, value)

        risk = self.costs.value(seen.state, self.recovery.likely(seen.state)).mean()
        self.recovery_descent.differentiate(risk, self._cost_scale)
        self.recovery_descent.step()

        cost = self.costs.value(seen.state, drawn.action.detach())
        self.follow()
        return RecoveryStatistics(**said, cost_value=float(cost.mean()), recovery_cost=float(risk.detach()))

    def weights(self) -> Arrays:
        """`policy/...`, `critic/...`, `cost/...` and `recovery/...`."""
        return super().weights() | grouped(recovery=self.recovery.arrays())
