"""What trainings with several seeds say together.

Values stand in cells: one for each training seed s and scenario k, with what each episode of it gave. With
m_sk the mean of a cell, S seeds and K scenarios:

    mean = sum_sk m_sk / (S K)                          each training and each scenario counts the same
    std  = standard deviation (S - 1) of sum_k m_sk / K over seeds, as the paper prints
    IQM  = mean of the middle half of the m_sk: of sorted values x_1 ... x_n, each stands for [i - 1, i] of
           [0, n], and what lies in [n / 4, 3 n / 4] is averaged (Agarwal et al., NeurIPS 2021, who round
           n / 4 down; the same where 4 divides n)

Intervals, 95 %: the stratified percentile bootstrap of Agarwal et al. with one level more. Each of RESAMPLES
times seeds are drawn with replacement, then, for each seed drawn and in each scenario, its episodes. With one
seed only episodes are drawn, and the interval is about that training alone. Three seeds are few: such an
interval is too narrow rather than too wide. That of a rate is at least as wide as Wilson's of the same mean
of n episodes, since where nothing failed nothing else can be drawn:

    n = 1 / sum_i w_i^2 = C^2 / sum_c 1 / n_c    w_i the weight of episode i in the mean: 1 / (C n_c) in cell
                                                 c of C, which has n_c episodes (Kish's effective size)

which is the number of all episodes where cells are equal, else less. Where a scenario of many has very few
episodes, and nearly all failures, the interval is too narrow. Where all draws are the same, any other mean,
and any IQM, has no interval.

Pairs: two agents in the same episodes, `Paired`. Rates: change with Bonett and Price's interval and McNemar's
exact p; means: change with its bootstrap interval over pairs. Of several trainings the interval is at least
as wide as the one above of the changes, which draws trainings first; p takes all pairs for independent, so
that the interval counts where the two disagree. Nothing is corrected for how many are compared.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from rudc.arrays import Array
from rudc.errors import InputError
from rudc.evaluation.statistics import SEED, mcnemar, mean_interval, paired_change, row_of_numbers, wilson

RESAMPLES = 2_000
Cells = Mapping[tuple[int, str], Array]
"""(training seed, scenario) -> (n,) values of its episodes; nan counts as not there"""


class OverSeeds(NamedTuple):
    """A mean over trainings; nan where there are too few values to tell."""

    mean: float
    std: float
    """over training seeds"""
    low: float
    high: float
    """`low` and `high`: ends of the mean's 95 % interval"""
    iqm: float
    iqm_low: float
    iqm_high: float
    seeds: int
    episodes: int


class Paired(NamedTuple):
    """By how much an agent has more than another in the same episodes."""

    pairs: int
    change: float
    low: float
    high: float
    more: int
    """pairs in which only the agent has it, of a rate; 0 for means"""
    less: int
    """pairs in which only the other has it"""
    p: float
    """McNemar's, of a rate; nan for means"""


def over_seeds(
    cells: Cells, resamples: int = RESAMPLES, seed: int = SEED, *, rate: bool = False
) -> OverSeeds:
    """Everything above, of the cells that have values: of a `rate` 0 or 100."""
    known = {key: values[~np.isnan(values)] for key, values in cells.items()}
    known = {key: values for key, values in known.items() if len(values)}
    if not known:
        nothing = math.nan
        return OverSeeds(nothing, nothing, nothing, nothing, nothing, nothing, nothing, 0, 0)
    seeds = sorted({s for s, _ in known})
    scenarios = list(dict.fromkeys(k for _, k in known))
    means = np.array([[_mean(known.get((s, k))) for k in scenarios] for s in seeds])
    each = np.nanmean(means, axis=1)
    std = float(each.std(ddof=1)) if len(seeds) > 1 else math.nan
    episodes = sum(map(len, known.values()))
    draws = _draws(known, seeds, scenarios, resamples, seed)
    ends = [_ends(np.nanmean(draws, axis=1), episodes), _ends(interquartile_mean(draws), episodes)]
    if rate:
        ends[0] = at_least_wilsons(ends[0], list(known.values()))
    middle = float(interquartile_mean(means.reshape(1, -1))[0])
    return OverSeeds(float(np.nanmean(means)), std, *ends[0], middle, *ends[1], len(seeds), episodes)


def at_least_wilsons(ends: tuple[float, float], cells: Sequence[Array]) -> tuple[float, float]:
    """An interval of a rate, in percent, or Wilson's where that reaches farther. `cells`: (n,) each, not 0
    where an episode has it; each cell counts the same.
    """
    n = len(cells) ** 2 / sum(1 / len(values) for values in cells)
    happened = n * sum(np.count_nonzero(values) / len(values) for values in cells) / len(cells)
    n, happened = round(n, 9), round(happened, 9)  # whole numbers where cells are equal
    low, high = wilson(min(happened, n), n)
    return float(np.fmin(ends[0], 100 * low)), float(np.fmax(ends[1], 100 * high))


def interquartile_mean(values: Array) -> Array:
    """(m,) of each row of values (m, n), without those that are nan; nan for a row without any."""
    ordered = np.sort(values, axis=1)  # nan last
    n = np.isfinite(values).sum(axis=1, keepdims=True)
    rank = np.arange(values.shape[1])[None, :]
    inside = np.clip(np.minimum(rank + 1, 0.75 * n) - np.maximum(rank, 0.25 * n), 0.0, 1.0)
    total = inside.sum(axis=1)
    summed = np.where(inside > 0, inside * np.nan_to_num(ordered), 0.0).sum(axis=1)
    return np.divide(summed, total, out=np.full(len(values), math.nan), where=total > 0)


def paired(new: Cells, old: Cells, *, rate: bool = False) -> Paired:
    """By how much `new` has more than `old`, cells of the same episodes; those of a `rate` are 0 or 100."""
    one, other = (np.concatenate([of[key] for key in new]) for of in (new, old))
    pooled = paired_rate((one > 0).tolist(), (other > 0).tolist()) if rate else paired_mean(one, other)
    if len({seed for seed, _ in new}) < 2:
        return pooled
    over = over_seeds({key: values - old[key] for key, values in new.items()})
    low, high = float(np.fmin(pooled.low, over.low)), float(np.fmax(pooled.high, over.high))
    return pooled._replace(low=low, high=high)


def paired_rate(new: Sequence[bool], old: Sequence[bool]) -> Paired:
    """Percentage points by which `new` has it in more of the same episodes than `old`. Raises InputError
    unless both are True and False (or 1 and 0) in a row, as many of each.
    """
    one, other = (row_of_numbers(values, "paired_rate") for values in (new, old))
    _refuse_unpaired("paired_rate", len(one), len(other))
    for value in (*one, *other):
        if value not in (0.0, 1.0):
            raise InputError(f"paired_rate: {value:g} is neither True nor False")
    both = [(bool(a), bool(b)) for a, b in zip(one, other, strict=True)]
    more, less = both.count((True, False)), both.count((False, True))
    return Paired(len(both), *paired_change(len(both), more, less), more, less, mcnemar(more, less))


def paired_mean(new: ArrayLike, old: ArrayLike) -> Paired:
    """Mean of new - old, (n,) each in the same episodes; pairs of which one is nan count as not there. Raises
    InputError unless both are numbers in a row, none of them infinite, as many of each.
    """
    one, other = row_of_numbers(new, "paired_mean"), row_of_numbers(old, "paired_mean")
    if np.isinf(one).any() or np.isinf(other).any():
        raise InputError("paired_mean: a value is infinite; give finite numbers, or nan for those not there")
    _refuse_unpaired("paired_mean", len(one), len(other))
    change = one - other
    change = change[~np.isnan(change)]
    mean = float(change.mean()) if len(change) else math.nan
    return Paired(len(change), mean, *mean_interval(change), 0, 0, math.nan)


def _refuse_unpaired(what: str, new: int, old: int) -> None:
    if new != old:
        raise InputError(f"{what}: {new} values and {old}; pairs are of the same episodes, in one order")


def _mean(values: Array | None) -> float:
    return math.nan if values is None else float(values.mean())


def _draws(known: Cells, seeds: Sequence[int], scenarios: Sequence[str], resamples: int, seed: int) -> Array:
    """(resamples, S * K) means of cells drawn anew."""
    rng = np.random.default_rng(seed)
    chosen = rng.integers(len(seeds), size=(resamples, len(seeds)))
    found = np.full((resamples, len(seeds), len(scenarios)), math.nan)
    for i, s in enumerate(seeds):
        at = np.nonzero(chosen == i)
        for j, k in enumerate(scenarios):
            values = known.get((s, k))
            if values is not None:
                found[at[0], at[1], j] = _resampled(values, len(at[0]), rng)
    return found.reshape(resamples, -1)


def _resampled(values: Array, times: int, rng: np.random.Generator) -> Array:
    """(times,) means of as many values drawn with replacement; of rates by their binomial, which is the same
    distribution.
    """
    n, different = len(values), np.unique(values)
    if len(different) == 1:
        return np.full(times, different[0])
    if len(different) == 2:
        low, high = different
        share = rng.binomial(n, np.count_nonzero(values == high) / n, size=times) / n
        return low + (high - low) * share
    return values[rng.integers(n, size=(times, n))].mean(axis=1)


def _ends(draws: Array, episodes: int) -> tuple[float, float]:
    known = draws[~np.isnan(draws)]
    if episodes < 2 or not len(known):
        return math.nan, math.nan
    if known.min() == known.max():
        return math.nan, math.nan
    low, high = np.quantile(known, [0.025, 0.975])
    return round(float(low), 9), round(float(high), 9)
