"""Differences between two agents in the same episodes: same scenario, swept values and seed.

Rates: percentage points, Bonett and Price's interval, McNemar's exact p. Means: Student's interval of the
episodes' differences. Intervals hold 95 %; nothing is corrected for how many differences are looked at.
"""

from __future__ import annotations

import math
from itertools import combinations
from typing import Any

import numpy as np

from rudc.arrays import Array, Index
from rudc.evaluation.columns import METRICS, Metric
from rudc.evaluation.statistics import mcnemar, paired_change, student
from rudc.reporting.report.episodes import Episodes

MOST = 12_000
"""comparisons listed at most; beyond, only those over all scenarios"""


def differences(episodes: Episodes) -> dict[str, Any]:
    """`metrics`: their names; `pairs`: for each two agents `a` < `b` lines [place, values], `place` the
    index of a scenario or -1 for all, values for each metric: [pairs, a, b, b - a, low, high], and for rates
    in how many episodes only b has it, in how many only a, and p. `pairs`: episodes where both are known.
    """
    places, values = _aligned(episodes)
    chosen = list(combinations(range(len(episodes.agents)), 2))
    scenarios = range(len(episodes.scenarios)) if len(episodes.scenarios) > 1 else range(0)
    if len(chosen) * (len(scenarios) + 1) > MOST:
        scenarios = range(0)
    found = []
    for a, b in chosen:
        both = np.flatnonzero(~np.isnan(values[0, a]) & ~np.isnan(values[0, b]))
        where = [(-1, both), *((k, both[places[both] == k]) for k in scenarios)]
        lines = [
            [k, [_difference(m, values[i, a, at], values[i, b, at]) for i, m in enumerate(METRICS)]]
            for k, at in where
            if len(at)
        ]
        if lines:
            found.append({"a": a, "b": b, "lines": lines})
    return {"metrics": [metric.name for metric in METRICS], "pairs": found, "by_scenario": bool(scenarios)}


def _aligned(episodes: Episodes) -> tuple[Index, Array]:
    """Scenario of each episode (k,), and metrics x agents x k: what each agent did in it, nan where that is
    not known.
    """
    keys: dict[tuple[str, ...], int] = {}
    names = ("scenario", "seed", *episodes.parameters)
    at = np.array(
        [keys.setdefault(tuple(row[n] for n in names), len(keys)) for row in episodes.rows], dtype=int
    )
    places = np.zeros(len(keys), dtype=int)
    places[at] = episodes.scenario
    values = np.full((len(METRICS), len(episodes.agents), len(keys)), math.nan)
    for i, metric in enumerate(METRICS):
        if metric.outcomes:
            found = episodes.is_one_of("outcome", metric.outcomes).astype(float)
        else:
            found = metric.scale * episodes.number(metric.column)
        values[i, episodes.agent[episodes.done], at[episodes.done]] = found[episodes.done]
    return places, values


def _difference(metric: Metric, a: Array, b: Array) -> list[float | None]:
    if metric.outcomes:
        more, less = int((b > a).sum()), int((a > b).sum())
        change = paired_change(len(a), more, less)
        ends = (100.0 * float(a.mean()), 100.0 * float(b.mean()), *change)
        return [len(a), *(_rounded(v) for v in ends), more, less, float(f"{mcnemar(more, less):.3g}")]
    known = ~(np.isnan(a) | np.isnan(b))
    a, b = a[known], b[known]
    if not len(a):
        return [0, *[None] * 5]
    ends = (a.mean(), b.mean(), (b - a).mean(), *student(b - a))
    return [len(a), *(_rounded(float(v)) for v in ends)]


def _rounded(value: float) -> float | None:
    return None if math.isnan(value) else round(value, 3)
