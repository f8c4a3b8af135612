"""Two critics of one number each, and their targets: rewards of plain SAC, costs of constrained methods.

Q_i = scale q_i, where q_i is the bare network: it has to learn returns of order one. Two estimates are made
one by the smaller (`min`, rewards: clipped double Q-learning) or the larger (`max`, costs: a violation is
not underestimated).
"""

from __future__ import annotations

from typing import Literal

import torch
from torch import Tensor

from rudc.learning.config import LearnerConfig, Problem
from rudc.learning.descent import Descent
from rudc.learning.networks import Stack, Weights
from rudc.learning.parameters import CRITIC, twin_arrays
from rudc.learning.tracked import Tracked


class TwinCritics(Tracked):
    """Q_1 and Q_2, in units of reward or of cost."""

    def __init__(
        self,
        config: LearnerConfig,
        problem: Problem,
        device: torch.device,
        *,
        tag: int = CRITIC,
        scale: float | None = None,
        pick: Literal["min", "max"] = "min",
        outputs: int = 1,
    ) -> None:
        """`tag`: which initial weights; `scale`: what one unit of a bare output is worth, None for
        value_scale; `pick`: which of the two estimates counts; `outputs`: of each bare network.
        """
        super().__init__(config.target_rate)
        self.stack = Stack(problem.layout, config.critic)
        arrays = twin_arrays(config, problem, tag, outputs)
        self.trained = {k: torch.tensor(v, device=device, requires_grad=True) for k, v in arrays.items()}
        self.target = {k: torch.tensor(v, device=device) for k, v in arrays.items()}
        self._fixed = {k: v.detach() for k, v in self.trained.items()}
        self._scale = config.value_scale if scale is None else scale
        self._pick = pick

    def both(self, weights: Weights, observation: Tensor, action: Tensor) -> Tensor:
        """Q_i at (s, a), (2, B)."""
        return self._scale * self.stack.decode(
            weights, self.stack.encode(weights, observation), action
        ).squeeze(2)

    def value(self, observation: Tensor, action: Tensor) -> Tensor:
        """The estimate that counts, (B,); gradients reach the action only."""
        return self._one(self.both(self._fixed, observation, action))

    def target_value(self, observation: Tensor, action: Tensor) -> Tensor:
        """The same of the targets."""
        return self._one(self.both(self.target, observation, action))

    def learn(
        self, descent: Descent, observation: Tensor, action: Tensor, target: Tensor
    ) -> tuple[float, float]:
        """One step towards targets y (B,):  L = sum_i mean_B (Q_i(s, a) - y)^2 / 2.  Mean loss of the two, in
        squared units, and the larger norm of their gradients.
        """
        losses = 0.5 * (self.both(self.trained, observation, action) - target).square().mean(dim=1)
        norms = descent.differentiate(losses.sum(), self._scale**2)
        descent.step()
        return float(losses.detach().mean()), float(norms.max())

    def _one(self, both: Tensor) -> Tensor:
        return both.min(dim=0).values if self._pick == "min" else both.max(dim=0).values
