"""Distortions against closed forms and numerical integration."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import norm

from rudc.learning.distortion import make_distortion, midpoints

MEAN, SPREAD = 3.0, 7.0
FINE = 20_000
"""quantiles of a nearly continuous distribution"""


def normal_quantiles(count: int) -> np.ndarray:
    return norm.ppf(midpoints(count), MEAN, SPREAD)


def test_cvar_is_the_mean_of_the_lowest_eight_of_32() -> None:
    weights = make_distortion("cvar", 0.25).weights(32)
    assert weights == pytest.approx([1 / 8] * 8 + [0] * 24)


def test_cvar_level_within_a_bin_counts_that_bin_in_part() -> None:
    assert make_distortion("cvar", 0.3).weights(4) == pytest.approx([0.25 / 0.3, 0.05 / 0.3, 0, 0])


def test_expectation_and_cvar_of_one_are_the_mean() -> None:
    assert make_distortion("expectation").weights(5) == pytest.approx([0.2] * 5)
    assert make_distortion("cvar", 1.0).weights(5) == pytest.approx([0.2] * 5)


@pytest.mark.parametrize("beta", [0.1, 0.25, 0.5, 0.9])
def test_cvar_of_a_normal_distribution(beta: float) -> None:
    closed_form = MEAN - SPREAD * norm.pdf(norm.ppf(beta)) / beta
    value = make_distortion("cvar", beta).weights(FINE) @ normal_quantiles(FINE)
    assert value == pytest.approx(closed_form, abs=2e-3)


@pytest.mark.parametrize("eta", [0.75, -0.5])
def test_wang_shifts_the_mean_of_a_normal_distribution(eta: float) -> None:
    value = make_distortion("wang", eta).weights(FINE) @ normal_quantiles(FINE)
    assert value == pytest.approx(MEAN - eta * SPREAD, abs=2e-2)


def cpw_slope(tau: float, eta: float) -> float:
    """zeta'(tau), differentiated by hand."""
    total = tau**eta + (1 - tau) ** eta
    outer = eta * tau ** (eta - 1) * total ** (-1 / eta)
    return outer - tau**eta * total ** (-1 / eta - 1) * (tau ** (eta - 1) - (1 - tau) ** (eta - 1))


@pytest.mark.parametrize("count", [7, 32])
def test_weights_are_the_integrals_of_the_distortions_slope(count: int) -> None:
    edges = np.linspace(0, 1, count + 1)
    slopes = {
        ("wang", 0.75): lambda t: norm.pdf(norm.ppf(t) + 0.75) / norm.pdf(norm.ppf(t)),
        ("cpw", 0.71): lambda t: cpw_slope(t, 0.71),
    }
    for (name, parameter), slope in slopes.items():
        weights = make_distortion(name, parameter).weights(count)
        inner = [quad(slope, edges[i], edges[i + 1])[0] for i in range(1, count - 1)]
        assert weights[1:-1] == pytest.approx(inner, abs=1e-8)


@pytest.mark.parametrize(
    ("name", "parameter"),
    [("expectation", None), ("cvar", 0.07), ("wang", None), ("cpw", None), ("cpw", 1.0)],
)
def test_weights_are_a_distribution(name: str, parameter: float | None) -> None:
    weights = make_distortion(name, parameter).weights(32)
    assert weights.shape == (32,)
    assert np.all(weights >= 0)
    assert weights.sum() == pytest.approx(1)


def test_averse_distortions_weigh_low_returns_more() -> None:
    quantiles = normal_quantiles(32)
    for name in ("cvar", "wang"):
        assert make_distortion(name).weights(32) @ quantiles < MEAN - SPREAD / 2


@pytest.mark.parametrize(("name", "parameter"), [("cvar", 0.0), ("cvar", 1.5), ("cpw", 0.1), ("median", 1.0)])
def test_wrong_ones_are_refused(name: str, parameter: float) -> None:
    with pytest.raises(ValueError, match=name):
        make_distortion(name, parameter)
