"""Quantile Huber loss (paper, Eq. (ensemble_huber_loss) and (quantile_huber_combined)).

With targets y_i, predictions z_j at fractions tau_j and delta_ij = y_i - z_j,

    rho_j(delta) = |tau_j - 1{delta < 0}| L_kappa(delta) / kappa
    L_kappa(delta) = delta^2 / 2 for |delta| <= kappa, kappa (|delta| - kappa / 2) beyond
    loss = sum_j (1 / N_q) sum_i rho_j(delta_ij)

Written out by autograd that is some twenty passes over (N, B, N_q, N_q) numbers, as much time as the
networks. With c+ = min(max(delta, 0), kappa) and c- = max(min(delta, 0), -kappa) both loss and gradient need
two sums over i:

    L_kappa(delta)        = c (delta - c / 2),                         c = c+ + c-
    -d loss / d z_j       = (tau_j sum_i c+_ij + (1 - tau_j) sum_i c-_ij) / (kappa N_q)

so they are computed together in place, and the backward pass is one product.
"""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor
from torch.autograd import Function
from torch.autograd.function import once_differentiable


def fractions(quantiles: int) -> Tensor:
    """Quantile midpoints (tau_i + tau_{i+1}) / 2, (quantiles,)."""
    return (torch.arange(quantiles) + 0.5) / quantiles


def quantile_huber(predicted: Tensor, target: Tensor, kappa: float = 1.0) -> Tensor:
    """Loss (N, B) of predictions (N, B, N_q) against targets (B, M), the same for all members; no gradient to
    targets.
    """
    return _QuantileHuber.apply(predicted, target, kappa)  # pyright: ignore[reportReturnType] -- apply is untyped


class _QuantileHuber(Function):
    @staticmethod
    def forward(ctx: Any, predicted: Tensor, target: Tensor, kappa: float) -> Tensor:
        tau = fractions(predicted.shape[-1]).to(predicted)
        delta = target[None, :, None, :] - predicted[..., None]  # (N, B, N_q, M)
        count = target.shape[-1]
        above = delta.clamp(0.0, kappa)
        below = delta.clamp(-kappa, 0.0)
        above_sum, below_sum = above.sum(-1), below.sum(-1)
        ctx.save_for_backward((tau * above_sum + (1 - tau) * below_sum) / (-kappa * count))
        above.mul_(torch.add(delta, above, alpha=-0.5))
        below.mul_(delta.add_(below, alpha=-0.5))
        return (tau * above.sum(-1) + (1 - tau) * below.sum(-1)).sum(-1) / (kappa * count)

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, gradient: Tensor) -> tuple[Tensor, None, None]:  # pyright: ignore[reportIncompatibleMethodOverride] -- torch's own is variadic
        (slope,) = ctx.saved_tensors
        return gradient[..., None] * slope, None, None
