"""Adam follows its formula, and its methods import no compiler."""

import sys

import numpy as np
import pytest
import torch

from rudc.learning.optimizer import Adam

RATE, STEPS = 0.1, 6
CURVATURE = np.array([1.0, 10.0, 0.1])


def after_the_formula(start):
    x, mean, square = start.copy(), np.zeros(3), np.zeros(3)
    for step in range(1, STEPS + 1):
        gradient = CURVATURE * x
        mean, square = 0.9 * mean + 0.1 * gradient, 0.999 * square + 0.001 * gradient**2
        x -= RATE * (mean / (1 - 0.9**step)) / (np.sqrt(square / (1 - 0.999**step)) + 1e-8)
    return x


@pytest.mark.parametrize("fused", [False, True])
def test_it_follows_the_formula_without_torchs_compiler(monkeypatch, fused):
    """Interrupted once: moments are saved, and loaded by another. What is None cannot be imported."""
    monkeypatch.setitem(sys.modules, "torch._dynamo", None)
    start = np.array([1.0, -2.0, 3.0])
    x = torch.tensor(start, requires_grad=True)
    adam = Adam([x], lr=RATE, fused=fused)
    for step in range(STEPS):
        if step == STEPS // 2:
            saved, adam = adam.state_dict(), Adam([x], lr=RATE, fused=fused)
            adam.load_state_dict(saved)
        adam.zero_grad()
        (0.5 * torch.from_numpy(CURVATURE) * x**2).sum().backward()
        adam.step()
    assert x.requires_grad
    assert torch.is_grad_enabled()
    np.testing.assert_allclose(x.detach().numpy(), after_the_formula(start), rtol=1e-12)
