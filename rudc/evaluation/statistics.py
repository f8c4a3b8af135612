"""95 % intervals: Wilson's for rates; for means Student's of few values, else a seeded percentile bootstrap.

Wilson. With p = k / n and z the normal quantile, the interval holds all true rates whose score test does not
refuse k:
    centre = (p + z^2 / 2n) / (1 + z^2 / n)
    half   = z / (1 + z^2 / n) * sqrt(p (1 - p) / n + z^2 / 4n^2)
It stays within [0, 1] and is not a point where k = 0 or k = n.

Bootstrap. The mean of n values drawn with replacement, RESAMPLES times; the interval runs from the 2.5 to the
97.5 percentile of these means. The draws depend on n only, so equal values have equal intervals, wherever
they come from. From NORMAL_FROM values on it is mean +- z s / sqrt(n), which differs from it by less than two
choices of the draws do.

Student. The bootstrap of n values is too narrow by a factor of about sqrt((n - 1) / n) z / t: of two normal
values its interval holds the true mean in 50 of 100 cases, of five in 85, of ten in 91. Below STUDENT_BELOW
values the interval is therefore mean +- t s / sqrt(n), t the 0.975 quantile of Student's distribution with
n - 1 degrees of freedom.

Values that are all the same, or all ratios, have no interval, however many they are: they do not tell how far
apart others would be.

Differences of rates in the same episodes: the interval of Bonett and Price (J. Educ. Behav. Stat. 37, 2012),
Wald's with one more pair of each kind, and McNemar's exact test.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from rudc.arrays import Array, Flags
from rudc.errors import InputError
from rudc.imports import shortened

Z = 1.959963984540054
"""normal quantile of 0.975"""
RESAMPLES = 10_000
SEED = 20_250
"""seed of the bootstrap's draws"""
NORMAL_FROM = 2_000
"""values from which on the normal interval stands for the bootstrap's"""
STUDENT_BELOW = 20
"""values below which Student's does"""
_CHUNK = 2_000_000
"""draws held in memory at once"""


class Summary(NamedTuple):
    """A mean with its spread and its 95 % interval; nan where there are too few values to tell."""

    mean: float
    std: float
    """standard deviation of the values (n - 1), not of the mean"""
    low: float
    high: float


def wilson(successes: float, trials: float) -> tuple[float, float]:
    """Ends of the 95 % interval of a rate, in [0, 1]; (nan, nan) without trials. Neither needs to be a whole
    number (rudc/evaluation/seeds.py). Raises InputError unless 0 <= successes <= trials.
    """
    if not 0 <= successes <= trials:
        raise InputError(
            f"wilson: {successes:g} successes of {trials:g} trials; give 0 <= successes <= trials"
        )
    if trials == 0:
        return math.nan, math.nan
    rate, shrink = successes / trials, 1.0 + Z**2 / trials
    centre = (rate + Z**2 / (2 * trials)) / shrink
    half = Z / shrink * math.sqrt(rate * (1 - rate) / trials + Z**2 / (4 * trials**2))
    low = 0.0 if successes == 0 else max(centre - half, 0.0)
    high = 1.0 if successes == trials else min(centre + half, 1.0)
    return low, high


Sample = tuple[Array, Array | None]
"""values (n,) and None: their mean is asked for; values (n,) and others (n,): the ratio of their sums"""


def mean_interval(
    values: ArrayLike, resamples: int = RESAMPLES, seed: int = SEED, *, over: ArrayLike | None = None
) -> tuple[float, float]:
    """Ends of the 95 % interval of the mean of values (n,), or of their sum divided by that of `over` (n,);
    (nan, nan) of fewer than two, and where all values, or all ratios, are the same, however many. Raises
    InputError for anything but finite numbers in a row, and where `over` has more or fewer than `values`.
    """
    numbers = _finite(values, "mean_interval")
    divisors = None if over is None else _finite(over, "mean_interval: over")
    if divisors is not None and len(divisors) != len(numbers):
        raise InputError(f"mean_interval: {len(numbers)} values over {len(divisors)}; give as many of each")
    return mean_intervals([(numbers, divisors)], resamples, seed)[0]


def row_of_numbers(values: ArrayLike, what: str) -> Array:
    """(n,) numbers that a user gave as any sequence. Raises InputError, which calls them `what`."""
    try:
        numbers = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError):
        numbers = np.empty(())
    if numbers.ndim != 1:
        raise InputError(f"{what}: give numbers in a row, (n,), not {shortened(values)}")
    return numbers


def _finite(values: ArrayLike, what: str) -> Array:
    """`row_of_numbers`. Raises InputError also for one that is nan or infinite."""
    numbers = row_of_numbers(values, what)
    wrong = np.flatnonzero(~np.isfinite(numbers))
    if len(wrong):
        raise InputError(f"{what}: value {wrong[0] + 1} is {numbers[wrong[0]]:g}; give finite numbers")
    return numbers


def mean_intervals(
    samples: Sequence[Sample], resamples: int = RESAMPLES, seed: int = SEED
) -> list[tuple[float, float]]:
    """The same of many samples; those of one size share their draws, as they would alone."""
    found = [(math.nan, math.nan)] * len(samples)
    sizes: dict[int, list[int]] = {}
    for k, sample in enumerate(samples):
        if len(sample[0]) > 1 and not _all_same(*sample):
            sizes.setdefault(len(sample[0]), []).append(k)
    for n, members in sizes.items():
        alike = [samples[k] for k in members]
        if n < STUDENT_BELOW:
            ends = [student(*sample) for sample in alike]
        elif n < NORMAL_FROM:
            ends = _percentiles(alike, n, resamples, seed)
        else:
            ends = [_around_mean(*sample, Z) for sample in alike]
        for k, interval in zip(members, ends, strict=True):
            found[k] = interval
    return found


def student(values: Array, over: Array | None = None) -> tuple[float, float]:
    """Ends of Student's 95 % interval of the mean of values (n,), or of their sum divided by that of `over`
    (n,); (nan, nan) of fewer than two, and where all values, or all ratios, are the same.
    """
    n = len(values)
    if n < 2 or _all_same(values, over):
        return math.nan, math.nan
    from scipy.special import stdtrit  # loads slowly

    return _around_mean(values, over, float(stdtrit(n - 1, 0.975)))


def _all_same(values: Array, over: Array | None) -> bool:
    """Whether values, or their ratios to `over`, are equal but for rounding; 0 of 0, which is no ratio,
    equals any.
    """
    if over is None:
        return np.allclose(values, values[0], rtol=1e-12, atol=0.0)
    return np.allclose(values * over.sum(), over * values.sum(), rtol=1e-12, atol=0.0)


def _percentiles(samples: Sequence[Sample], n: int, resamples: int, seed: int) -> list[tuple[float, float]]:
    """Of samples of n values each: how often each value is drawn, times the values. Rounded, since the last
    digits of a product of matrices depend on the machine.
    """
    rng = np.random.default_rng(seed)
    tops = np.stack([values for values, _ in samples], axis=1)
    ratios = [k for k, (_, over) in enumerate(samples) if over is not None]
    bottoms = np.stack([over for _, over in samples if over is not None], axis=1) if ratios else None
    rows = max(_CHUNK // n, 1)
    means = np.empty((resamples, len(samples)))
    for start in range(0, resamples, rows):
        count = min(rows, resamples - start)
        draws = rng.integers(n, size=(count, n)) + n * np.arange(count)[:, None]
        counts = np.bincount(draws.ravel(), minlength=count * n).reshape(count, n).astype(float)
        means[start : start + count] = counts @ tops
        parts = np.full(means[start : start + count].shape, float(n))
        if bottoms is not None:
            parts[:, ratios] = counts @ bottoms
        means[start : start + count] /= parts
    low, high = np.quantile(means, [0.025, 0.975], axis=0)
    return [(round(float(a), 9), round(float(b), 9)) for a, b in zip(low, high, strict=True)]


def _around_mean(values: Array, over: Array | None, quantile: float) -> tuple[float, float]:
    """The mean +- so many of its standard errors; a ratio's error is its first-order one."""
    n = len(values)
    if over is None:
        centre, errors = values.mean(), values - values.mean()
    else:
        centre = values.sum() / over.sum()
        errors = (values - centre * over) / over.mean()
    half = quantile * errors.std(ddof=1) / math.sqrt(n)
    return float(centre - half), float(centre + half)


def paired_change(n: int, more: int, less: int) -> tuple[float, float, float]:
    """Change of a rate and its interval, percentage points, if `more` of n episodes have it only now, `less`
    only before; nan without episodes.
    """
    if n == 0:
        return math.nan, math.nan, math.nan
    p, q = (more + 1) / (n + 2), (less + 1) / (n + 2)
    half = Z * math.sqrt((p + q - (p - q) ** 2) / (n + 2))
    low, high = max(p - q - half, -1.0), min(p - q + half, 1.0)
    return 100.0 * (more - less) / n, 100.0 * low, 100.0 * high


def mcnemar(more: int, less: int) -> float:
    """p of McNemar's exact test: how likely is a split as uneven as `more` to `less`, if both were equally
    likely; 1 without either.
    """
    from scipy.special import bdtr  # loads slowly

    return min(2.0 * float(bdtr(min(more, less), more + less, 0.5)), 1.0)


def summarise_rate(happened: Flags) -> Summary:
    """Mean, spread and Wilson interval of happened (n,), in percent."""
    n, k = len(happened), int(np.count_nonzero(happened))
    if n == 0:
        return Summary(math.nan, math.nan, math.nan, math.nan)
    rate = k / n
    std = math.sqrt(rate * (1 - rate) * n / (n - 1)) if n > 1 else math.nan
    low, high = wilson(k, n)
    return Summary(100 * rate, 100 * std, 100 * low, 100 * high)


def summarise_all(samples: Sequence[Sample]) -> list[Summary]:
    """Mean, spread and interval of each sample: of its values (n,), or, where a second array (n,)
    of positive numbers comes along, of sum(first) / sum(second) with the spread of their ratios. Values or
    pairs with a nan count as not there.
    """
    known = [_known(sample) for sample in samples]
    return [
        _summary(sample, ends) if len(sample[0]) else Summary(math.nan, math.nan, math.nan, math.nan)
        for sample, ends in zip(known, mean_intervals(known), strict=True)
    ]


def _known(sample: Sample) -> Sample:
    values, over = sample
    there = ~np.isnan(values) if over is None else ~(np.isnan(values) | np.isnan(over))
    return values[there], None if over is None else over[there]


def _summary(sample: Sample, ends: tuple[float, float]) -> Summary:
    values, over = sample
    each = values if over is None else values / over
    mean = float(values.mean()) if over is None else float(values.sum() / over.sum())
    return Summary(mean, float(each.std(ddof=1)) if len(each) > 1 else math.nan, *ends)
