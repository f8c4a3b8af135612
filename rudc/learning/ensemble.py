"""Ensemble of quantile critics with randomised priors, and their targets (paper, "Ensemble Learning").

Eq. (fpn): the return of member n is that of a trained network O and a frozen one F of the same architecture,

    Z_n = (O_n + rho F_n) / (1 + rho).

Taken literally, returns of 100 ask outputs of 1,100 of O at rho = 10, whose gradient is 11 times smaller than
without prior: an optimiser with steps of a fixed size, as Adam's, gets there 11 times later. So O and F are
networks with fixed gains at their heads, in units of reward (o and f are the bare networks, outputs of order
one):

    O_n = (1 + rho) V o_n      V = value_scale, the order of the returns
    F_n = P f_n                P = prior_scale, the spread of the priors
    Z_n = V o_n + rho / (1 + rho) P f_n

Eq. (fpn) holds as it stands; o_n has to learn returns of order one whatever rho; and rho decides how much of
the prior is seen. Before the first update f_n is normalised: its root mean square over outputs and over the
observations and actions that learning starts from is made 1, by its last map. More than half of that is a
constant of each output, which differs between members and quantiles but not between states. It is kept:
without it, members tell situations that they never saw less well from those that they did. The AUROC of
sigma_epi is then 0.64 and 0.67 (two seeds), but 0.78 and 0.81 with priors as drawn, whose root mean square is
P = 12, and 0.73 and 0.79 at P = 10 (tests/benchmarks/prior_trial.py). Priors with one output for all
quantiles are no better (0.64). The root mean squares are stored with the agent. With P much smaller than the
returns, priors would have no effect; with P much larger, they would hide the returns.

Targets (Eq. (td_ensemble)): all members learn the same target, the mean over the target members of each
quantile. The prior belongs to the target too. All weights lie in one stack [targets, priors, trained]:
targets and priors, priors and trained networks are evaluated together.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from rudc.learning.config import EnsembleConfig, Problem
from rudc.learning.networks import Stack
from rudc.learning.parameters import critic_arrays, group, normalised, prior_arrays
from rudc.learning.saving import State, array
from rudc.learning.tracked import Tracked


class CriticEnsemble(Tracked):
    """N critics, their targets and priors. Quantiles are (N, B, N_q) in reward units."""

    def __init__(self, config: EnsembleConfig, problem: Problem, device: torch.device) -> None:
        super().__init__(config.target_rate)
        self.config = config
        self.stack = Stack(problem.layout, config.critic)
        trained, prior = critic_arrays(config, problem), prior_arrays(config, problem)
        members = config.members
        stacks = {k: np.concatenate([v, *([prior[k]] if prior else []), v]) for k, v in trained.items()}
        weights = {k: torch.from_numpy(v).to(device) for k, v in stacks.items()}
        self._frozen = {k: v[:-members] for k, v in weights.items()}
        """[targets, priors]"""
        self._current = {k: v[members:] for k, v in weights.items()}
        """[priors, trained], without gradients"""
        self.target = {k: v[:members] for k, v in weights.items()}
        self.prior = {k: v[members:-members] for k, v in weights.items()}
        self.trained = {k: v[-members:].requires_grad_() for k, v in weights.items()}
        self.normal: State = {}
        """`rms` (N, 1, 1), by which the priors were divided; empty before"""
        self._problem, self._share = problem, config.prior_share

    @property
    def has_prior(self) -> bool:
        """Whether there are priors (rho > 0)."""
        return self.config.prior_factor > 0

    def combine(self, trained: Tensor, prior: Tensor | None) -> Tensor:
        """Eq. (fpn) from the outputs of the bare networks o and f."""
        z = self.config.value_scale * trained
        return z if prior is None else z + self._share * prior

    @torch.no_grad()
    def prior_latent(self, observation: Tensor) -> Tensor | None:
        """Latents of the priors, (N, B, hidden)."""
        return self.stack.encode(self.prior, observation) if self.has_prior else None

    def quantiles(self, latent: Tensor, prior_latent: Tensor | None, action: Tensor) -> Tensor:
        """Z_n at (latents, actions); gradients reach the trained weights only."""
        prior = None
        if prior_latent is not None:
            with torch.no_grad():
                prior = self.stack.decode(self.prior, prior_latent, action)
        return self.combine(self.stack.decode(self.trained, latent, action), prior)

    def objective(
        self, latent: Tensor, prior_latent: Tensor | None, action: Tensor, weights: Tensor
    ) -> Tensor:
        """Mean over members of sum_i weights_i Z_n,i, (B,); gradients reach the action only.

        The weighted sum is linear in the outputs, so it is taken on the last map's weights: one output
        instead of N_q. Latents do not depend on the action.
        """
        latents = latent.detach() if prior_latent is None else torch.cat([prior_latent, latent.detach()])
        values = self.stack.decode(_collapsed(self._current, weights), latents, action)[..., 0]
        members = self.config.members
        prior = None if prior_latent is None else values[:-members]
        return self.combine(values[-members:], prior).mean(dim=0)

    @torch.no_grad()
    def mean_target(self, observation: Tensor, action: Tensor) -> Tensor:
        """Mean over the target members of each quantile, (B, N_q) (Eq. (td_ensemble))."""
        outputs = self.stack.decode(self._frozen, self.stack.encode(self._frozen, observation), action)
        members = self.config.members
        prior = outputs[members:].mean(dim=0) if self.has_prior else None
        return self.combine(outputs[:members].mean(dim=0), prior)

    @torch.no_grad()
    def evaluate(self, observation: Tensor, action: Tensor) -> Tensor:
        """Quantiles of the trained critics, without gradients."""
        latent = self.stack.encode(self.trained, observation)
        return self.quantiles(latent, self.prior_latent(observation), action)

    @torch.no_grad()
    def normalise_priors(self, observation: Tensor, action: Tensor) -> None:
        """Give each prior a root mean square of 1 over its outputs at these states and actions (B, ...)."""
        latent = self.prior_latent(observation)
        if latent is None:
            return
        outputs = self.stack.decode(self.prior, latent, action)
        self._take_normal({"rms": array(outputs.square().mean(dim=(1, 2), keepdim=True).sqrt())})

    @torch.no_grad()
    def _take_normal(self, normal: State) -> None:
        self.normal = normal
        for name, value in normalised(prior_arrays(self.config, self._problem), **normal).items():
            self.prior[name].copy_(torch.from_numpy(value))

    def state(self) -> State:
        """Trained and target weights, and what the priors were normalised with."""
        return super().state() | {f"normal/{k}": v.copy() for k, v in self.normal.items()}

    def load(self, state: Mapping[str, NDArray]) -> None:
        """Take over what `state` gave. KeyError or ValueError if it does not fit."""
        super().load(state)
        if normal := group(state, "normal"):
            self._take_normal(normal)


def _collapsed(weights: Mapping[str, Tensor], by: Tensor) -> dict[str, Tensor]:
    """The same networks with one output, the sum of their outputs weighted `by` (N_q,)."""
    out = {name: weights[name] @ by[:, None] for name in ("out.weight", "out.bias")}
    return {**weights, **out}
