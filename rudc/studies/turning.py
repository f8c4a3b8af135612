"""From what uncertainty on a filter corrects: the turning point (paper, Fig. "ablution_case" b).

Decisions are sorted by sigma into bins of equal number. Each bin has the correction's median and 90th
percentile, with 95 % percentile intervals over episodes drawn with replacement, since decisions of one
episode resemble each other.

    turning point   the median sigma of the first bin from which on LASTING bins in a row have the lower end
                    of the interval above LEAST; none if there is no such bin

The paper says "where the median curve significantly exceeds zero"; this is what significantly means here.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from rudc.arrays import Array, Index

BINS = 20
FEWEST = 25
"""decisions in a bin; with fewer there are fewer bins"""
LEAST = 0.01
"""share of half an action's range; a correction counts if it is larger"""
LASTING = 2
"""bins in a row"""
RESAMPLES = 200


class Bin(NamedTuple):
    """Decisions of about one sigma."""

    sigma: float
    """median, reward units"""
    decisions: int
    corrected: float
    """percent of them that are corrected by more than LEAST"""
    median: float
    median_low: float
    median_high: float
    p90: float
    p90_low: float
    p90_high: float


def bins(sigma: Array, correction: Array, episode: Index, seed: int = 0) -> list[Bin]:
    """Bins of decisions (n,), from the smallest sigma to the largest."""
    count = min(BINS, len(sigma) // FEWEST)
    if count < 1:
        return []
    parts = np.array_split(np.argsort(sigma, kind="stable"), count)
    draws = _weights(episode, seed)
    found = []
    for part in parts:
        ends = [
            (
                float(np.quantile(correction[part], q)),
                *_interval(correction[part], draws[:, episode[part]], q),
            )
            for q in (0.5, 0.9)
        ]
        share = 100.0 * float((correction[part] > LEAST).mean())
        found.append(Bin(float(np.median(sigma[part])), len(part), share, *ends[0], *ends[1]))
    return found


def turning_point(found: Sequence[Bin], of: str = "median") -> float:
    """sigma at the turning point of `median` or `p90`; nan if there is none."""
    above = [getattr(b, f"{of}_low") > LEAST for b in found]
    for k in range(len(found) - LASTING + 1):
        if all(above[k : k + LASTING]):
            return found[k].sigma
    return math.nan


def _weights(episode: Index, seed: int) -> Index:
    """(RESAMPLES, episodes) how often each episode is drawn."""
    number = int(episode.max()) + 1
    return np.random.default_rng(seed).multinomial(number, np.full(number, 1.0 / number), RESAMPLES)


def _interval(values: Array, weights: Index, q: float) -> tuple[float, float]:
    """Ends of the interval of a quantile of values (n,), drawn weights (RESAMPLES, n) times."""
    order = np.argsort(values, kind="stable")
    total = np.cumsum(weights[:, order], axis=1)
    drawn = total[:, -1] > 0
    at = (total >= q * total[:, -1:]).argmax(axis=1)[drawn]
    low, high = np.quantile(values[order][at], [0.025, 0.975])
    return float(low), float(high)
