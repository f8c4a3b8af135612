"""Quantile Huber loss (paper, Eq. (ensemble_huber_loss) and (quantile_huber_combined)).

With targets y_i, predictions z_j at fractions tau_j and delta_ij = y_i - z_j,

    rho_j(delta) = |tau_j - 1{delta < 0}| L_kappa(delta) / kappa
    L_kappa(delta) = delta^2 / 2 for |delta| <= kappa, kappa (|delta| - kappa / 2) beyond
    loss = sum_j (1 / N_q) sum_i rho_j(delta_ij)

With autograd that takes some twenty passes over (N, B, N_q, N_q) numbers, as much time as the networks. With
c = min(max(delta, -kappa), kappa) and c+ = max(c, 0) loss and gradient are two sums over i, since
L_kappa(delta) = c (delta - c / 2) and L_kappa'(delta) = c:

    slope_ij           =  |tau_j - 1{delta < 0}| c  =  (1 - tau_j) c + (2 tau_j - 1) c+
    -d loss / d z_j    =  sum_i slope_ij / (kappa N_q)
    loss               =  sum_ij slope_ij (delta_ij - c_ij / 2) / (kappa N_q)

They are computed together: in single precision on a CPU by a kernel, in one pass that stores no pair. The
backward pass is one product.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import torch
from torch import Tensor
from torch.autograd import Function
from torch.autograd.function import once_differentiable

from rudc.learning.distortion import midpoints
from rudc.learning.kernels import huber_slopes


def quantile_huber(predicted: Tensor, target: Tensor, kappa: float = 1.0) -> Tensor:
    """Loss (N, B) of predictions (N, B, N_q) against targets (B, M), the same for all members; no gradient to
    targets.
    """
    return _QuantileHuber.apply(predicted, target, kappa)  # pyright: ignore[reportReturnType] -- apply is untyped


class _QuantileHuber(Function):
    @staticmethod
    def forward(ctx: Any, predicted: Tensor, target: Tensor, kappa: float) -> Tensor:
        tau = _fractions(predicted.shape[2], predicted.device, predicted.dtype)
        scale = 1 / (kappa * target.shape[1])
        usual = predicted.device.type == "cpu" and predicted.dtype == torch.float32
        sums = _by_kernel if usual else _by_torch
        slope, loss = sums(predicted, target, tau, kappa)
        ctx.save_for_backward(slope.mul_(scale))
        return loss.mul_(scale)

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, gradient: Tensor) -> tuple[Tensor, None, None]:  # pyright: ignore[reportIncompatibleMethodOverride] -- torch's own is variadic
        (slope,) = ctx.saved_tensors
        return gradient[..., None] * -slope, None, None


@lru_cache
def _fractions(count: int, device: torch.device, dtype: torch.dtype) -> Tensor:
    return torch.from_numpy(midpoints(count)).to(device, dtype)


def _by_kernel(predicted: Tensor, target: Tensor, tau: Tensor, kappa: float) -> tuple[Tensor, Tensor]:
    """sum_i slope_ij (N, B, N_q), and the loss (N, B), both without their factor."""
    slope, loss = torch.empty_like(predicted), predicted.new_empty(predicted.shape[:2])
    arrays = (tensor.detach().contiguous().numpy() for tensor in (predicted, target, tau))
    huber_slopes(*arrays, kappa, slope.numpy(), loss.numpy())
    return slope, loss


def _by_torch(predicted: Tensor, target: Tensor, tau: Tensor, kappa: float) -> tuple[Tensor, Tensor]:
    """The same on any device, in any precision."""
    delta = target[None, :, :, None] - predicted[:, :, None, :]
    c = delta.clamp(-kappa, kappa)
    slope = c * (1 - tau) + c.clamp(min=0.0) * (2 * tau - 1)
    return slope.sum(dim=2), (slope * (delta - 0.5 * c)).sum(dim=(2, 3))
