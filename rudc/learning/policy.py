"""The policy: a Gaussian squashed into [-1, 1] (soft actor-critic).

u ~ N(mean(s), std(s)^2),  a = tanh(u)
log pi(a|s) = sum_k [ log N(u_k) - log(1 - tanh(u_k)^2) ],
              log(1 - tanh(u)^2) = 2 (log 2 - u - softplus(-2 u))
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import torch
from torch import Tensor
from torch.nn.functional import softplus

from rudc.learning.config import LearnerConfig, Problem
from rudc.learning.networks import Stack
from rudc.learning.parameters import POLICY, policy_arrays
from rudc.learning.tracked import Tracked


class Drawn(NamedTuple):
    """Actions drawn from the policy."""

    action: Tensor
    """(B, actions)"""
    log_probability: Tensor
    """(B,), nats"""


class Policy(Tracked):
    """A policy that learns, and, where one is wanted, the target policy that follows it."""

    def __init__(
        self,
        config: LearnerConfig,
        problem: Problem,
        device: torch.device,
        *,
        target: bool = False,
        tag: int = POLICY,
    ) -> None:
        """`target`: whether one follows it; `tag`: which initial weights."""
        super().__init__(config.target_rate)
        self.stack = Stack(problem.layout, config.policy)
        self._log_std = config.log_std
        arrays = policy_arrays(config, problem, tag)
        self.trained = {k: torch.tensor(v, device=device, requires_grad=True) for k, v in arrays.items()}
        followed = arrays if target else {}
        self.target = {k: torch.tensor(v, device=device) for k, v in followed.items()}

    def distribution(self, weights: Mapping[str, Tensor], observation: Tensor) -> tuple[Tensor, Tensor]:
        """Mean and logarithm of the standard deviation before squashing, (B, actions) each."""
        outputs = self.stack.decode(weights, self.stack.encode(weights, observation))[0]
        mean, log_std = outputs.chunk(2, dim=1)
        return mean, log_std.clamp(*self._log_std)

    def likely(self, observation: Tensor) -> Tensor:
        """tanh of the mean, (B, actions), at observations (B, size), differentiable."""
        return self.distribution(self.trained, observation)[0].tanh()

    def draw(self, weights: Mapping[str, Tensor], observation: Tensor, noise: Tensor) -> Drawn:
        """Actions from standard normal noise (B, actions), differentiable."""
        mean, log_std = self.distribution(weights, observation)
        u = mean + log_std.exp() * noise
        log_normal = -0.5 * noise.square() - log_std - 0.5 * math.log(2 * math.pi)
        log_slope = 2 * (math.log(2) - u - softplus(-2 * u))
        return Drawn(u.tanh(), (log_normal - log_slope).sum(dim=1))
