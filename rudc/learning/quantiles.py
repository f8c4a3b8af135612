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

from rudc.learning.distortion import midpoints

ROWS = 64
"""of a batch in a piece, on a CPU"""


def quantile_huber(predicted: Tensor, target: Tensor, kappa: float = 1.0) -> Tensor:
    """Loss (N, B) of predictions (N, B, N_q) against targets (B, M), the same for all members; no gradient to
    targets.
    """
    return _QuantileHuber.apply(predicted, target, kappa)  # pyright: ignore[reportReturnType] -- apply is untyped


class _QuantileHuber(Function):
    @staticmethod
    def forward(ctx: Any, predicted: Tensor, target: Tensor, kappa: float) -> Tensor:
        members, batch, count = predicted.shape
        rows = min(ROWS, batch) if predicted.device.type == "cpu" else batch
        sums = predicted.new_empty(4, members, batch, count)
        delta, inner, above = (predicted.new_empty(members, rows, target.shape[1], count) for _ in range(3))
        for start in range(0, batch, rows):
            part = slice(start, min(start + rows, batch))
            d, c, p = (scratch[:, : part.stop - start] for scratch in (delta, inner, above))
            torch.sub(target[None, part, :, None], predicted[:, part, None, :], out=d)
            torch.clamp(d, -kappa, kappa, out=c)
            torch.clamp(c, min=0.0, out=p)
            torch.sum(c, 2, out=sums[0, :, part])
            torch.sum(p, 2, out=sums[1, :, part])
            d.add_(c, alpha=-0.5)
            torch.sum(c.mul_(d), 2, out=sums[2, :, part])
            torch.sum(p.mul_(d), 2, out=sums[3, :, part])
        tau = torch.from_numpy(midpoints(count)).to(predicted)
        scale = 1 / (kappa * target.shape[1])
        slope, loss = sums[0::2] * (scale * (1 - tau)) + sums[1::2] * (scale * (2 * tau - 1))
        ctx.save_for_backward(slope)
        return loss.sum(-1)

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, gradient: Tensor) -> tuple[Tensor, None, None]:  # pyright: ignore[reportIncompatibleMethodOverride] -- torch's own is variadic
        (slope,) = ctx.saved_tensors
        return gradient[..., None] * -slope, None, None
