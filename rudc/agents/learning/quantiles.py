"""Quantile Huber loss (paper, Eq. (ensemble_huber_loss) and (quantile_huber_combined)).

With targets y_i, predictions z_j at fractions tau_j and delta_ij = y_i - z_j,

    rho_j(delta) = |tau_j - 1{delta < 0}| L_kappa(delta) / kappa
    L_kappa(delta) = delta^2 / 2 for |delta| <= kappa, kappa (|delta| - kappa / 2) beyond
    loss = sum_j (1 / N_q) sum_i rho_j(delta_ij)

Written out by autograd that is some twenty passes over (N, B, N_q, N_q) numbers, as much time as the
networks. With c = min(max(delta, -kappa), kappa) and c+ = max(c, 0) both loss and gradient need two sums over
i, since L_kappa(delta) = c (delta - c / 2) and L_kappa'(delta) = c:

    |tau_j - 1{delta < 0}| c   =  (1 - tau_j) c + (2 tau_j - 1) c+
    -d loss / d z_j            =  sum_i of that / (kappa N_q)

They are computed together, in place, some rows at a time so that these stay in the processor's cache; the
backward pass is one product.
"""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor
from torch.autograd import Function
from torch.autograd.function import once_differentiable

ROWS = 32
"""of a batch in a piece, on a CPU"""


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
        loss, slope = predicted.new_empty(predicted.shape[:2]), torch.empty_like(predicted)
        step = ROWS if predicted.device.type == "cpu" else predicted.shape[1]
        for start in range(0, predicted.shape[1], step):
            rows = slice(start, start + step)
            delta = target[None, rows, None, :] - predicted[:, rows, :, None]  # (N, rows, N_q, M)
            inner = delta.clamp(-kappa, kappa)
            above = inner.clamp(min=0.0)
            all_sum, above_sum = inner.sum(-1), above.sum(-1)
            slope[:, rows] = all_sum * (tau - 1) + above_sum * (1 - 2 * tau)
            delta.add_(inner, alpha=-0.5)
            all_sum, above_sum = inner.mul_(delta).sum(-1), above.mul_(delta).sum(-1)
            loss[:, rows] = (all_sum * (1 - tau) - above_sum * (1 - 2 * tau)).sum(-1)
        scale = 1 / (kappa * target.shape[-1])
        ctx.save_for_backward(slope.mul_(scale))
        return loss.mul_(scale)

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, gradient: Tensor) -> tuple[Tensor, None, None]:  # pyright: ignore[reportIncompatibleMethodOverride] -- torch's own is variadic
        (slope,) = ctx.saved_tensors
        return gradient[..., None] * slope, None, None
