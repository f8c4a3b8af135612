"""Deciding with a trained agent: one observation to an action and its uncertainty, without torch.

A decision is a batch of one. For that, torch spends its time on calling some hundred small operations;
kernels (rudc/learning/kernels.py) take a tenth of the time, and a process that only drives needs no torch. So
the networks of networks.py are written once more for a single observation, and what does not depend on it is
prepared beforehand: maps that share their input become one matrix, the waypoint branch one map, the
trained and the prior networks of all critics one stack of 2 N; and absent SVs are left out instead of
masked. Results agree with networks.py to rounding.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import numpy as np

from rudc.arrays import Floats
from rudc.learning.config import (
    CostConfig,
    EnsembleConfig,
    LearnerConfig,
    NetworkConfig,
    ObservationLayout,
)
from rudc.learning.kernels import decoded, decoded_with, gelu_of, gelu_slope, mapped, mapped_each
from rudc.learning.parameters import SCORE_BOUND, group, waypoint_positions
from rudc.learning.uncertainty import Uncertainty, uncertainty


class NeuralNetwork:
    """A stack of N networks of one architecture, for one observation at a time."""

    def __init__(
        self, layout: ObservationLayout, network: NetworkConfig, arrays: Mapping[str, Floats]
    ) -> None:
        self.layout, self.network = layout, network
        self._arrays = {name: np.ascontiguousarray(value) for name, value in arrays.items()}
        self.members = len(arrays["out.weight"])
        common = ["fuse"] if network.encoder == "mlp" else ["ego", "vehicle0", "conflict"]
        self._common = {name: self._side_by_side(name) for name in common if f"{name}.weight" in arrays}
        if "action.weight" in arrays:
            self._common["action"] = self._side_by_side("action")
        self._head: list[Floats] = []
        for name in ("hidden", "out"):
            bias = self._arrays[f"{name}.bias"].reshape(self.members, -1)
            self._head += [self._arrays[f"{name}.weight"], bias]
        if network.encoder == "attention":
            self._common["waypoint"] = self._waypoint_map()
            scale = np.float32(1 / math.sqrt(network.embedding))
            self._look = [self._arrays[f"look{hop}.weight"] * scale for hop in range(network.hops)]

    def _side_by_side(self, name: str) -> tuple[Floats, Floats]:
        """Weights (inputs, N * outputs) and biases (N * outputs,) of all members as one map."""
        weight = self._arrays[f"{name}.weight"]
        flat = np.ascontiguousarray(weight.transpose(1, 0, 2).reshape(weight.shape[1], -1))
        bias = self._arrays.get(f"{name}.bias")
        return flat, np.zeros(flat.shape[1], np.float32) if bias is None else bias.reshape(-1)

    def _waypoint_map(self) -> tuple[Floats, Floats]:
        arrays, count = self._arrays, self.layout.waypoints
        weight, importance = arrays["waypoint.weight"], arrays["importance.weight"]
        positions = waypoint_positions(count, self.network.waypoint_embedding)
        placed = importance[:, :, None] * weight[:, None]  # (N, count, 2, width)
        shift = (importance * (arrays["waypoint.bias"] + positions)).sum(axis=1)
        flat = placed.transpose(1, 2, 0, 3).reshape(count * self.layout.waypoint, -1)
        return np.ascontiguousarray(flat), shift.reshape(-1)

    def _map(self, name: str, x: Floats) -> Floats:
        """Each member's own map of its row of x (N, inputs)."""
        arrays, x = self._arrays, np.ascontiguousarray(x)
        return mapped_each(x, arrays[f"{name}.weight"], arrays[f"{name}.bias"].reshape(self.members, -1))

    def _map_common(self, name: str, x: Floats) -> Floats:
        """All members' maps of x (inputs,), (N, outputs)."""
        weight, bias = self._common[name]
        return mapped(np.ascontiguousarray(x, np.float32), weight, bias).reshape(self.members, -1)

    def encode(self, observation: Floats) -> Floats:
        """Latents (N, hidden) of an observation (size,)."""
        if self.network.encoder == "mlp":
            return self._map_common("fuse", observation)
        layout = self.layout
        ego = np.concatenate([observation[: layout.ego], observation[layout.task_at]])
        seen = gelu(self._map_common("ego", ego))
        rows = observation[layout.vehicles_at].reshape(layout.vehicles, layout.vehicle)
        rows = rows[rows[:, 0] >= 0.5]
        seen = self._attend(seen, rows)
        parts = [seen, gelu(self._map_common("waypoint", observation[layout.waypoints_at]))]
        if layout.conflict:
            parts.append(gelu(self._map_common("conflict", observation[layout.conflict_at])))
        return self._map("fuse", np.concatenate(parts, axis=1))

    def _attend(self, ego: Floats, rows: Floats) -> Floats:
        """What the EV (N, width) becomes by looking over the valid SVs (J, vehicle)."""
        members, heads, width = self.members, self.network.heads, self.network.embedding
        x = gelu(rows @ self._common["vehicle0"][0]).reshape(-1, members, width).transpose(1, 0, 2)
        for layer in range(1, self.network.vehicle_layers):
            x = gelu(x @ self._arrays[f"vehicle{layer}.weight"] + self._arrays[f"vehicle{layer}.bias"])
        across = x.transpose(0, 2, 1)
        for hop, look in enumerate(self._look):
            query = np.matmul(ego[:, None], look).reshape(members, heads, width)
            share = np.exp(np.minimum(query @ across, np.float32(SCORE_BOUND)))
            share /= share.sum(axis=2, keepdims=True) + np.float32(1)
            ego = ego + gelu(self._map(f"take{hop}", (share @ x).reshape(members, heads * width)))
        return ego

    def decode(self, latent: Floats, action: Floats | None = None) -> Floats:
        """Outputs (N, outputs) from latents (N, hidden) and, for a critic, an action."""
        latent = np.ascontiguousarray(latent)
        if action is None:
            return decoded(latent, *self._head)
        action = np.ascontiguousarray(action, np.float32)
        return decoded_with(action, *self._common["action"], latent, *self._head)

    def sloped(self, latent: Floats, action: Floats) -> tuple[Floats, Floats]:
        """First output (N,) of each network, and its gradient (N, actions) with respect to the action."""
        first = latent + self._map_common("action", action)
        second = self._map("hidden", gelu(first))
        back = self._arrays["out.weight"][:, :, 0] * gelu_slope(second)
        back = np.matmul(self._arrays["hidden.weight"], back[..., None])[..., 0] * gelu_slope(first)
        slopes = np.matmul(self._arrays["action.weight"], back[..., None])[..., 0]
        return self._map("out", gelu(second))[:, 0], slopes


class Decider:
    """A trained policy, and the critics that come with it."""

    def __init__(
        self, config: LearnerConfig, layout: ObservationLayout, arrays: Mapping[str, Floats]
    ) -> None:
        self.config, self._layout = config, layout
        self.refresh(arrays)

    def refresh(self, arrays: Mapping[str, Floats]) -> None:
        """Take over weights named as in `Learner.weights`: `policy/...`, and what critics there are."""
        config, layout = self.config, self._layout
        self._prior_share = np.float32(getattr(config, "prior_share", 0.0))
        self._ensemble = config if isinstance(config, EnsembleConfig) else None
        """None where critics are no ensemble of distributions"""
        self._actions = group(arrays, "policy")["out.bias"].shape[-1] // 2
        self._observers: dict[str, NeuralNetwork] = {}
        for name, (network, _) in config.observers(self._actions).items():
            if found := group(arrays, name):
                self._observers[name] = NeuralNetwork(layout, network, found)
        self._critics: dict[str, NeuralNetwork] = {}
        for name in ("critic", "cost"):
            if critic := group(arrays, name):
                prior = group(arrays, "prior") if name == "critic" else {}
                both = {k: np.concatenate([v, prior[k]]) if prior else v for k, v in critic.items()}
                self._critics[name] = NeuralNetwork(layout, config.critic, both)

    def action(self, observation: Floats, rng: np.random.Generator | None = None) -> Floats:
        """The policy's most likely action (actions,) in [-1, 1], or one drawn from it with `rng`."""
        outputs = self.seen("policy", observation)
        mean = outputs[: self._actions]
        if rng is not None:
            spread = np.exp(outputs[self._actions :].clip(*self.config.log_std))
            mean = mean + spread * rng.standard_normal(len(mean), dtype=np.float32)
        return np.tanh(mean)

    @property
    def has_critics(self) -> bool:
        """Whether it can say anything of actions."""
        return bool(self._critics)

    def quantiles(self, observation: Floats, action: Floats) -> Floats:
        """What the critics of returns say of an action, (N, outputs) reward units: Z_n of Eq. (fpn) of an
        ensemble's members, or one number of each critic.
        """
        outputs, ensemble = self._outputs("critic", observation, action), self._ensemble
        scale, members = np.float32(self.config.value_scale), ensemble.members if ensemble else len(outputs)
        z = scale * outputs[:members]
        return z if len(outputs) == members else z + self._prior_share * outputs[members:]

    def cost(self, observation: Floats, action: Floats) -> float:
        """The larger of the costs that two cost critics expect after an action."""
        return self._cost_scale * float(self._outputs("cost", observation, action).max())

    def excess_at(self, observation: Floats) -> Callable[[Floats], tuple[float, Floats]]:
        """What gives Q_c - d_th of an action (actions,), and its gradient (actions,) with respect to it."""
        scale, limit = self._cost_scale, getattr(self.config, "cost_limit", None)
        if limit is None:
            raise ValueError("this algorithm knows no limit of the cost")
        network = self._network("cost")
        latent = network.encode(observation)

        def excess(action: Floats) -> tuple[float, Floats]:
            costs, slopes = network.sloped(latent, action)
            larger = int(costs.argmax())
            return scale * float(costs[larger]) - limit, np.float32(scale) * slopes[larger]

        return excess

    def seen(self, network: str, observation: Floats) -> Floats:
        """Outputs of a network of the observation alone, by its name in `LearnerConfig.observers`."""
        if network not in self._observers:
            raise ValueError(f"this decider was built without a {network} network")
        found = self._observers[network]
        return found.decode(found.encode(observation))[0]

    @property
    def _cost_scale(self) -> float:
        if not isinstance(self.config, CostConfig):
            raise ValueError("this algorithm has no cost critics")
        return self.config.cost_scale

    def _outputs(self, critic: str, observation: Floats, action: Floats) -> Floats:
        network = self._network(critic)
        return network.decode(network.encode(observation), action)

    def _network(self, critic: str) -> NeuralNetwork:
        if critic not in self._critics:
            raise ValueError(f"this decider was built without {critic} networks")
        return self._critics[critic]

    def uncertainty(self, observation: Floats, action: Floats) -> Uncertainty | None:
        """Of the return that follows from an action, reward units; None where critics are no ensemble of
        distributions, or left out.
        """
        if self._ensemble is None or "critic" not in self._critics:
            return None
        return uncertainty(self.quantiles(observation, action), self._ensemble.beta)


def gelu(x: Floats) -> Floats:
    """x Phi(x) of single precision."""
    y = np.array(x, np.float32, order="C")
    gelu_of(y.reshape(-1))
    return y
