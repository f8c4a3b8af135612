"""Intervals against scipy and against what defines them."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from rudc.errors import InputError
from rudc.evaluation.seeds import paired_mean, paired_rate
from rudc.evaluation.statistics import (
    NORMAL_FROM,
    RESAMPLES,
    STUDENT_BELOW,
    Z,
    mcnemar,
    mean_interval,
    mean_intervals,
    paired_change,
    student,
    summarise_all,
    summarise_rate,
    wilson,
)

counts = st.integers(1, 400).flatmap(lambda n: st.tuples(st.integers(0, n), st.just(n)))


@given(counts)
def test_wilson_is_scipys(case):
    k, n = case
    theirs = stats.binomtest(k, n).proportion_ci(0.95, method="wilson")
    np.testing.assert_allclose(wilson(k, n), (theirs.low, theirs.high), atol=1e-12)


@given(counts)
def test_wilsons_ends_are_where_the_score_test_just_refuses(case):
    k, n = case
    for end in wilson(k, n):
        if 0.0 < end < 1.0:
            score = (k / n - end) / math.sqrt(end * (1 - end) / n)
            assert abs(score) == pytest.approx(Z, rel=1e-9)


def test_wilson_covers_the_true_rate_about_as_often_as_it_says():
    rng = np.random.default_rng(1)
    draws = rng.binomial(60, 0.9, size=2000)
    inside = [low <= 0.9 <= high for low, high in (wilson(int(k), 60) for k in draws)]
    assert 0.92 < np.mean(inside) < 0.98


def test_no_trials_tell_nothing():
    assert all(math.isnan(end) for end in wilson(0, 0))
    assert all(math.isnan(value) for value in summarise_rate(np.zeros(0, dtype=bool)))
    assert all(math.isnan(value) for value in summarise_all([(np.zeros(0), None)])[0])


def test_bootstrap_agrees_with_scipy():
    values = np.random.default_rng(3).gamma(2.0, 3.0, size=80)
    theirs = stats.bootstrap((values,), np.mean, n_resamples=20_000, method="percentile", rng=5)
    width = theirs.confidence_interval.high - theirs.confidence_interval.low
    np.testing.assert_allclose(mean_interval(values), tuple(theirs.confidence_interval), atol=0.04 * width)


def test_bootstrap_of_many_values_is_the_normal_interval():
    values = np.random.default_rng(4).normal(5.0, 2.0, size=3000)
    half = Z * values.std(ddof=1) / math.sqrt(len(values))
    np.testing.assert_allclose(
        mean_interval(values), (values.mean() - half, values.mean() + half), atol=0.1 * half
    )


def test_bootstrap_is_the_same_every_time_and_however_it_is_cut_into_chunks(monkeypatch):
    values = np.random.default_rng(5).normal(size=50)
    whole = mean_interval(values)
    assert mean_interval(values) == whole
    monkeypatch.setattr("rudc.evaluation.statistics._CHUNK", 50 * RESAMPLES // 7)
    np.testing.assert_allclose(mean_interval(values), whole)
    assert mean_interval(values, seed=1) != whole


@pytest.mark.parametrize("n", [2, 5, STUDENT_BELOW - 1])
def test_interval_of_few_values_is_students(n):
    values = np.random.default_rng(n).gamma(2.0, size=n)
    theirs = stats.ttest_1samp(values, 0.0).confidence_interval(0.95)
    np.testing.assert_allclose(mean_interval(values), tuple(theirs))
    assert student(values) == mean_interval(values)


def test_interval_of_few_ratios_is_that_of_what_is_left_of_them():
    """Where all parts are alike, a ratio is a mean."""
    values = np.random.default_rng(11).gamma(2.0, size=6)
    np.testing.assert_allclose(mean_interval(values, over=np.full(6, 4.0)), np.array(student(values)) / 4.0)


@pytest.mark.parametrize("n", [3, 5, 10])
def test_intervals_of_few_values_hold_the_true_mean_as_often_as_they_say(n):
    rng = np.random.default_rng(12)
    samples = rng.normal(5.0, 2.0, size=(4_000, n))
    ends = np.array(mean_intervals([(values, None) for values in samples]))
    held = np.mean((ends[:, 0] <= 5.0) & (ends[:, 1] >= 5.0))
    assert held == pytest.approx(0.95, abs=4 * math.sqrt(0.95 * 0.05 / 4_000))


@pytest.mark.parametrize("n", [2, 5, STUDENT_BELOW, NORMAL_FROM])
def test_values_that_are_all_the_same_have_no_interval_however_many(n):
    assert all(math.isnan(end) for end in mean_interval(np.full(n, 100.0)))
    together = mean_intervals([(np.full(n, 100.0), None), (np.arange(n, dtype=float), None)])
    assert [math.isnan(ends[0]) for ends in together] == [True, False]


@pytest.mark.parametrize("ratio", [0.0, 0.3])
def test_ratios_that_are_all_the_same_have_no_interval_however_many(ratio):
    steps = np.array([0.0, 3.0, 41.0, 77.0, 142.0])
    assert all(math.isnan(end) for end in mean_interval(ratio * steps, over=steps))
    assert not math.isnan(mean_interval(ratio * steps + [0, 0, 0, 0, 1], over=steps)[0])
    many = np.arange(1.0, STUDENT_BELOW + 1)
    assert all(math.isnan(end) for end in mean_interval(ratio * many, over=many))


@settings(max_examples=25)
@given(st.lists(st.floats(-1e3, 1e3), min_size=2, max_size=40))
def test_a_mean_lies_within_its_values_and_its_interval_around_it(values):
    summary = summarise_all([(np.array(values), None)])[0]
    tolerance = 1e-9 * (1 + max(map(abs, values)))
    assert min(values) - tolerance <= summary.mean <= max(values) + tolerance
    assert not summary.low > summary.mean + tolerance
    assert not summary.high < summary.mean - tolerance
    assert summary.std == pytest.approx(np.std(values, ddof=1), abs=1e-9)


def test_one_value_has_a_mean_and_nothing_else():
    summary = summarise_all([(np.array([2.5, math.nan]), None)])[0]
    assert summary.mean == 2.5
    assert all(math.isnan(value) for value in summary[1:])
    rate = summarise_rate(np.array([True]))
    assert rate.mean == 100.0
    assert math.isnan(rate.std)
    assert rate.low == pytest.approx(100 * wilson(1, 1)[0])


def test_rates_are_percentages_with_the_spread_of_their_indicator():
    happened = np.array([True] * 3 + [False] * 7)
    rate = summarise_rate(happened)
    assert rate.mean == pytest.approx(30.0)
    assert rate.std == pytest.approx(100 * happened.std(ddof=1))
    np.testing.assert_allclose((rate.low, rate.high), [100 * end for end in wilson(3, 10)])


def test_bootstrap_is_of_the_means_of_what_is_drawn():
    values, over = np.random.default_rng(6).gamma(2.0, size=(2, 30))
    draws = np.random.default_rng(9).integers(30, size=(500, 30))
    means, ratios = values[draws].mean(axis=1), values[draws].sum(axis=1) / over[draws].sum(axis=1)
    np.testing.assert_allclose(mean_interval(values, 500, 9), np.quantile(means, [0.025, 0.975]))
    np.testing.assert_allclose(mean_interval(values, 500, 9, over=over), np.quantile(ratios, [0.025, 0.975]))


def test_many_samples_have_the_intervals_that_each_has_alone():
    rng = np.random.default_rng(7)
    samples = [(rng.normal(size=n), None) for n in (40, 7, 40, 1, 0)] + [(rng.random(40), np.ones(40))]
    for together, (values, over) in zip(mean_intervals(samples), samples, strict=True):
        np.testing.assert_allclose(together, mean_interval(values, over=over))


@pytest.mark.parametrize("ratio", [False, True])
def test_of_very_many_values_the_bootstrap_gives_the_normal_interval(ratio, monkeypatch):
    values, over = np.random.default_rng(8).gamma(2.0, size=(2, NORMAL_FROM))
    quick = mean_interval(values, over=over if ratio else None)
    monkeypatch.setattr("rudc.evaluation.statistics.NORMAL_FROM", NORMAL_FROM + 1)
    drawn = mean_interval(values, 2_000, over=over if ratio else None)
    np.testing.assert_allclose(quick, drawn, atol=0.08 * (drawn[1] - drawn[0]))


@given(st.integers(0, 60), st.integers(0, 60))
def test_mcnemar_is_the_binomial_test(more, less):
    theirs = stats.binomtest(more, more + less).pvalue if more + less else 1.0
    assert mcnemar(more, less) == pytest.approx(theirs)


def test_change_of_pairs():
    assert paired_change(100, 3, 3)[0] == 0.0
    change, low, high = paired_change(200, 2, 12)
    assert change == -5.0
    assert low < -5.0 < high < 0.0
    _, low, high = paired_change(10, 0, 0)
    assert low == -high < -10.0  # ten alike episodes prove little
    assert all(math.isnan(value) for value in paired_change(0, 0, 0))


def test_any_sequence_of_numbers_has_a_mean():
    assert mean_interval([1, 2, 3]) == mean_interval((1.0, 2.0, 3.0)) == student(np.array([1.0, 2.0, 3.0]))
    assert mean_interval([1, 2, 4], over=[1, 1, 2]) == mean_interval(
        np.array([1.0, 2.0, 4.0]), over=np.array([1.0, 1.0, 2.0])
    )


@pytest.mark.parametrize(
    ("call", "told"),
    [
        (lambda: wilson(5, 3), "wilson: 5 successes of 3 trials"),
        (lambda: wilson(-1, 3), "give 0 <= successes <= trials"),
        (lambda: mean_interval("123"), "give numbers in a row"),
        (lambda: mean_interval([[1, 2], [3, 4]]), r"give numbers in a row, \(n,\), not \[\[1, 2"),
        (lambda: mean_interval(3.0), "give numbers in a row"),
        (lambda: mean_interval([1, 2], over=[1]), "2 values over 1; give as many of each"),
        (lambda: mean_interval([1, math.nan]), "mean_interval: value 2 is nan; give finite numbers"),
        (lambda: mean_interval([1, 2], over=[math.inf, 1]), "over: value 1 is inf; give finite numbers"),
        (lambda: paired_rate([2, 0, 1], [0, 0, 1]), "paired_rate: 2 is neither True nor False"),
        (lambda: paired_rate([1, 0], [math.nan, 0]), "paired_rate: nan is neither True nor False"),
        (lambda: paired_rate([True], [True, False]), "paired_rate: 1 values and 2; pairs are of the same"),
        (lambda: paired_mean([1.0], [1.0, 2.0]), "paired_mean: 1 values and 2; pairs are of the same"),
        (lambda: paired_mean(["a"], [1.0]), "paired_mean: give numbers in a row"),
    ],
)  # fmt: skip
def test_what_has_no_interval_is_refused(call, told):
    with pytest.raises(InputError, match=told):
        call()


def test_pairs_may_be_lists_or_arrays():
    assert paired_mean([1, 2, 3], [2, 3, 5]) == paired_mean(np.array([1.0, 2, 3]), np.array([2.0, 3, 5]))
    flags = [True, False, True], [False, False, True]
    assert paired_rate(*map(np.array, flags)) == paired_rate(*flags)
