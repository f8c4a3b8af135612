"""The learner's update as one writes it down: separate modules, a loop over the critics, autograd for all.

Yardstick for critic_update.py, and what tests/learning/test_rudc.py compares with. The maths are those
of rudc/learning/rudc.py, networks and weights are the same; nothing is shared between critics, computed
once for several uses, or left out. Two variants:

    lean          with the two economies a careful author makes at once: the critics' weights get no gradient
                  in the policy's loss, and optimisers are fused
    projections   attention with a key and a value projection of every SV, as it is usually written; the same
                  function as long as these are the identity, which they are at the start
"""

from __future__ import annotations

import math

import torch
from torch import Tensor, nn
from torch.nn.functional import gelu, softplus

from rudc.arrays import Arrays
from rudc.learning.batch import Batch
from rudc.learning.config import EnsembleConfig, NetworkConfig, ObservationLayout, Problem
from rudc.learning.parameters import (
    critic_arrays,
    policy_arrays,
    prior_arrays,
    waypoint_positions,
)


def _linear(arrays: Arrays, name: str, member: int) -> nn.Linear:
    weight = arrays[f"{name}.weight"][member]
    bias = arrays.get(f"{name}.bias")
    linear = nn.Linear(*weight.shape, bias=bias is not None)
    with torch.no_grad():
        linear.weight.copy_(torch.from_numpy(weight.T.copy()))
        if bias is not None:
            linear.bias.copy_(torch.from_numpy(bias[member, 0]))
    return linear


class Network(nn.Module):
    """One network of the paper's architecture; latent and outputs as in networks.py."""

    def __init__(
        self,
        layout: ObservationLayout,
        network: NetworkConfig,
        arrays: Arrays,
        member: int,
        projections: bool = False,
    ) -> None:
        super().__init__()
        self.layout, self.network, self.projections = layout, network, projections
        names = {name.split(".")[0] for name in arrays} - {"importance"}
        self.maps = nn.ModuleDict({name: _linear(arrays, name, member) for name in sorted(names)})
        if projections:
            for name in (f"{kind}{hop}" for kind in ("key", "value") for hop in range(network.hops)):
                identity = nn.Linear(network.embedding, network.embedding, bias=False)
                nn.init.eye_(identity.weight)
                self.maps[name] = identity
        if network.encoder == "attention":
            self.importance = nn.Parameter(torch.from_numpy(arrays["importance.weight"][member].copy()))
            positions = torch.from_numpy(waypoint_positions(layout.waypoints, network.waypoint_embedding))
            self.register_buffer("positions", positions)

    def forward(self, observation: Tensor, action: Tensor | None = None) -> Tensor:
        maps, layout = self.maps, self.layout
        if self.network.encoder == "mlp":
            latent = maps["fuse"](observation)
        else:
            ego = torch.cat([observation[:, : layout.ego], observation[:, layout.task_at]], 1)
            vehicles = observation[:, layout.vehicles_at].reshape(-1, layout.vehicles, layout.vehicle)
            waypoints = observation[:, layout.waypoints_at].reshape(-1, layout.waypoints, layout.waypoint)
            seen = gelu(maps["ego"](ego))
            x = vehicles
            for layer in range(self.network.vehicle_layers):
                x = gelu(maps[f"vehicle{layer}"](x))
            for hop in range(self.network.hops):
                query = maps[f"look{hop}"](seen).unflatten(1, (self.network.heads, -1))
                key = maps[f"key{hop}"](x) if self.projections else x
                value = maps[f"value{hop}"](x) if self.projections else x
                scores = query @ key.transpose(1, 2) / math.sqrt(x.shape[-1])
                scores = scores.masked_fill(vehicles[:, None, :, 0] < 0.5, -math.inf)
                scores = torch.cat([scores, torch.zeros_like(scores[..., :1])], -1)
                seen = seen + gelu(maps[f"take{hop}"]((scores.softmax(-1)[..., :-1] @ value).flatten(1)))
            placed = maps["waypoint"](waypoints) + self.positions
            parts = [seen, gelu((self.importance * placed).sum(1))]
            if layout.conflict:
                parts.append(gelu(maps["conflict"](observation[:, layout.conflict_at])))
            latent = maps["fuse"](torch.cat(parts, 1))
        if action is not None:
            latent = latent + maps["action"](action)
        return maps["out"](gelu(maps["hidden"](gelu(latent))))


class LoopLearner:
    """The update of RudcLearner in plain form."""

    def __init__(
        self,
        config: EnsembleConfig,
        problem: Problem,
        device: str = "cpu",
        *,
        lean: bool = False,
        projections: bool = False,
    ) -> None:
        self.config, self.problem, self.device, self.lean = config, problem, device, lean

        def critics(arrays: Arrays) -> list[Network]:
            members = range(config.members)
            made = [Network(problem.layout, config.critic, arrays, n, projections) for n in members]
            return [network.to(device) for network in made]

        self.critics, self.targets = (
            critics(critic_arrays(config, problem)),
            critics(critic_arrays(config, problem)),
        )
        self.priors = critics(prior_arrays(config, problem))
        self.policy, self.target_policy = (
            Network(problem.layout, config.policy, policy_arrays(config, problem), 0, projections).to(device)
            for _ in range(2)
        )
        for network in (*self.priors, *self.targets, self.target_policy):
            network.requires_grad_(False)
        self.log_alpha = torch.tensor([math.log(config.temperature)], device=device, requires_grad=True)
        self.generator = torch.Generator().manual_seed(problem.seed)
        critic_rate, actor_rate = config.critic_rate[0], config.actor_rate[0]
        self.critic_adams = [torch.optim.Adam(c.parameters(), critic_rate, fused=lean) for c in self.critics]
        self.policy_adam = torch.optim.Adam(self.policy.parameters(), actor_rate, fused=lean)
        self.alpha_adam = torch.optim.Adam([self.log_alpha], config.temperature_rate)

    def combined(self, network: Network, prior: Network, observation: Tensor, action: Tensor) -> Tensor:
        """Eq. (fpn) for one member, (B, N_q)."""
        rho = self.config.prior_factor
        trained = (1 + rho) * self.config.value_scale * network(observation, action)
        return (trained + rho * self.config.prior_scale * prior(observation, action)) / (1 + rho)

    def draw(self, policy: Network, observation: Tensor) -> tuple[Tensor, Tensor]:
        """Actions and the logarithms of their probability."""
        noise = torch.randn(len(observation), self.problem.actions, generator=self.generator)
        noise = noise.to(self.device)
        mean, log_std = policy(observation).chunk(2, 1)
        log_std = log_std.clamp(*self.config.log_std)
        u = mean + log_std.exp() * noise
        log_normal = -0.5 * noise**2 - log_std - 0.5 * math.log(2 * math.pi)
        return u.tanh(), (log_normal - 2 * (math.log(2) - u - softplus(-2 * u))).sum(1)

    def quantile_huber(self, predicted: Tensor, target: Tensor) -> Tensor:
        """(B,) from (B, N_q) and (B, N_q), pair by pair."""
        count, kappa = predicted.shape[1], self.config.kappa
        tau = (torch.arange(count, device=self.device) + 0.5) / count
        delta = target[:, None, :] - predicted[:, :, None]
        size = delta.abs()
        huber = torch.where(size > kappa, kappa * (size - 0.5 * kappa), 0.5 * delta**2) / kappa
        return ((tau[:, None] - (delta.detach() < 0).float()).abs() * huber).mean(2).sum(1)

    def update(self, batch: Batch) -> dict[str, float]:
        """One update."""
        columns = (torch.from_numpy(column).to(self.device) for column in batch)
        observation, action, _, reward, _, discount, after, terminal, mask, _ = columns
        alpha = self.log_alpha.detach().exp()
        with torch.no_grad():
            next_action, log_p = self.draw(self.target_policy, after)
            z = [
                self.combined(*pair, after, next_action)
                for pair in zip(self.targets, self.priors, strict=True)
            ]
            future = torch.stack(z).mean(0) - (alpha * log_p)[:, None]
            target = reward[:, None] + (discount * ~terminal)[:, None] * future

        policy_loss, log_p = self.policy_step(observation, alpha)
        losses = []
        for n, (critic, prior, adam) in enumerate(
            zip(self.critics, self.priors, self.critic_adams, strict=True)
        ):
            z = self.combined(critic, prior, observation, action)
            loss = (mask[:, n] * self.quantile_huber(z, target)).mean()
            adam.zero_grad()
            (loss / self.config.value_scale).backward()
            nn.utils.clip_grad_norm_(critic.parameters(), self.config.max_gradient)
            losses.append(float(loss.detach()))
        for adam in (*self.critic_adams, self.policy_adam):
            adam.step()
        self.alpha_adam.zero_grad()
        (-self.log_alpha * (log_p.detach().mean() - self.problem.actions)).sum().backward()
        self.alpha_adam.step()
        with torch.no_grad():
            pairs = zip((*self.targets, self.target_policy), (*self.critics, self.policy), strict=True)
            for follower, leader in pairs:
                for slow, fast in zip(follower.parameters(), leader.parameters(), strict=True):
                    slow.lerp_(fast, self.config.target_rate)
        return {"critic_loss": sum(losses) / len(losses), "policy_loss": policy_loss}

    def policy_step(self, observation: Tensor, alpha: Tensor) -> tuple[float, Tensor]:
        """Set the policy's gradient."""
        for critic in self.critics if self.lean else ():
            critic.requires_grad_(False)
        action, log_p = self.draw(self.policy, observation)
        weights = torch.tensor(self.config.risk().weights(self.config.quantiles), dtype=torch.float32)
        weights = weights.to(self.device)
        values = [
            (self.combined(*pair, observation, action) * weights).sum(1)
            for pair in zip(self.critics, self.priors, strict=True)
        ]
        loss = (alpha * log_p - torch.stack(values).mean(0)).mean()
        self.policy_adam.zero_grad()
        (loss / self.config.value_scale).backward()
        nn.utils.clip_grad_norm_(self.policy.parameters(), self.config.max_gradient)
        for critic in self.critics if self.lean else ():
            critic.requires_grad_(True)
        return float(loss.detach()), log_p
