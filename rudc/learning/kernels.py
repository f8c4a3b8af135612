"""Networks of single precision for one observation, as kernels (see rudc/learning/inference.py)."""

from __future__ import annotations

import math
from typing import Annotated

import numpy as np

from rudc.arrays import Floats
from rudc.kernels import Cube, Layout, NewSingle, NewTable, Vector, kernel

Number = Annotated[np.float32, Layout("float32")]
"""a number of single precision"""
Single = Annotated[Floats, Layout("float32", 1, readonly=True)]
"""(n,) of single precision, read; the others likewise"""
Singles = Annotated[Floats, Layout("float32", 2, readonly=True)]
SingleCube = Annotated[Floats, Layout("float32", 3, readonly=True)]
NewSingles = Annotated[Floats, Layout("float32", 2)]
NewSingleCube = Annotated[Floats, Layout("float32", 3)]

_P, *_A = (
    np.float32(v) for v in (0.3275911, 1.061405429, -1.453152027, 1.421413741, -0.284496736, 0.254829592)
)
_A1, _A2, _A3, _A4, _A5 = _A
_ROOT_HALF, _HALF, _ONE, _ZERO = (np.float32(v) for v in (math.sqrt(0.5), 0.5, 1.0, 0.0))
_ROOT_TWO_BY_PI, _CUBIC, _TWICE = (np.float32(v) for v in (0.7978845608, 0.044715, 2.0))
_AT_MIDDLE = math.exp(-0.15625)


@kernel
def exponential(z: float) -> float:
    """e^z for z <= 0, to 1e-10 of it; below e^-20, e^-20.

    (e^(z / 64))^64 with a series about the middle of [-0.3125, 0]: plain arithmetic, so that several numbers
    are computed at a time.
    """
    r = max(z, -20.0) * (1.0 / 64.0) + 0.15625
    e = 1.0 / 24.0 + r * (1.0 / 120.0 + r * (1.0 / 720.0 + r * (1.0 / 5040.0 + r * (1.0 / 40320.0))))
    e = _AT_MIDDLE * (1.0 + r * (1.0 + r * (0.5 + r * (1.0 / 6.0 + r * e))))
    e = e * e
    e = e * e
    e = e * e
    e = e * e
    e = e * e
    return e * e


@kernel
def gelu_of(x: NewSingle) -> int:
    """Put x Phi(x) in place of x (n,), to 3e-7. Returns 0.

    Phi by erf's formula 7.1.26 of Abramowitz and Stegun.
    """
    for i in range(len(x)):
        z = abs(x[i]) * _ROOT_HALF
        t = _ONE / (_ONE + _P * z)
        tail = t * (_A5 + t * (_A4 + t * (_A3 + t * (_A2 + t * _A1))))
        below = _HALF * x[i] * tail * np.float32(exponential(-z * z))  # x (1 - Phi(|x|))
        x[i] = x[i] - below if x[i] > _ZERO else below
    return 0


@kernel
def gelu_slope(x: Singles) -> NewSingles:
    """(N, O) the derivative of x Phi(x) at each of x (N, O): Phi(x) + x phi(x)."""
    y = x.copy()
    for n in range(len(x)):
        for i in range(x.shape[1]):
            z = np.float64(x[n, i])
            y[n, i] = 0.5 * math.erfc(-z * math.sqrt(0.5)) + z * math.exp(-0.5 * z * z) / math.sqrt(
                2 * math.pi
            )
    return y


@kernel
def gelu_tanh_of(x: NewSingle) -> int:
    """Put x (1 + tanh(sqrt(2 / pi) (x + 0.044715 x^3))) / 2 in place of x (n,). Returns 0."""
    for i in range(len(x)):
        inner = _ROOT_TWO_BY_PI * (x[i] + _CUBIC * x[i] * x[i] * x[i])
        e = np.float32(exponential(_TWICE * -abs(inner)))
        tanh = (_ONE - e) / (_ONE + e)
        x[i] = _HALF * x[i] * (_ONE + (tanh if inner > _ZERO else -tanh))
    return 0


@kernel
def mapped(x: Single, weight: Singles, bias: Single) -> NewSingle:
    """(O,) x W + b of x (I,), W (I, O), b (O,); what is 0 in x costs nothing."""
    y = bias.copy()
    for i in range(len(x)):
        if x[i] != _ZERO:
            for j in range(len(y)):
                y[j] += x[i] * weight[i, j]
    return y


@kernel
def mapped_each(x: Singles, weight: SingleCube, bias: Singles) -> NewSingles:
    """(N, O), the same for each of N members: x (N, I), W (N, I, O), b (N, O)."""
    y, whole = bias.copy(), x.shape[1] - x.shape[1] % 4
    for n in range(len(x)):
        for i in range(0, whole, 4):  # four terms at a time, one after the other: y is written less often
            a, b, c, d = x[n, i], x[n, i + 1], x[n, i + 2], x[n, i + 3]
            for j in range(y.shape[1]):
                first = y[n, j] + a * weight[n, i, j] + b * weight[n, i + 1, j]
                y[n, j] = first + c * weight[n, i + 2, j] + d * weight[n, i + 3, j]
        for i in range(whole, x.shape[1]):
            for j in range(y.shape[1]):
                y[n, j] += x[n, i] * weight[n, i, j]
    return y


@kernel
def decoded(
    latent: Singles, weight: SingleCube, bias: Singles, last: SingleCube, last_bias: Singles
) -> NewSingles:
    """(N, O), of each of N members gelu(gelu(latent) W + b) W' + b' for latents (N, I)."""
    x = latent.copy()
    for n in range(len(x)):
        gelu_of(x[n])
    y = mapped_each(x, weight, bias)
    for n in range(len(y)):
        gelu_of(y[n])
    return mapped_each(y, last, last_bias)


@kernel
def decoded_with(
    action: Single, action_weight: Singles, action_bias: Single,
    latent: Singles, weight: SingleCube, bias: Singles, last: SingleCube, last_bias: Singles,
) -> NewSingles:  # fmt: skip
    """(N, O), `decoded` of latents (N, I) and all members' maps of an action (A,), (A, N I) and (N I,)."""
    own = mapped(action, action_weight, action_bias).reshape(latent.shape)
    return decoded(latent + own, weight, bias, last, last_bias)


@kernel
def huber_slopes(
    predicted: SingleCube, target: Singles, tau: Single, kappa: float, slope: NewSingleCube, loss: NewSingles
) -> int:
    """Put sums over targets in `slope` (N, B, Q) and, over predictions too, in `loss` (N, B). Returns 0.

    `predicted` (N, B, Q), `target` (B, M), `tau` (Q,): see rudc/learning/quantiles.py.
    """
    bound = np.float32(kappa)
    below, step = _ONE - tau, _TWICE * tau - _ONE
    parts = np.empty(len(tau), np.float32)
    for n in range(len(predicted)):
        for b in range(predicted.shape[1]):
            z, s = predicted[n, b], slope[n, b]
            for j in range(len(tau)):
                s[j] = _ZERO
                parts[j] = _ZERO
            for i in range(target.shape[1]):
                y = target[b, i]
                for j in range(len(tau)):
                    delta = y - z[j]
                    c = min(max(delta, -bound), bound)
                    share = below[j] * c + step[j] * max(c, _ZERO)
                    s[j] += share
                    parts[j] += share * (delta - _HALF * c)
            loss[n, b] = parts.sum()
    return 0


@kernel
def tail_deviations(quantiles: Cube, weights: Vector) -> NewTable:
    """(3, B), roots of: the variance over members of the tail's mean, the mean over members of the tail's
    variance, and the sum of both.

    `quantiles` (N, B, Q) in any order; the tail is the lowest of them, with `weights`, which sum to 1.
    """
    members, count = len(quantiles), len(weights)
    result, means, z = np.zeros((3, quantiles.shape[1])), np.empty(members), np.empty(count)
    for b in range(quantiles.shape[1]):
        for n in range(members):
            for i in range(quantiles.shape[2]):  # insertion sort of the lowest
                new, k = quantiles[n, b, i], min(i, count)
                while k > 0 and z[k - 1] > new:
                    if k < count:
                        z[k] = z[k - 1]
                    k -= 1
                if k < count:
                    z[k] = new
            means[n] = 0.0
            for k in range(count):
                means[n] += weights[k] * z[k]
            for k in range(count):
                result[1, b] += weights[k] * (z[k] - means[n]) ** 2 / members
        mean = means.sum() / members
        for n in range(members):
            result[0, b] += (means[n] - mean) ** 2 / members
        result[2, b] = result[0, b] + result[1, b]
        for part in range(3):
            result[part, b] = math.sqrt(result[part, b])
    return result
