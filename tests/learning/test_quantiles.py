"""Quantile Huber loss against the paper's formula pair by pair, and what minimises it."""

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from rudc.learning.distortion import midpoints
from rudc.learning.quantiles import quantile_huber


def by_pairs(predicted: np.ndarray, target: np.ndarray, kappa: float) -> np.ndarray:
    """Eq. (ensemble_huber_loss) of one member, (B,), every pair by itself."""
    loss = np.zeros(len(predicted))
    count = predicted.shape[1]
    for b in range(len(predicted)):
        for j in range(count):
            tau = (j + 0.5) / count
            for y in target[b]:
                delta = y - predicted[b, j]
                huber = 0.5 * delta**2 if abs(delta) <= kappa else kappa * (abs(delta) - 0.5 * kappa)
                loss[b] += abs(tau - (delta < 0)) * huber / kappa / target.shape[1]
    return loss


@settings(max_examples=25)
@given(st.integers(0, 2**32 - 1), st.sampled_from([0.3, 1.0, 5.0]), st.sampled_from([0.5, 20.0]))
def test_loss_is_the_sum_over_pairs(seed: int, kappa: float, spread: float) -> None:
    rng = np.random.default_rng(seed)
    predicted, target = spread * rng.normal(size=(2, 3, 4)), spread * rng.normal(size=(3, 6))
    loss = quantile_huber(torch.tensor(predicted), torch.tensor(target), kappa)
    for n in range(2):
        assert loss[n].numpy() == pytest.approx(by_pairs(predicted[n], target, kappa), rel=1e-9)


def test_gradient_is_that_of_the_loss() -> None:
    rng = np.random.default_rng(0)
    predicted = torch.tensor(3 * rng.normal(size=(2, 3, 5)), requires_grad=True)
    target = torch.tensor(3 * rng.normal(size=(3, 5)))
    assert torch.autograd.gradcheck(lambda z: quantile_huber(z, target, 1.0), [predicted])


@pytest.mark.parametrize("kappa", [0.3, 5.0])
def test_the_kernel_gives_the_same(kappa: float) -> None:
    """Of single precision, which it is for."""
    rng = np.random.default_rng(1)
    predicted, target = (3 * rng.normal(size=size) for size in ((2, 70, 32), (70, 24)))
    results = []
    for precision in (torch.float64, torch.float32):
        z = torch.tensor(predicted, dtype=precision, requires_grad=True)
        loss = quantile_huber(z, torch.tensor(target, dtype=precision), kappa)
        results.append((loss.detach().numpy(), torch.autograd.grad(loss.sum(), z)[0].numpy()))
    (loss, gradient), (loss_found, gradient_found) = results
    assert loss_found == pytest.approx(loss, rel=1e-5)
    assert gradient_found == pytest.approx(gradient, abs=1e-5)


def test_minimised_by_the_quantiles() -> None:
    """Gradient descent on samples of a skewed distribution arrives at its quantiles."""
    sample = torch.tensor(np.random.default_rng(2).exponential(10.0, size=(1, 4000)), dtype=torch.float64)
    z = torch.full((1, 1, 16), 15.0, dtype=torch.float64, requires_grad=True)
    adam = torch.optim.Adam([z], lr=0.5)
    for step in range(600):
        adam.param_groups[0]["lr"] = 0.5 * (1 - step / 600)
        adam.zero_grad()
        quantile_huber(z, sample, 0.1).sum().backward()
        adam.step()
    expected = np.quantile(sample.numpy(), midpoints(16))
    assert z.detach().numpy()[0, 0] == pytest.approx(expected, abs=0.2)
