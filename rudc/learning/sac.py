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
gradient is clipped on its own. Units are those of reward; losses are divided by value_scale before
differentiation, so that gradients are of order one.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from rudc.arrays import Arrays
from rudc.errors import AgentError
from rudc.learning.batch import Batch
from rudc.learning.config import LearnerConfig
from rudc.learning.ensemble import CriticEnsemble
from rudc.learning.policy import Policy
from rudc.learning.quantiles import quantile_huber


class RudcLearner:
    """Learns from batches; the same seed and batches give the same numbers."""

    def __init__(self, config: LearnerConfig, device: str = "cpu") -> None:
        self.config = config
        self.device = torch.device(device)
        self.critics = CriticEnsemble(config, self.device)
        self.policy = Policy(config, self.device)
        self.updates = 0
        self._log_alpha = torch.tensor([math.log(config.temperature)], device=self.device, requires_grad=True)
        self._generator = torch.Generator()  # on the CPU: the same draws on any device
        self._generator.manual_seed(config.seed)
        weights = config.risk().weights(config.quantiles)
        self._weights = torch.tensor(weights, dtype=torch.float32, device=self.device)
        self._entropy = -float(config.actions) if config.target_entropy is None else config.target_entropy
        self._optimizers = {
            "critic": _adam(self.critics.trained.values(), config.critic_rate[0]),
            "policy": _adam(self.policy.trained.values(), config.actor_rate[0]),
            "temperature": _adam([self._log_alpha], config.temperature_rate),
        }

    @property
    def temperature(self) -> float:
        """alpha_tem, reward units a nat."""
        return float(self._log_alpha.detach().exp())

    def learning_rates(self) -> dict[str, float]:
        """Rates that the last update used, by optimiser."""
        return {name: float(adam.param_groups[0]["lr"]) for name, adam in self._optimizers.items()}

    def update(self, batch: Batch) -> dict[str, float]:
        """One gradient step of critics, policy and temperature, one step of the targets; losses by name."""
        observation, action, reward, discount, after, mask = self._tensors(batch)
        alpha = self._log_alpha.detach().exp()
        target = self._target(reward, discount, after, alpha)
        latent = self.critics.stack.encode(self.critics.trained, observation)
        prior_latent = self.critics.prior_latent(observation)
        quantiles = self.critics.quantiles(latent, prior_latent, action)
        member_loss = (mask * quantile_huber(quantiles, target, self.config.kappa)).mean(dim=1)  # (N,)
        critic_norms = self._differentiate(member_loss.sum(), self.critics.trained)

        drawn = self.policy.draw(self.policy.trained, observation, self._noise(len(reward)))
        value = self.critics.objective(latent, prior_latent, drawn.action, self._weights)
        policy_loss = (alpha * drawn.log_probability - value).mean()
        policy_norm = self._differentiate(policy_loss, self.policy.trained)

        entropy = -drawn.log_probability.detach().mean()
        self._step(entropy)
        return {
            "critic_loss": float(member_loss.detach().mean()),
            "policy_loss": float(policy_loss.detach()),
            "value": float(value.detach().mean()),
            "target": float(target.mean()),
            "entropy": float(entropy),
            "temperature": float(alpha),
            "critic_gradient": float(critic_norms.max()),
            "policy_gradient": float(policy_norm),
        }

    def _tensors(self, batch: Batch) -> tuple[Tensor, Tensor, Tensor, Tensor, Tensor, Tensor]:
        discount = np.where(batch.terminal, np.float32(0), batch.discount)
        mask = np.ascontiguousarray(batch.mask.T, dtype=np.float32)
        arrays = (batch.observation, batch.action, batch.reward, discount, batch.next_observation, mask)
        return tuple(torch.from_numpy(array).to(self.device) for array in arrays)  # pyright: ignore[reportReturnType]

    def _noise(self, rows: int) -> Tensor:
        return torch.randn(rows, self.config.actions, generator=self._generator).to(self.device)

    @torch.no_grad()
    def _target(self, reward: Tensor, discount: Tensor, after: Tensor, alpha: Tensor) -> Tensor:
        """Targets y_i, (B, N_q)."""
        drawn = self.policy.draw(self.policy.target, after, self._noise(len(reward)))
        future = self.critics.mean_target(after, drawn.action) - (alpha * drawn.log_probability)[:, None]
        return reward[:, None] + discount[:, None] * future

    def _differentiate(self, loss: Tensor, weights: Mapping[str, Tensor]) -> Tensor:
        """Set the weights' gradients, clipped to max_gradient for each member; norms before that, (N,)."""
        leaves = list(weights.values())
        gradients = torch.autograd.grad(loss / self.config.value_scale, leaves)
        squares = torch.stack([torch.linalg.vector_norm(g, dim=(1, 2)) for g in gradients]).square_()
        norms = squares.sum(dim=0).sqrt_()
        if not bool((norms <= self.config.max_gradient).all()):
            scale = (self.config.max_gradient / (norms + 1e-12)).clamp_(max=1.0)[:, None, None]
            gradients = [gradient * scale for gradient in gradients]
        for leaf, gradient in zip(leaves, gradients, strict=True):
            leaf.grad = gradient
        return norms

    def _step(self, entropy: Tensor) -> None:
        """Step everything whose gradient is set, then the temperature and the targets."""
        done = min(self.updates / self.config.schedule_updates, 1.0)
        for name, (first, last) in {
            "critic": self.config.critic_rate,
            "policy": self.config.actor_rate,
        }.items():
            self._optimizers[name].param_groups[0]["lr"] = first + (last - first) * done
            self._optimizers[name].step()
        if self.config.temperature_rate:
            self._log_alpha.grad = (entropy - self._entropy).reshape(1)
            self._optimizers["temperature"].step()
            with torch.no_grad():
                self._log_alpha.clamp_(min=math.log(self.config.temperature_floor))
        self.critics.follow()
        self.policy.follow()
        self.updates += 1

    def arrays(self) -> Arrays:
        """What a checkpoint holds: weights of the policy (`policy/...`) and of the critics (`critic/...`)."""
        groups = {"policy": self.policy.trained, "critic": self.critics.trained}
        return {f"{group}/{k}": _array(v) for group, weights in groups.items() for k, v in weights.items()}

    def state(self) -> Arrays:
        """All that `load` needs to carry on to the same numbers: weights, targets, moments, generator,
        counters.
        """
        state: Arrays = dict(self.arrays())
        for group, weights in {
            "policy_target": self.policy.target,
            "critic_target": self.critics.target,
        }.items():
            state |= {f"{group}/{k}": _array(v) for k, v in weights.items()}
        for name, optimizer in self._optimizers.items():
            for i, moments in optimizer.state_dict()["state"].items():
                state |= {f"adam/{name}/{i}/{k}": _array(v) for k, v in moments.items()}
        state["log_alpha"] = _array(self._log_alpha)
        state["generator"] = self._generator.get_state().numpy().copy()
        state["updates"] = np.array([self.updates])
        return state

    def load(self, state: Mapping[str, NDArray]) -> None:
        """Carry on from a saved state of a learner with the same configuration. AgentError if it does not
        fit.
        """
        try:
            self._load_weights(state)
            for name, optimizer in self._optimizers.items():
                self._load_moments(name, optimizer, state)
            self._generator.set_state(torch.from_numpy(np.array(state["generator"], dtype=np.uint8)))
            self.updates = int(state["updates"][0])
        except (KeyError, RuntimeError, ValueError) as error:
            raise AgentError(f"the training state does not fit this configuration: {error}") from error

    @torch.no_grad()
    def _load_weights(self, state: Mapping[str, NDArray]) -> None:
        groups = {
            "policy": self.policy.trained,
            "critic": self.critics.trained,
            "policy_target": self.policy.target,
            "critic_target": self.critics.target,
        }
        for group, weights in groups.items():
            for name, tensor in weights.items():
                value = torch.from_numpy(np.array(state[f"{group}/{name}"]))
                if value.shape != tensor.shape:
                    raise ValueError(f"{group}/{name} is {tuple(value.shape)}, not {tuple(tensor.shape)}")
                tensor.copy_(value)
        self._log_alpha.copy_(torch.from_numpy(np.array(state["log_alpha"])))

    @staticmethod
    def _load_moments(name: str, optimizer: torch.optim.Optimizer, state: Mapping[str, NDArray]) -> None:
        prefix = f"adam/{name}/"
        moments: dict[int, dict[str, Tensor]] = {}
        for key in (key for key in state if key.startswith(prefix)):
            i, moment = key[len(prefix) :].split("/")
            moments.setdefault(int(i), {})[moment] = torch.from_numpy(np.array(state[key]))
        optimizer.load_state_dict(optimizer.state_dict() | {"state": moments})


def _adam(weights: Iterable[Tensor], rate: float) -> torch.optim.Adam:
    return torch.optim.Adam(list(weights), lr=rate, fused=True)


def _array(tensor: Tensor) -> NDArray:
    return tensor.detach().cpu().numpy().copy()
