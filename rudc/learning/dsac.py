"""One update of distributional soft actor-critic, risk-neutral (paper, "DSAC"; Ma et al., 2025).

SAC whose two critics give N_q quantiles Z_1 <= ... <= Z_Nq of the return at fixed fractions instead of its
mean. With a batch of transitions (s, a, r, gamma^k, s') and a' ~ pi(.|s'), a_pi ~ pi(.|s):

    targets  y_j = r + gamma^k [ min_i Z_i,j(s', a'; targets) - alpha log pi(a'|s') ]
    critics  L = sum_i mean_B sum_j (1 / N_q) sum_k rho_j(y_k - Z_i,j(s, a))
    policy   L = mean_B [ alpha log pi(a_pi|s) - min_i (1 / N_q) sum_j Z_i,j(s, a_pi) ]

rho_j is the quantile Huber loss (quantiles.py). One pair of critics: neither ensemble nor priors, and no
distortion of the expectation. Temperature and order of the steps are SAC's.
"""

from __future__ import annotations

import torch
from torch import Tensor

from rudc.learning.algorithms import DistributionalConfig
from rudc.learning.config import Problem
from rudc.learning.descent import Descent
from rudc.learning.learner import Tensors
from rudc.learning.networks import Weights
from rudc.learning.policy import Drawn
from rudc.learning.quantiles import quantile_huber
from rudc.learning.sac import SacLearner
from rudc.learning.twins import TwinCritics


class QuantileTwins(TwinCritics):
    """Z_1 and Z_2, N_q quantiles each in reward units; what counts as a value is the smaller mean."""

    def __init__(self, config: DistributionalConfig, problem: Problem, device: torch.device) -> None:
        super().__init__(config, problem, device, outputs=config.quantiles)
        self._kappa = config.kappa

    def quantiles(self, weights: Weights, observation: Tensor, action: Tensor) -> Tensor:
        """Z_i at (s, a), (2, B, N_q)."""
        return self._scale * self.stack.decode(weights, self.stack.encode(weights, observation), action)

    def both(self, weights: Weights, observation: Tensor, action: Tensor) -> Tensor:
        """Means of Z_i at (s, a), (2, B)."""
        return self.quantiles(weights, observation, action).mean(dim=2)

    def target_quantiles(self, observation: Tensor, action: Tensor) -> Tensor:
        """min_i Z_i,j of the targets, (B, N_q)."""
        return self.quantiles(self.target, observation, action).min(dim=0).values

    def learn(
        self, descent: Descent, observation: Tensor, action: Tensor, target: Tensor
    ) -> tuple[float, float]:
        """One step towards targets y (B, N_q): mean loss of the two, the larger norm of their gradients."""
        predicted = self.quantiles(self.trained, observation, action)
        losses = quantile_huber(predicted, target, self._kappa).mean(dim=1)
        norms = descent.differentiate(losses.sum(), self._scale)
        descent.step()
        return float(losses.detach().mean()), float(norms.max())


class DsacLearner(SacLearner):
    """SAC with distributions of the return."""

    def __init__(self, config: DistributionalConfig, problem: Problem, device: str = "cpu") -> None:
        self._distributional = config
        super().__init__(config, problem, device)

    def make_critics(self) -> TwinCritics:
        """Critics that give quantiles."""
        self.twins = QuantileTwins(self._distributional, self._problem, self.device)
        return self.twins

    def learn_critics(self, seen: Tensors, after: Drawn) -> dict[str, float]:
        """One step of the critics towards y_j with a' = `after`."""
        alpha = self.temperature.value
        with torch.no_grad():
            future = self.twins.target_quantiles(seen.after, after.action)
            future = future - (alpha * after.log_probability)[:, None]
            target = seen.reward[:, None] + seen.discount[:, None] * future
        return self.critics_to(seen, target)
