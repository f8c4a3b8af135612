"""`Observer`: a network of the observation alone, such as FAC's multiplier and QPSL's change of cost."""

from __future__ import annotations

import torch
from torch import Tensor

from rudc.learning.config import LearnerConfig, Problem
from rudc.learning.networks import Stack
from rudc.learning.parameters import observer_arrays
from rudc.learning.tracked import Tracked


class Observer(Tracked):
    """A network that is built as critics are, but takes no action; it has no target."""

    def __init__(
        self, config: LearnerConfig, problem: Problem, device: torch.device, *, tag: int, outputs: int
    ) -> None:
        """`tag`: which initial weights; `outputs`: how many numbers it gives, near 0 at first."""
        super().__init__(config.target_rate)
        self.stack = Stack(problem.layout, config.critic)
        arrays = observer_arrays(config.critic, problem, tag, outputs)
        self.trained = {k: torch.tensor(v, device=device, requires_grad=True) for k, v in arrays.items()}
        self.target = {}

    def __call__(self, observation: Tensor) -> Tensor:
        """Its numbers at observations (B, size), (B, outputs), differentiable."""
        return self.stack.decode(self.trained, self.stack.encode(self.trained, observation))[0]
