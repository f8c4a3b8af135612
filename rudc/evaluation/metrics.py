"""Metrics of groups of episodes, with their intervals; which metrics there are says `columns.py`."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from rudc.arrays import Array
from rudc.evaluation.columns import DECISION_MS, METRICS, Metric
from rudc.evaluation.statistics import Summary, summarise_all, summarise_rate

Row = Mapping[str, str]
"""A row of `episodes.csv`: column name -> text"""

STATISTICS = Summary._fields
"""of each metric, in `metrics.csv`"""


@dataclass(frozen=True)
class Group:
    """The metrics of one group of episodes."""

    key: tuple[str, ...]
    """what the group has in common: values of the columns grouped by"""
    episodes: int
    """episodes that ran to an end"""
    errors: int
    """episodes that could not be run"""
    metrics: Mapping[str, Summary]
    """name -> value"""


def group_metrics(
    rows: Iterable[Row], by: Sequence[str], metrics: Sequence[Metric] = (*METRICS, DECISION_MS)
) -> list[Group]:
    """The metrics of the rows grouped by columns, groups in order of first appearance."""
    groups: dict[tuple[str, ...], list[Row]] = {}
    for row in rows:
        groups.setdefault(tuple(row[column] for column in by), []).append(row)
    done = [[row for row in members if not row["error"]] for members in groups.values()]
    values = iter(_measured([(metric, rows) for rows in done for metric in metrics]))
    return [
        Group(key, len(rows), len(members) - len(rows), {metric.name: next(values) for metric in metrics})
        for (key, members), rows in zip(groups.items(), done, strict=True)
    ]


def measure(metric: Metric, rows: Sequence[Row]) -> Summary:
    """A metric of episodes that ran to an end."""
    return _measured([(metric, rows)])[0]


def _measured(wanted: Sequence[tuple[Metric, Sequence[Row]]]) -> list[Summary]:
    """Each metric of its rows; means all at once, since their intervals share draws."""
    means = [
        (totals, None if metric.average == "episodes" else parts)
        for metric, rows in wanted
        if not metric.outcomes
        for totals, parts in [_parts(metric, rows)]
    ]
    summaries = iter(summarise_all(means))
    return [
        summarise_rate(np.array([row["outcome"] in metric.outcomes for row in rows], dtype=bool))
        if metric.outcomes
        else next(summaries)
        for metric, rows in wanted
    ]


def average(metric: Metric, rows: Sequence[Row]) -> float:
    """The mean alone of a metric that is no rate; nan where no episode has a number."""
    totals, parts = _parts(metric, rows)
    known = ~(np.isnan(totals) | np.isnan(parts))
    return float(totals[known].sum() / parts[known].sum()) if known.any() else math.nan


def _parts(metric: Metric, rows: Sequence[Row]) -> tuple[Array, Array]:
    """Two (n,): each episode's sum, and over how many things it goes (itself, or its decisions)."""
    values = metric.scale * numbers(rows, metric.column)
    if metric.average == "episodes":
        return values, np.ones(len(values))
    steps = numbers(rows, "steps")
    return (values if metric.average == "share" else values * steps), steps


def numbers(rows: Sequence[Row], column: str) -> Array:
    """(n,) the column's numbers, nan where it is empty."""
    return np.array([float(row[column]) if row[column] else math.nan for row in rows], dtype=float)
