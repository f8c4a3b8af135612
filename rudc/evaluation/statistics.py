"""95 % intervals: Wilson's for rates, the seeded percentile bootstrap for means.

Wilson. With p = k / n and z the normal quantile, the interval holds all true rates whose score test does not
refuse k:
    centre = (p + z^2 / 2n) / (1 + z^2 / n)
    half   = z / (1 + z^2 / n) * sqrt(p (1 - p) / n + z^2 / 4n^2)
It stays within [0, 1] and is not a point where k = 0 or k = n.

Bootstrap. The mean of n values drawn with replacement, RESAMPLES times; the interval runs from the 2.5 to the
97.5 percentile of these means. The draws depend on n only, so equal values have equal intervals, wherever
they come from.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from rudc.arrays import Array, Flags

Z = 1.959963984540054
"""normal quantile of 0.975"""
RESAMPLES = 10_000
SEED = 20_250
"""of the bootstrap's draws"""
_CHUNK = 2_000_000
"""draws held in memory at once"""


class Summary(NamedTuple):
    """A mean with its spread and its 95 % interval; nan where there are too few values to tell."""

    mean: float
    std: float
    """of the values (n - 1), not of the mean"""
    low: float
    high: float


def wilson(successes: int, trials: int) -> tuple[float, float]:
    """Ends of the 95 % interval of a rate, in [0, 1]; (nan, nan) without trials."""
    if trials == 0:
        return math.nan, math.nan
    rate, shrink = successes / trials, 1.0 + Z**2 / trials
    centre = (rate + Z**2 / (2 * trials)) / shrink
    half = Z / shrink * math.sqrt(rate * (1 - rate) / trials + Z**2 / (4 * trials**2))
    low = 0.0 if successes == 0 else max(centre - half, 0.0)
    high = 1.0 if successes == trials else min(centre + half, 1.0)
    return low, high


def bootstrap(
    values: Array, resamples: int = RESAMPLES, seed: int = SEED, *, over: Array | None = None
) -> tuple[float, float]:
    """Ends of the 95 % percentile bootstrap interval of the mean of values (n,), or of their sum divided by
    that of `over` (n,); (nan, nan) if n < 2.
    """
    n = len(values)
    if n < 2:
        return math.nan, math.nan
    rng = np.random.default_rng(seed)
    rows = max(_CHUNK // n, 1)
    means = np.empty(resamples)
    for start in range(0, resamples, rows):
        draws = rng.integers(n, size=(min(rows, resamples - start), n))
        drawn = values[draws]
        found = drawn.mean(axis=1) if over is None else drawn.sum(axis=1) / over[draws].sum(axis=1)
        means[start : start + rows] = found
    low, high = np.quantile(means, [0.025, 0.975])
    return float(low), float(high)


def summarise_rate(happened: Flags) -> Summary:
    """Mean, spread and Wilson interval of happened (n,), in percent."""
    n, k = len(happened), int(np.count_nonzero(happened))
    if n == 0:
        return Summary(math.nan, math.nan, math.nan, math.nan)
    rate = k / n
    std = math.sqrt(rate * (1 - rate) * n / (n - 1)) if n > 1 else math.nan
    low, high = wilson(k, n)
    return Summary(100 * rate, 100 * std, 100 * low, 100 * high)


def summarise_mean(values: Array) -> Summary:
    """Mean, spread and bootstrap interval of values (n,); those that are nan count as not there."""
    values = values[~np.isnan(values)]
    if len(values) == 0:
        return Summary(math.nan, math.nan, math.nan, math.nan)
    std = float(values.std(ddof=1)) if len(values) > 1 else math.nan
    return Summary(float(values.mean()), std, *bootstrap(values))


def summarise_ratio(totals: Array, parts: Array) -> Summary:
    """sum(totals) / sum(parts), both (n,), with the spread of their ratios and the bootstrap interval over
    pairs; pairs of which one is nan count as not there. parts are positive.
    """
    known = ~(np.isnan(totals) | np.isnan(parts))
    totals, parts = totals[known], parts[known]
    if len(totals) == 0:
        return Summary(math.nan, math.nan, math.nan, math.nan)
    std = float((totals / parts).std(ddof=1)) if len(totals) > 1 else math.nan
    return Summary(float(totals.sum() / parts.sum()), std, *bootstrap(totals, over=parts))
