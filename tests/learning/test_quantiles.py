"""Quantile Huber loss against the paper's formula pair by pair, and what minimises it."""

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from rudc.learning.distortion import midpoints
from rudc.learning.quantiles import ROWS, quantile_huber


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


@settings(max_examples=25, deadline=None)
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


def test_more_rows_than_a_piece_has() -> None:
    rng = np.random.default_rng(1)
    predicted = torch.tensor(rng.normal(size=(2, ROWS + 5, 4)), requires_grad=True)
    target = torch.tensor(rng.normal(size=(ROWS + 5, 4)))
    quantile_huber(predicted, target).sum().backward()
    assert predicted.grad is not None
    for rows in (slice(0, 3), slice(ROWS, None)):
        part = predicted.detach()[:, rows].requires_grad_()
        quantile_huber(part, target[rows]).sum().backward()
        assert torch.equal(part.grad, predicted.grad[:, rows])  # pyright: ignore[reportArgumentType] -- set by backward


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
