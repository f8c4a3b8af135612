"""AUROC, and its 95 % interval when scores come in episodes.

    AUROC = P(s+ > s-) + P(s+ = s-) / 2       s+ a positive's score, s- a negative's, drawn at random
          = (R - n+ (n+ + 1) / 2) / (n+ n-)   R the sum of the positives' ranks, ties sharing theirs

Interval. Decisions of one episode resemble each other, so episodes are what is drawn with replacement, and
as many from each scenario as it has. An episode drawn w times counts w times; with groups g of equal score in
rising order and p_g, m_g the weights of positives and negatives in them,

    AUROC = sum_g p_g (m_1 + ... + m_(g-1) + m_g / 2) / (sum p  sum m)

The interval runs from the 2.5 to the 97.5 percentile of RESAMPLES such values.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.stats import rankdata

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]
Ints = NDArray[np.int64]

RESAMPLES = 1000
SEED = 20_250
"""of the bootstrap's draws"""


class Interval(NamedTuple):
    """A value and its 95 % interval; nan where it is not defined."""

    value: float
    low: float
    high: float


def auroc(scores: Floats, positive: Flags) -> float:
    """How well scores (n,) separate what is positive (n,) from what is not; nan if there is only one kind."""
    positives = int(np.count_nonzero(positive))
    negatives = len(scores) - positives
    if not positives or not negatives:
        return math.nan
    ranks = float(rankdata(scores)[positive].sum())
    return (ranks - positives * (positives + 1) / 2) / (positives * negatives)


def auroc_draws(
    scores: Floats,
    positive: Flags,
    episode: Ints,
    stratum: Ints,
    resamples: int = RESAMPLES,
    seed: int = SEED,
) -> Floats:
    """(resamples,) AUROC with episodes drawn anew; nan where a draw has only one kind.

    episode: (n,) index 0 to E - 1 of the episode that each decision belongs to; stratum: (E,) within what an
    episode is drawn (its scenario). The draws depend on `stratum` and `seed` only: agents that drove the same
    episodes are compared on the same draws.
    """
    rng = np.random.default_rng(seed)
    order = np.argsort(scores, kind="stable")
    ranked, flags, owner = scores[order], positive[order], episode[order]
    starts = np.flatnonzero(np.r_[True, ranked[1:] != ranked[:-1]]) if len(ranked) else np.zeros(0, int)
    members = [np.flatnonzero(stratum == value) for value in np.unique(stratum)]
    draws = np.full(resamples, math.nan)
    for k in range(resamples):
        times = np.zeros(len(stratum))
        for inside in members:
            times[inside] = np.bincount(rng.integers(len(inside), size=len(inside)), minlength=len(inside))
        weight = times[owner]
        up = np.add.reduceat(np.where(flags, weight, 0.0), starts)
        down = np.add.reduceat(np.where(flags, 0.0, weight), starts)
        pairs = up.sum() * down.sum()
        if pairs > 0:
            draws[k] = float(up @ (np.cumsum(down) - 0.5 * down) / pairs)
    return draws


def percentile_interval(value: float, draws: Floats) -> Interval:
    """The interval that draws give; none where fewer than nine in ten of them are defined."""
    known = draws[np.isfinite(draws)]
    if len(known) < 0.9 * len(draws):
        return Interval(value, math.nan, math.nan)
    low, high = np.quantile(known, [0.025, 0.975])
    return Interval(value, float(low), float(high))
