"""Metrics of groups of episodes, with their intervals; which metrics there are says `columns.py`."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from rudc.arrays import Array, Flags, Index
from rudc.evaluation.columns import DECISION_MS, METRICS, Metric
from rudc.evaluation.rows import Columns, Row, SweepRows, as_numbers, by_column
from rudc.evaluation.statistics import Sample, Summary, summarise_all, summarise_rate

STATISTICS = Summary._fields
"""statistics of each metric in `metrics.csv`"""


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
    fewer: Mapping[str, int] = field(default_factory=dict)
    """name of a metric -> from how many of the episodes it is, where that is not all of them, but some"""


class Tally:
    """Takes in rows by column, a block at a time; of each it keeps only what the metrics of its group are
    made of, some 50 bytes for the paper's seven.
    """

    def __init__(self, by: Sequence[str], metrics: Sequence[Metric]) -> None:
        self._by, self._metrics = tuple(by), tuple(metrics)
        columns = [metric.column for metric in metrics if not metric.outcomes]
        if any(metric.average != "episodes" for metric in metrics):
            columns.append("steps")
        self._numbers = tuple(dict.fromkeys(columns))
        self._keys: dict[tuple[str, ...], int] = {}
        self._outcomes: dict[str, int] = {}
        self._parts: list[_Part] = []

    @property
    def needs(self) -> tuple[str, ...]:
        """The columns that it looks at."""
        return tuple(dict.fromkeys(("error", "outcome", *self._by, *self._numbers)))

    def add(self, columns: Columns) -> None:
        """Take in some rows."""
        errors, keys, outcomes = columns["error"], self._keys, self._outcomes
        own = zip(*(columns[name] for name in self._by), strict=True) if self._by else [()] * len(errors)
        group = np.fromiter((keys.setdefault(key, len(keys)) for key in own), np.int64, len(errors))
        ends = (outcomes.setdefault(outcome, len(outcomes)) for outcome in columns["outcome"])
        self._parts.append(
            _Part(
                group,
                np.fromiter(map(bool, errors), np.bool_, len(errors)),
                np.fromiter(ends, np.int64, len(errors)),
                {name: as_numbers(columns[name]) for name in self._numbers},
            )
        )

    def groups(self) -> list[Group]:
        """The metrics of what was taken in, groups in order of first appearance."""
        if not self._keys:
            return []
        parts = self._parts
        whole = _Part(
            np.concatenate([part.group for part in parts]),
            np.concatenate([part.failed for part in parts]),
            np.concatenate([part.outcome for part in parts]),
            {name: np.concatenate([part.numbers[name] for part in parts]) for name in self._numbers},
        )
        self._parts = [whole]
        order = np.argsort(whole.group, kind="stable")
        members = np.split(order, np.cumsum(np.bincount(whole.group, minlength=len(self._keys)))[:-1])
        done = [rows[~whole.failed[rows]] for rows in members]
        values = iter(self._measured(whole, done))
        return [
            Group(
                key,
                len(ran),
                len(rows) - len(ran),
                {metric.name: next(values) for metric in self._metrics},
                self._fewer(whole, ran),
            )
            for key, rows, ran in zip(self._keys, members, done, strict=True)
        ]

    def _measured(self, whole: _Part, groups: Sequence[Index]) -> list[Summary]:
        """Each metric of each group of episodes that ran; means all at once, since their intervals share
        draws.
        """
        wanted = [(metric, rows) for rows in groups for metric in self._metrics]
        means = (self._sample(metric, whole, rows) for metric, rows in wanted if not metric.outcomes)
        summaries = iter(summarise_all(list(means)))
        ends = {
            metric.name: np.array([outcome in metric.outcomes for outcome in self._outcomes], dtype=bool)
            for metric in self._metrics
        }
        return [
            summarise_rate(ends[metric.name][whole.outcome[rows]])
            if metric.outcomes
            else _possible(metric, next(summaries))
            for metric, rows in wanted
        ]

    def _fewer(self, whole: _Part, rows: Index) -> dict[str, int]:
        """Name of each mean that some of the episodes have no value for -> how many have one."""
        means = [metric for metric in self._metrics if not metric.outcomes]
        known = {m.name: int((~np.isnan(whole.numbers[m.column][rows])).sum()) for m in means}
        return {name: n for name, n in known.items() if 0 < n < len(rows)}

    def _sample(self, metric: Metric, whole: _Part, rows: Index) -> Sample:
        totals, parts = _weighted(metric, lambda name: whole.numbers[name][rows])
        return totals, None if metric.average == "episodes" else parts


def _possible(metric: Metric, value: Summary) -> Summary:
    """The summary, with its interval cut to what is possible: to 0 to 100 of a percentage, to 0 and more of a
    distance, a speed or a time."""
    if metric.unit not in ("%", "m", "m/s", "s", "ms") or math.isnan(value.low):
        return value
    return value._replace(
        low=max(value.low, 0.0), high=min(value.high, 100.0 if metric.unit == "%" else math.inf)
    )


class _Part(NamedTuple):
    """Some rows, (n,) each."""

    group: Index
    failed: Flags
    outcome: Index
    numbers: Mapping[str, Array]
    """column -> its values, of the columns that metrics are means of"""


def group_metrics(
    rows: Sequence[Row] | SweepRows, by: Sequence[str], metrics: Sequence[Metric] = (*METRICS, DECISION_MS)
) -> list[Group]:
    """The metrics of the rows grouped by columns, groups in order of first appearance. Rows: of `read_sweep`,
    or `pandas.read_csv(DIR / "episodes.csv").to_dict("records")`.
    """
    tally = Tally(by, metrics)
    for block in rows.blocks() if isinstance(rows, SweepRows) else [by_column(rows, tally.needs)]:
        tally.add(block)
    return tally.groups()


def in_order(groups: Sequence[Group]) -> list[Group]:
    """The groups by their columns in turn: a column of numbers by value, empty cells last; any other in order
    of first appearance.
    """
    ranks = [_ranks(column) for column in zip(*(group.key for group in groups), strict=True)]
    return sorted(groups, key=lambda g: [rank[cell] for rank, cell in zip(ranks, g.key, strict=True)])


def _ranks(cells: Sequence[str]) -> dict[str, float]:
    """Each cell of a column -> what it is sorted by."""
    try:
        return {cell: float(cell or "inf") for cell in cells}
    except ValueError:
        return {cell: place for place, cell in enumerate(dict.fromkeys(cells))}


def average(metric: Metric, rows: Sequence[Row]) -> float:
    """The mean alone of a metric that is no rate; nan where no episode has a number."""
    totals, parts = _weighted(metric, lambda name: numbers(rows, name))
    known = ~(np.isnan(totals) | np.isnan(parts))
    return float(totals[known].sum() / parts[known].sum()) if known.any() else math.nan


def _weighted(metric: Metric, numbers_of: Callable[[str], Array]) -> tuple[Array, Array]:
    """Two (n,): each episode's sum, and the number of things summed (1 for itself, or its decisions)."""
    values = metric.scale * numbers_of(metric.column)
    if metric.average == "episodes":
        return values, np.ones(len(values))
    steps = numbers_of("steps")
    return (values if metric.average == "share" else values * steps), steps


def numbers(rows: Sequence[Row], column: str) -> Array:
    """(n,) the column's numbers, nan where it is empty."""
    return as_numbers([row[column] for row in rows])
