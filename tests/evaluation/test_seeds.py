"""Means over trainings, their intervals and pairs, against scipy and closed forms."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from rudc.evaluation.seeds import interquartile_mean, over_seeds, paired, paired_mean, paired_rate
from rudc.evaluation.statistics import Z

RNG = np.random.default_rng


@given(st.lists(st.floats(-1e3, 1e3), min_size=4, max_size=40))
def test_interquartile_mean_is_scipys_where_four_divides(values):
    values = np.array(values[: len(values) // 4 * 4])
    ours = interquartile_mean(values[None, :])[0]
    assert ours == pytest.approx(stats.trim_mean(values, 0.25), abs=1e-9)


@given(st.lists(st.floats(-1e3, 1e3), min_size=1, max_size=30))
def test_interquartile_mean_is_that_of_every_value_four_times(values):
    """Which four divides, so that scipy's needs no rounding; and nan counts as not there."""
    values = np.array(values)
    ours = interquartile_mean(np.append(values, [math.nan, math.nan])[None, :])[0]
    assert ours == pytest.approx(stats.trim_mean(np.repeat(values, 4), 0.25), abs=1e-9)


def test_mean_and_std_are_those_of_trainings():
    cells = {(s, k): np.full(5, 10.0 * s + i) for s in (0, 1, 2) for i, k in enumerate(("fog", "ice"))}
    found = over_seeds(cells)
    assert (found.mean, found.std) == (10.5, 10.0)
    assert (found.seeds, found.episodes) == (3, 30)
    assert (found.low, found.high) == (0.5, 20.5)  # trainings drawn three times the same: 2 in 27
    assert found.iqm == pytest.approx(interquartile_mean(np.array([[0.0, 1, 10, 11, 20, 21]]))[0])


def test_of_one_training_and_scenario_the_interval_is_scipys_bootstrap():
    values = RNG(3).gamma(2.0, 3.0, size=80)
    found = over_seeds({(0, "fog"): values}, resamples=20_000)
    theirs = stats.bootstrap((values,), np.mean, n_resamples=20_000, method="percentile", rng=5)
    low, high = theirs.confidence_interval
    np.testing.assert_allclose((found.low, found.high), (low, high), atol=0.05 * (high - low))
    assert math.isnan(found.std)
    assert found.iqm == found.mean


def test_of_a_rate_the_interval_has_the_binomials_width():
    values = np.array([100.0] * 80 + [0.0] * 320)
    found = over_seeds({(0, "fog"): values}, resamples=20_000)
    half = 100 * Z * math.sqrt(0.2 * 0.8 / 400)
    np.testing.assert_allclose((found.low, found.high), (20 - half, 20 + half), atol=0.3)


def test_spread_of_trainings_and_of_episodes_add_up():
    """S trainings whose means vary by a, of n episodes that vary by b: the variance of the bootstrap's mean
    is ((S - 1) / S s2 + (n - 1) / n b2 / n) / S, with s2 the variance of the trainings' means.
    """
    rng = RNG(8)
    seeds, n = 40, 30
    cells = {(s, "fog"): rng.normal(rng.normal(0, 2.0), 3.0, size=n) for s in range(seeds)}
    found = over_seeds(cells, resamples=20_000)
    means = np.array([values.mean() for values in cells.values()])
    inside = np.mean([values.var() for values in cells.values()]) / n
    half = Z * math.sqrt((means.var() + inside) / seeds)
    assert found.high - found.low == pytest.approx(2 * half, rel=0.03)


def test_scenarios_count_the_same_and_are_not_drawn():
    """Two scenarios without spread inside, however many episodes each has: no interval but a point."""
    found = over_seeds({(0, "fog"): np.full(90, 80.0), (0, "ice"): np.full(10, 20.0)})
    assert found.mean == 50.0
    assert math.isnan(found.low)


def test_a_rate_is_never_a_point():
    """Where nothing failed, nothing else can be drawn: Wilson's interval of all episodes together."""
    cells = {(s, "fog"): np.full(20, 100.0) for s in (0, 1)}
    found = over_seeds(cells, rate=True)
    theirs = stats.binomtest(40, 40).proportion_ci(0.95, method="wilson")
    np.testing.assert_allclose((found.low, found.high), (100 * theirs.low, 100.0))
    wide = over_seeds({(0, "fog"): np.full(20, 100.0), (1, "fog"): np.zeros(20)}, rate=True)
    assert (wide.low, wide.high) == (0.0, 100.0)  # the bootstrap's: two trainings that have nothing in common


@pytest.mark.parametrize(("big", "small"), [(0.0, 0.8), (0.05, 0.05), (0.5, 0.5)])
def test_of_cells_of_unequal_size_the_interval_of_a_rate_is_about_its_mean(big, small):
    """Of one scenario most episodes could not be run: the interval holds the mean in 95 of 100 cases."""
    rng = RNG(4)
    held = 0
    for _ in range(300):
        cells = {(0, "fog"): 100.0 * (rng.random(100) < big), (0, "ice"): 100.0 * (rng.random(5) < small)}
        found = over_seeds(cells, resamples=200, rate=True)
        assert math.isclose(found.mean, sum(values.mean() for values in cells.values()) / 2)
        held += found.low <= 50 * (big + small) <= found.high
    assert held > 0.93 * 300


def test_the_same_every_time_and_nothing_of_nothing():
    cells = {(s, "fog"): RNG(s).normal(size=20) for s in (0, 1)}
    assert over_seeds(cells) == over_seeds(dict(reversed(cells.items())))
    assert over_seeds(cells, seed=1) != over_seeds(cells)
    empty = over_seeds({(0, "fog"): np.array([math.nan])})
    assert math.isnan(empty.mean)
    assert empty.episodes == 0
    single = over_seeds({(0, "fog"): np.array([3.0])})
    assert (single.mean, single.iqm) == (3.0, 3.0)
    assert math.isnan(single.low)


def test_pairs_of_a_rate_are_mcnemars():
    new = [True] * 30 + [False] * 8 + [True] * 62
    old = [False] * 30 + [True] * 8 + [True] * 62
    found = paired_rate(new, old)
    assert (found.pairs, found.more, found.less, found.change) == (100, 30, 8, 22.0)
    assert found.p == pytest.approx(stats.binomtest(8, 38, 0.5).pvalue)
    chi2 = (abs(30 - 8) - 1) ** 2 / (30 + 8)  # Edwards' approximation of the same test
    assert found.p == pytest.approx(stats.chi2.sf(chi2, 1), rel=0.3)
    assert 0 < found.low < 22 < found.high


def test_pairs_of_a_mean_leave_out_what_is_not_known():
    new, old = RNG(1).normal(5, 1, 200), RNG(2).normal(3, 1, 200)
    new[0] = math.nan
    found = paired_mean(new, old)
    assert found.pairs == 199
    assert found.change == pytest.approx(np.nanmean(new - old))
    theirs = stats.ttest_rel(new[1:], old[1:]).confidence_interval()
    np.testing.assert_allclose((found.low, found.high), (theirs.low, theirs.high), atol=0.03)
    assert math.isnan(paired_mean(np.zeros(0), np.zeros(0)).change)


def test_pairs_of_one_training_are_as_they_are():
    new, old = RNG(1).integers(2, size=(2, 60)) * 100.0
    assert paired({(0, "fog"): new}, {(0, "fog"): old}, rate=True) == paired_rate(new > 0, old > 0)
    assert paired({(0, "fog"): new}, {(0, "fog"): old}) == paired_mean(new, old)


@pytest.mark.parametrize("rate", [False, True])
def test_of_several_trainings_pairs_are_not_as_many_as_their_episodes(rate):
    """One training is better by 20 points, the other worse: 400 pairs say less than their number."""
    none, some = np.zeros(200), np.repeat([100.0, 0.0], [40, 160])
    new, old = {(0, "fog"): some, (1, "fog"): none}, {(0, "fog"): none, (1, "fog"): some}
    found = paired(new, old, rate=rate)
    both = [np.concatenate(list(of.values())) for of in (new, old)]
    pooled = paired_rate(both[0] > 0, both[1] > 0) if rate else paired_mean(*both)
    assert (found.change, found.p) == pytest.approx((pooled.change, pooled.p), nan_ok=True)
    assert pooled.high < 6 < 20 < found.high < 30
    assert found.low < -20
    alike = {(s, "fog"): some for s in (0, 1)}
    same = paired(alike, {(s, "fog"): none for s in (0, 1)}, rate=rate)
    assert same.low > 10  # trainings that agree


def test_pairs_of_trainings_are_statsmodels_and_scipys():
    """By the exact test of statsmodels, where it is installed, and by closed forms."""
    tables = pytest.importorskip(
        "statsmodels.stats.contingency_tables", reason="statsmodels is no dependency of ours"
    )
    for more, less, both, neither in ((30, 8, 50, 12), (1, 0, 9, 0), (7, 7, 0, 3)):
        new = [True] * more + [False] * less + [True] * both + [False] * neither
        old = [False] * more + [True] * less + [True] * both + [False] * neither
        theirs = tables.mcnemar([[both, more], [less, neither]], exact=True).pvalue
        assert paired_rate(new, old).p == pytest.approx(theirs)
