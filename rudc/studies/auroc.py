"""AUROC, and its 95 % interval when scores come in episodes.

    AUROC = P(s+ > s-) + P(s+ = s-) / 2       s+ a positive's score, s- a negative's, drawn at random
          = (R - n+ (n+ + 1) / 2) / (n+ n-)   R the sum of the positives' ranks, ties sharing theirs

Interval. Decisions of one episode resemble each other, so whole episodes are drawn with replacement, from
each scenario as many as it has. An episode drawn w times counts w times; with groups g of equal score in
rising order and p_g, m_g the weights of positives and negatives in them,

    AUROC = sum_g p_g (m_1 + ... + m_(g-1) + m_g / 2) / (sum p  sum m)

More than BINS different scores are put into BINS groups of like size, which moves an AUROC by 1 / BINS or so
at most. The interval runs from the 2.5 to the 97.5 percentile of RESAMPLES such values.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from rudc.arrays import Array, Flags, Index

RESAMPLES = 1000
SEED = 20_250
"""seed of the bootstrap's draws"""
BINS = 1024
"""groups of scores at most"""


class Interval(NamedTuple):
    """A value and its 95 % interval; nan where it is not defined."""

    value: float
    low: float
    high: float


def auroc(scores: Array, positive: Flags) -> float:
    """How well scores (n,) separate what is positive (n,) from what is not; nan if there is only one kind."""
    positives = int(np.count_nonzero(positive))
    negatives = len(scores) - positives
    if not positives or not negatives:
        return math.nan
    from scipy.stats import rankdata  # loads slowly

    ranks = float(rankdata(scores)[positive].sum())
    return (ranks - positives * (positives + 1) / 2) / (positives * negatives)


def auroc_draws(
    scores: Array,
    positive: Flags,
    episode: Index,
    stratum: Index,
    resamples: int = RESAMPLES,
    seed: int = SEED,
) -> Array:
    """(resamples,) AUROC with episodes drawn anew; nan where a draw has only one kind.

    episode: (n,) index 0 to E - 1 of the episode that each decision belongs to; stratum: (E,) the group in
    which an episode is drawn (its scenario). The draws depend on `stratum` and `seed` only: agents that drove
    the same episodes are compared on the same draws.
    """
    times = _times_drawn(stratum, resamples, seed)
    bins = _bins(scores)
    up, down = (_counts(episode[flag], bins[flag], len(stratum), bins) for flag in (positive, ~positive))
    p, m = times @ up, times @ down
    wins = np.einsum("kg,kg->k", p, np.cumsum(m, axis=1) - 0.5 * m)
    pairs = p.sum(axis=1) * m.sum(axis=1)
    return np.divide(wins, pairs, out=np.full(resamples, math.nan), where=pairs > 0)


def _times_drawn(stratum: Index, resamples: int, seed: int) -> Array:
    """(resamples, E) how often each episode is drawn."""
    rng = np.random.default_rng(seed)
    times = np.zeros((resamples, len(stratum)))
    for value in np.unique(stratum):
        inside = np.flatnonzero(stratum == value)
        size = len(inside)
        drawn = rng.integers(size, size=(resamples, size)) + size * np.arange(resamples)[:, None]
        times[:, inside] = np.bincount(drawn.ravel(), minlength=resamples * size).reshape(resamples, size)
    return times


def _bins(scores: Array) -> Index:
    """(n,) rising with the score: one for each different score, or BINS with like numbers of decisions if
    there are more; equal scores always share one.
    """
    different, bins = np.unique(scores, return_inverse=True)
    if len(different) <= BINS:
        return bins
    from scipy.stats import rankdata

    first = rankdata(scores, method="min").astype(np.int64) - 1
    return first * BINS // len(scores)


def _counts(episode: Index, bins: Index, episodes: int, all_bins: Index) -> Array:
    """(E, bins) how many decisions of each episode are in each bin."""
    width = int(all_bins.max(initial=0)) + 1
    return (
        np.bincount(episode * width + bins, minlength=episodes * width).reshape(episodes, width).astype(float)
    )


def percentile_interval(value: float, draws: Array) -> Interval:
    """The interval that draws give; none where fewer than nine in ten of them are defined."""
    known = draws[np.isfinite(draws)]
    if len(known) < 0.9 * len(draws):
        return Interval(value, math.nan, math.nan)
    low, high = np.quantile(known, [0.025, 0.975])
    return Interval(value, float(low), float(high))
