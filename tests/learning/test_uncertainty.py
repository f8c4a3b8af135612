"""sigma_epi, sigma_ale and sigma_total against hand-computed and closed forms; running percentiles."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import norm

from rudc.learning.distortion import midpoints
from rudc.learning.uncertainty import RunningPercentiles, uncertainty


def test_two_members_by_hand() -> None:
    """Tails of 4 quantiles at beta = 0.5 are the two lowest, {0, 2} and {4, 10}, in whatever order."""
    result = uncertainty([[2, 0, 50, 60], [70, 10, 80, 4]], beta=0.5)
    assert result.epistemic == pytest.approx(3.0)  # expectations 1 and 7
    assert result.aleatoric == pytest.approx(math.sqrt((1 + 9) / 2))
    assert result.total == pytest.approx(math.sqrt(9 + 5))


def test_part_of_a_quantile_counts_in_part() -> None:
    """beta = 0.375 of 4: weights 2/3 and 1/3 on 0 and 3, so mean 1 and variance 2."""
    result = uncertainty([[0, 3, 9, 9]], beta=0.375)
    assert result.epistemic == pytest.approx(0)
    assert result.aleatoric == pytest.approx(math.sqrt(2))


@pytest.mark.parametrize("beta", [0.1, 0.25, 1.0])
def test_tail_of_normal_distributions(beta: float) -> None:
    means, spread = np.array([-4.0, 0.0, 7.0]), 5.0
    z = norm.ppf(midpoints(20_000), means[:, None], spread)
    hazard = norm.pdf(norm.ppf(beta)) / beta
    below = 0.0 if beta == 1.0 else norm.ppf(beta) * hazard
    result = uncertainty(z, beta)
    assert result.aleatoric == pytest.approx(spread * math.sqrt(1 - below - hazard**2), rel=2e-3)
    assert result.epistemic == pytest.approx(means.std(), rel=1e-6)


def test_total_is_the_spread_of_all_tails_together() -> None:
    z = np.random.default_rng(0).normal(size=(5, 32)) * 10
    tails = np.sort(z, axis=1)[:, :8]
    assert uncertainty(z, 0.25).total == pytest.approx(tails.std())


def test_many_decisions_at_once() -> None:
    z = np.random.default_rng(1).normal(size=(5, 6, 32))
    together = uncertainty(z, 0.25)
    assert together.total.shape == (6,)
    for i in range(6):
        assert together.total[i] == pytest.approx(uncertainty(z[:, i], 0.25).total)


@given(st.lists(st.lists(st.floats(-1e3, 1e3), max_size=9), max_size=12))
def test_percentiles_of_the_last_ones_whatever_the_portions(portions: list[list[float]]) -> None:
    window = 10
    running = RunningPercentiles(window)
    for portion in portions:
        running.add(portion)
    last = [x for portion in portions for x in portion][-window:]
    assert len(running) == len(last)
    if last:
        assert running.values() == pytest.approx(tuple(np.percentile(last, [95, 97.5])))
    else:
        assert all(math.isnan(v) for v in running.values())


def test_percentiles_carry_on_from_their_state() -> None:
    rng = np.random.default_rng(2)
    one = RunningPercentiles(50)
    one.add(rng.normal(size=70))
    two = RunningPercentiles(50)
    two.load(one.state())
    more = rng.normal(size=33)
    one.add(more)
    two.add(more)
    assert one.values() == two.values()


def test_what_is_not_finite_is_left_out() -> None:
    running = RunningPercentiles()
    running.add([1.0, math.nan, math.inf])
    assert running.values() == (1.0, 1.0)
