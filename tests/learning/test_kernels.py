"""Kernels of networks and of the uncertainty against numpy."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import ndtr

from rudc.learning import kernels

RNG = np.random.default_rng(0)


def single(*shape):
    return RNG.normal(size=shape).astype(np.float32)


def test_gelu_is_x_times_the_normal_distributions_function():
    x = np.concatenate([np.linspace(-12, 12, 5000), [0.0, -200.0, 200.0]]).astype(np.float32)
    y = x.copy()
    kernels.gelu_of(y)
    assert y == pytest.approx(x * ndtr(x.astype(float)), abs=4e-7, rel=2e-7)


def test_maps_are_products():
    x, weight, bias = single(7), single(7, 40), single(40)
    x[2:4] = 0.0
    assert kernels.mapped(x, weight, bias) == pytest.approx(x @ weight + bias, abs=1e-5)
    rows, weights, biases = single(3, 16), single(3, 16, 9), single(3, 9)
    wanted = (rows[:, None] @ weights)[:, 0] + biases
    assert kernels.mapped_each(rows, weights, biases) == pytest.approx(wanted, abs=1e-5)


def test_a_head_is_two_maps_with_gelus_before_them():
    latent, weight, bias, last, last_bias = (
        single(2, 8),
        single(2, 8, 9),
        single(2, 9),
        single(2, 9, 3),
        single(2, 3),
    )

    def each(x, weight, bias):
        return ((x * ndtr(x))[:, None] @ weight)[:, 0] + bias

    wanted = each(each(latent, weight, bias), last, last_bias)
    assert kernels.decoded(latent, weight, bias, last, last_bias) == pytest.approx(wanted, abs=1e-4)


def test_deviations_of_the_tail():
    z, weights = RNG.normal(size=(4, 6, 32)), np.array([0.3, 0.3, 0.3, 0.1])
    got = kernels.tail_deviations(z, weights)
    tail = np.sort(z, axis=-1)[..., :4]
    mean = tail @ weights
    within = (((tail - mean[..., None]) ** 2) @ weights).mean(axis=0)
    assert got[0] == pytest.approx(mean.std(axis=0), abs=1e-12)
    assert got[1] == pytest.approx(np.sqrt(within), abs=1e-12)
    assert got[2] == pytest.approx(np.sqrt(mean.var(axis=0) + within), abs=1e-12)
