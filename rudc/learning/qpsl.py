"""One update of SAC behind a safety layer (paper, appendix "Safety Layer"; Dalal et al., 2018).

SAC as it is (sac.py), and a linear model of what one action does to the step-wise cost. With a batch of
transitions whose first decision a was taken at s, in a scene of cost c_{t-1}, and followed by the cost c_t:

    model    c_t = c_{t-1} + g(s) . a,  g(s) a network: by how much each number of an action raises the cost
    loss     L = mean_B (g(s) . a - (c_t - c_{t-1}))^2 / 2,  a the executed action

Costs are those of single decisions here, whatever n_step is. The model is learnt along with the policy, from
the same batches; Dalal et al. learn it beforehand from random actions. What is executed is the nearest action
to the policy's that the model allows (rudc/agents/of_actions.py, `qpsl`).
"""

from __future__ import annotations

from dataclasses import dataclass

from rudc.arrays import Arrays
from rudc.learning.algorithms import QpslConfig
from rudc.learning.batch import Batch
from rudc.learning.config import Problem
from rudc.learning.learner import Statistics
from rudc.learning.observer import Observer
from rudc.learning.parameters import CHANGE, grouped
from rudc.learning.sac import SacLearner


@dataclass(frozen=True)
class QpslStatistics(Statistics):
    """SAC's statistics, and that of the model."""

    change_error: float
    """root mean square of g(s) . a - (c_t - c_{t-1})"""


class QpslLearner(SacLearner):
    """SAC, and the safety layer's model."""

    statistics = QpslStatistics

    def __init__(self, config: QpslConfig, problem: Problem, device: str = "cpu") -> None:
        super().__init__(config, problem, device)
        self.change = Observer(config, problem, self.device, tag=CHANGE, outputs=problem.actions)
        self.change_descent = self.learns("change", self.change, config.critic_rate)

    def update(self, batch: Batch) -> QpslStatistics:
        """SAC's update, and one gradient step of the model."""
        said = super().update(batch)
        state, action = self.tensor(batch.observation), self.tensor(batch.executed)
        error = (self.change(state) * action).sum(dim=1) - self.tensor(batch.cost_change)
        self.change_descent.differentiate(error.square().mean() / 2, 1.0)
        self.change_descent.step()
        return QpslStatistics(**vars(said), change_error=float(error.detach().square().mean().sqrt()))

    def weights(self) -> Arrays:
        """`policy/...`, `critic/...` and `change/...`."""
        return super().weights() | grouped(change=self.change.arrays())
