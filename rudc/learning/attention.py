"""One look of the EV over the SVs, with its gradient written out.

With queries q_m, and rows x_j of valid SVs as keys and values:

    s_jm = a q_m . x_j,   p_jm = exp(s_jm) / (1 + sum_j exp(s_jm)),   c_m = sum_j p_jm x_j

a softmax with one empty slot of score and value zero: c is zero where no SV is valid, and nothing overflows
as long as s is cut at SCORE_BOUND. Gradients, with g_m that of c_m:

    d p_jm = g_m . x_j,   d s_jm = p_jm (d p_jm - sum_k p_km d p_km)
    d q_m = sum_j a d s_jm x_j,   d x_j = sum_m (a d s_jm q_m + p_jm g_m)

d x is one product of [a d s, p] with [q, g]; autograd would make two and add them.
"""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor
from torch.autograd import Function
from torch.autograd.function import once_differentiable

from rudc.learning.parameters import SCORE_BOUND
from rudc.learning.products import tiny_products


def attend(query: Tensor, x: Tensor, valid: Tensor, scale: float = 1.0) -> Tensor:
    """What each query (M, heads, width) takes from rows x (M, J, width) with validity (M, 1, J), 1 or 0."""
    return _Attend.apply(query, x, valid, scale)  # pyright: ignore[reportReturnType] -- apply is untyped


class _Attend(Function):
    @staticmethod
    @tiny_products()
    def forward(ctx: Any, query: Tensor, x: Tensor, valid: Tensor, scale: float) -> Tensor:
        share = torch.bmm(query, x.transpose(1, 2)).mul_(scale).clamp_(max=SCORE_BOUND).exp_().mul_(valid)
        share.div_(share.sum(dim=2, keepdim=True).add_(1.0))
        ctx.save_for_backward(query, x, share)
        ctx.scale = scale
        return torch.bmm(share, x)

    @staticmethod
    @once_differentiable
    @tiny_products()
    def backward(ctx: Any, gradient: Tensor) -> tuple[Tensor, Tensor, None, None]:  # pyright: ignore[reportIncompatibleMethodOverride] -- torch's own is variadic
        query, x, share = ctx.saved_tensors
        to_share = torch.bmm(gradient, x.transpose(1, 2))
        to_score = to_share.sub_((to_share * share).sum(dim=2, keepdim=True)).mul_(share).mul_(ctx.scale)
        left = torch.cat([to_score, share], dim=1).transpose(1, 2)
        return torch.bmm(to_score, x), torch.bmm(left, torch.cat([query, gradient], dim=1)), None, None
