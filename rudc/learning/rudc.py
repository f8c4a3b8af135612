"""One update of RUDC's learner: distributional soft actor-critic, ensemble of critics, distorted objective.

Paper, Sec. "Uncertainty-aware Risk-sensitive Reinforcement Learning". With a batch of transitions (s, a, r,
gamma^k, s'):

    target   y_i = r + gamma^k [ mean_n Z_n,i(s', a'; targets) - alpha log pi_target(a'|s') ]
    critics  L_n = mean_B m_n sum_j (1 / N_q) sum_i rho_j(y_i - Z_n,j(s, a))
    policy   L = mean_B [ alpha log pi(a_pi|s) - mean_n Xi(Z_n(s, a_pi)) ]
    alpha    L = -log alpha mean_B [ log pi(a_pi|s) + target entropy ]

which are Eqs. (td_ensemble), (ensemble_huber_loss) and (actor_loss_ensemble) for the first three.

Xi is the distorted expectation (CVaR_beta). The gradients of critics and policy are taken at the same
weights, and then all step: the states' latents, which do not depend on the action, are computed once for
both. Critics share nothing but the batch and the target: each has its own weights, prior and mask, and its
gradient is clipped on its own. Units are those of reward.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from rudc.arrays import Arrays
from rudc.learning.batch import Batch
from rudc.learning.config import EnsembleConfig, Problem
from rudc.learning.ensemble import CriticEnsemble
from rudc.learning.learner import SoftActorCritic, Statistics, Tensors
from rudc.learning.parameters import grouped
from rudc.learning.policy import Policy
from rudc.learning.quantiles import quantile_huber
from rudc.learning.recorded import Recorded
from rudc.learning.saving import array
from rudc.learning.uncertainty import uncertainty


class RudcLearner(SoftActorCritic):
    """Learns from batches; the same seed and batches give the same numbers."""

    def __init__(self, config: EnsembleConfig, problem: Problem, device: str = "cpu") -> None:
        super().__init__(config, problem, device)
        self.config = config
        self.masks = (config.members, config.mask_probability)
        self.critics = CriticEnsemble(config, problem, self.device)
        self.policy = Policy(config, problem, self.device, target=True)
        self.critic_descent = self.learns("critic", self.critics, config.critic_rate)
        self.policy_descent = self.learns("policy", self.policy, config.actor_rate)
        weights = config.risk().weights(config.quantiles)
        self._weights = torch.tensor(weights, dtype=torch.float32, device=self.device)
        self._recorded = Recorded(self._compute, self.device)

    def start(self, batch: Batch) -> None:
        """Normalise the priors on what was seen (see ensemble.py)."""
        self.critics.normalise_priors(self.tensor(batch.observation), self.tensor(batch.executed))

    def update(self, batch: Batch) -> Statistics:
        """One gradient step of critics, policy and temperature, one step of the targets."""
        seen = self.tensors(batch)
        mask = self.tensor(np.ascontiguousarray(batch.mask.T, dtype=np.float32))
        noise = self.noise(*seen.action.shape), self.noise(*seen.action.shape)
        self.critic_descent.advance()
        self.policy_descent.advance()
        said = self._recorded(*seen, mask, *noise)
        self.updates += 1
        return Statistics(*map(float, said.cpu()))

    def _compute(self, *given: Tensor) -> Tensor:
        """An update from tensors alone: the numbers of `Statistics`, in their order."""
        seen, (mask, noise_after, noise) = Tensors._make(given[:-3]), given[-3:]
        alpha = self.temperature.value
        with torch.no_grad():
            after = self.policy.draw(self.policy.target, seen.after, noise_after)
            future = self.critics.mean_target(seen.after, after.action)
            future -= (alpha * after.log_probability)[:, None]
            target = seen.reward[:, None] + seen.discount[:, None] * future

        latent = self.critics.stack.encode(self.critics.trained, seen.state)
        prior_latent = self.critics.prior_latent(seen.state)
        quantiles = self.critics.quantiles(latent, prior_latent, seen.action)
        member_loss = (mask * quantile_huber(quantiles, target, self.config.kappa)).mean(dim=1)  # (N,)
        critic_norms = self.critic_descent.differentiate(member_loss.sum(), self.config.value_scale)

        drawn = self.policy.draw(self.policy.trained, seen.state, noise)
        value = self.critics.objective(latent, prior_latent, drawn.action, self._weights)
        policy_loss = (alpha * drawn.log_probability - value).mean()
        policy_norm = self.policy_descent.differentiate(policy_loss, self.config.value_scale)

        entropy = -drawn.log_probability.detach().mean()
        self.critic_descent.follow()
        self.policy_descent.follow()
        self.temperature.step(entropy)
        self.critics.follow()
        self.policy.follow()
        losses = member_loss.mean(), policy_loss, value.mean(), target.mean(), entropy, alpha
        norms = critic_norms.max(), policy_norm
        return torch.stack([number.detach().reshape(()) for number in (*losses, *norms)])

    def load(self, state: Mapping[str, NDArray]) -> None:
        """See `Learner`."""
        self._recorded.forget()
        super().load(state)

    def sigma(self, observation: NDArray, action: NDArray) -> NDArray:
        """sigma_total (B,) of what follows from actions (B, actions), reward units."""
        z = self.critics.evaluate(self.tensor(observation), self.tensor(action))
        return uncertainty(z.cpu().numpy(), self.config.beta).total

    def weights(self) -> Arrays:
        """`policy/...`, `critic/...`, the frozen `prior/...` and `normal/...`, which priors were normalised
        with.
        """
        prior = {k: array(v) for k, v in self.critics.prior.items()} if self.critics.has_prior else {}
        return grouped(
            policy=self.policy.arrays(), critic=self.critics.arrays(), prior=prior, normal=self.critics.normal
        )
