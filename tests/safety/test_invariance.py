"""A short version of the study in tests/benchmarks/invariance.py."""

import pytest

from rudc.safety.filter import FilterConfig
from tests.benchmarks.invariance import run


@pytest.mark.parametrize("gamma", [100.0, 1000.0])
def test_ttcbf_keeps_h_positive_where_gamma_bounds_the_remainder(gamma: float) -> None:
    figures = run(
        FilterConfig.preset("ttcbf", constrained="all", last_resort=False, ttcbf_gamma=gamma),
        starts=50,
        seed=1,
    )
    assert figures.corrected > 20
    assert figures.broken == 0
    assert figures.remainder < 1000.0, "so that the second of the two proves more than the first"
    if gamma > figures.remainder:
        assert figures.samples_below == 0


def test_ecbf_keeps_h_positive_at_small_steps() -> None:
    figures = run(
        FilterConfig.preset("ecbf", constrained="all", last_resort=False, dt=0.025), starts=12, seed=2
    )
    assert figures.corrected > 100
    assert figures.deepest_inside > -1e-3
