"""The networks, all members of a stack at once (paper, "Network Architecture", Fig. "Network architecture").

Every map below is one batched product over members n = 1..N; weights are those of parameters.py.

Encoder `attention`:
    e_0   = GELU(W_ego [S_EV, S_task])                      embedding of the EV and where it is going
    x_j   = GELU(W_vehicle S_SV^j)                          embedding of each SV j (or several such layers)
    hop k = 0..K-1, head m:
      score_jm = e_k^T A_km x_j / sqrt(width)                A_km = `look`: W_query^T W_key of usual
                                                             attention, as one matrix
      p_jm     = exp(score_jm) / (1 + sum_j exp(score_jm))   over valid SVs; the 1 is an empty slot, which
                                                             takes the weight where nothing deserves it
      e_{k+1}  = e_k + GELU(W_take [sum_j p_j1 x_j, ...])    `take`: W_output W_value, as one matrix
    g     = GELU(sum_i l_i * (W_w S_wp^i + b_w + P_i))        waypoints: P_i sinusoidal code of their order,
                                                             l_i learnable weights, one for each feature
    c     = GELU(W_c S_conflict)                              where the observation has it
    latent = W_fuse [e_K, g, c]                               fused latent, before its activation
Encoder `mlp`:
    latent = W_fuse S
Decoders:
    policy     W_out GELU(W_h GELU(latent))
    quantiles  W_out GELU(W_h GELU(latent + W_a a))

SVs enter through sums over valid j only, so their order and their padding do not matter. Query and key are
one matrix, and so are value and output; therefore only the embedding's product runs over all SVs. With the EV
as the only query, that takes a third of the time. The latent does not depend on the action and is computed
once for any number of actions.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import torch
from torch import Tensor
from torch.nn.functional import gelu

from rudc.learning.attention import attend
from rudc.learning.config import NetworkConfig, ObservationLayout
from rudc.learning.parameters import waypoint_positions

Weights = Mapping[str, Tensor]


class Stack:
    """Architecture of a stack of N networks; weights are passed in, members first."""

    def __init__(self, layout: ObservationLayout, network: NetworkConfig) -> None:
        self.layout = layout
        self.network = network
        self._positions = torch.empty(0)
        if network.encoder == "attention":
            self._positions = torch.from_numpy(
                waypoint_positions(layout.waypoints, network.waypoint_embedding)
            )

    def encode(self, weights: Weights, observation: Tensor) -> Tensor:
        """Fused latents (N, B, hidden) of observations (B, size), seen alike by all members."""
        if self.network.encoder == "mlp":
            return _shared(weights, "fuse", observation)
        layout = self.layout
        ego = torch.cat([observation[:, : layout.ego], observation[:, layout.task_at]], dim=1)
        seen = self._attend(weights, _gelu(_shared(weights, "ego", ego)), observation[:, layout.vehicles_at])
        parts = [seen, self._waypoints(weights, observation[:, layout.waypoints_at])]
        if layout.conflict:
            parts.append(_gelu(_shared(weights, "conflict", observation[:, layout.conflict_at])))
        return _linear(weights, "fuse", torch.cat(parts, dim=2))

    def _attend(self, weights: Weights, ego: Tensor, rows: Tensor) -> Tensor:
        """What the EV (N, B, width) becomes by looking over the SVs (B, vehicles * vehicle)."""
        members, batch, width = ego.shape
        count, heads = self.layout.vehicles, self.network.heads
        vehicle = rows.reshape(batch * count, self.layout.vehicle)
        x = _gelu(_shared(weights, "vehicle0", vehicle))
        for layer in range(1, self.network.vehicle_layers):
            x = _gelu(_linear(weights, f"vehicle{layer}", x))
        x = x.view(members * batch, count, width)
        valid = (vehicle[:, 0] >= 0.5).to(x.dtype).view(batch, 1, count).repeat(members, 1, 1)
        for hop in range(self.network.hops):
            query = torch.bmm(ego, weights[f"look{hop}.weight"]).view(members * batch, heads, width)
            taken = attend(query, x, valid, 1 / math.sqrt(width)).view(members, batch, heads * width)
            ego = ego + _gelu(_linear(weights, f"take{hop}", taken))
        return ego

    def _waypoints(self, weights: Weights, rows: Tensor) -> Tensor:
        """Waypoint branch (N, B, waypoint_embedding) of waypoints (B, waypoints * waypoint)."""
        weight, importance = (
            weights["waypoint.weight"],
            weights["importance.weight"],
        )  # (N, 2, W), (N, count, W)
        placed = (importance[:, :, None] * weight[:, None]).flatten(1, 2)  # one map of all waypoints
        if self._positions.device != rows.device:
            self._positions = self._positions.to(rows.device)
        shift = (importance * (weights["waypoint.bias"] + self._positions)).sum(1, keepdim=True)
        return _gelu(torch.baddbmm(shift, rows.expand(weight.shape[0], *rows.shape), placed))

    @staticmethod
    def decode(weights: Weights, latent: Tensor, action: Tensor | None = None) -> Tensor:
        """Outputs (N, B, outputs) from latents (N, B, hidden) and, for a critic, actions (B, actions)."""
        if action is None:
            first = gelu(latent)
        else:
            weight = weights["action.weight"]
            first = _gelu(torch.baddbmm(latent, action.expand(weight.shape[0], *action.shape), weight))
        return _linear(weights, "out", _gelu(_linear(weights, "hidden", first)))


def _gelu(x: Tensor) -> Tensor:
    """GELU of a product that nothing else uses; written over the product if no gradient will be needed."""
    return gelu(x) if x.requires_grad else torch.ops.aten.gelu_(x)


def _linear(weights: Weights, name: str, x: Tensor) -> Tensor:
    """Map (N, B, inputs) of each member by its own weights."""
    bias = weights.get(f"{name}.bias")
    weight = weights[f"{name}.weight"]
    return torch.bmm(x, weight) if bias is None else torch.baddbmm(bias, x, weight)


def _shared(weights: Weights, name: str, x: Tensor) -> Tensor:
    """Map an input (B, inputs) common to all members by each one's weights."""
    return _linear(weights, name, x.expand(weights[f"{name}.weight"].shape[0], *x.shape))
