"""One update of soft actor-critic (Haarnoja et al., "Soft Actor-Critic Algorithms and Applications", 2019).

With a batch of transitions (s, a, r, gamma^k, s') and a' ~ pi(.|s'), a_pi ~ pi(.|s):

    target   y = r + gamma^k [ min_i Q_i(s', a'; targets) - alpha log pi(a'|s') ]
    critics  L = sum_i mean_B (Q_i(s, a) - y)^2 / 2
    policy   L = mean_B [ alpha log pi(a_pi|s) - min_i Q_i(s, a_pi) ]
    alpha    L = -log alpha mean_B [ log pi(a_pi|s) + target entropy ]

The critics step first, and the policy's loss takes the critics after their step.
"""

from __future__ import annotations

import torch

from rudc.arrays import Arrays
from rudc.learning.batch import Batch
from rudc.learning.config import LearnerConfig, Problem
from rudc.learning.learner import SoftActorCritic, Statistics, Tensors
from rudc.learning.parameters import grouped
from rudc.learning.policy import Drawn, Policy
from rudc.learning.twins import TwinCritics


class SacLearner(SoftActorCritic):
    """Learns from batches; the same seed and batches give the same numbers."""

    def __init__(self, config: LearnerConfig, problem: Problem, device: str = "cpu") -> None:
        super().__init__(config, problem, device)
        self.config = config
        self.critics = self.make_critics()
        self.policy = Policy(config, problem, self.device)
        self.critic_descent = self.learns("critic", self.critics, config.critic_rate)
        self.policy_descent = self.learns("policy", self.policy, config.actor_rate)

    def make_critics(self) -> TwinCritics:
        """Critics of the return that have learnt nothing."""
        return TwinCritics(self.config, self._problem, self.device)

    def update(self, batch: Batch) -> Statistics:
        """One gradient step of critics, policy and temperature, one step of the targets."""
        seen, alpha = self.tensors(batch), self.temperature.value
        said = self.learn_critics(seen, self.draw_after(seen))

        drawn = self.draw(seen.state)
        value = self.critics.value(seen.state, drawn.action)
        policy_loss = (alpha * drawn.log_probability - value).mean()
        said |= self.learn_policy(policy_loss, drawn, value)

        self.critics.follow()
        self.updates += 1
        return Statistics(**said)

    def learn_critics(self, seen: Tensors, after: Drawn) -> dict[str, float]:
        """One step of the critics towards y with a' = `after`; gives their part of `Statistics`."""
        alpha = self.temperature.value
        with torch.no_grad():
            future = self.critics.target_value(seen.after, after.action) - alpha * after.log_probability
            target = seen.reward + seen.discount * future
        return self.critics_to(seen, target)

    def critics_to(self, seen: Tensors, target: torch.Tensor) -> dict[str, float]:
        """One step of the critics towards these targets, as they take them."""
        loss, norm = self.critics.learn(self.critic_descent, seen.state, seen.action, target)
        return {"critic_loss": loss, "critic_gradient": norm, "target": float(target.mean())}

    def learn_policy(self, loss: torch.Tensor, drawn: Drawn, value: torch.Tensor) -> dict[str, float]:
        """One step of the policy down its loss, and of the temperature; gives their part of `Statistics`.
        `drawn` is a_pi, `value` (B,) what the critics say of it.
        """
        alpha, entropy = self.temperature.value, -drawn.log_probability.detach().mean()
        norm = self.policy_descent.differentiate(loss, self.config.value_scale)
        self.policy_descent.step()
        self.temperature.step(entropy)
        return {
            "policy_loss": float(loss.detach()),
            "value": float(value.detach().mean()),
            "entropy": float(entropy),
            "temperature": float(alpha),
            "policy_gradient": float(norm),
        }

    @torch.no_grad()
    def draw_after(self, seen: Tensors) -> Drawn:
        """a' of the policy at s', without gradients."""
        return self.draw(seen.after)

    def draw(self, observation: torch.Tensor) -> Drawn:
        """Actions of the policy as it is, differentiable."""
        return self.policy.draw(
            self.policy.trained, observation, self.noise(len(observation), self._problem.actions)
        )

    def weights(self) -> Arrays:
        """`policy/...` and `critic/...`."""
        return grouped(policy=self.policy.arrays(), critic=self.critics.arrays())
