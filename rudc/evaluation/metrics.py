"""The paper's seven metrics (Tab. "Evaluation Metrics") of groups of episodes.

    SR       %    episodes that reached the destination
    FR       %    episodes that ran into the time limit
    RC       %    route completion: way driven along the reference path / way to the destination
    AES      m/s  average speed of the ego
    AER      -    sum of the rewards of an episode
    VR       %    episodes that ended in a collision, off the road or on the wrong side of it
    min_DTC  m    smallest gap to anything during an episode

Every episode ends in exactly one way: SR + FR + VR = 100 %. Episodes that could not be run (`error`) are
counted beside and enter no metric.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from rudc.arrays import Array
from rudc.evaluation.statistics import Summary, summarise_mean, summarise_rate

Row = Mapping[str, str]
"""A row of `episodes.csv`: column name -> text"""


class Metric(NamedTuple):
    """How a metric is called, measured and judged."""

    name: str
    unit: str
    """empty for a plain number"""
    higher_is_better: bool
    column: str
    """of `episodes.csv` that it is the mean of; empty for a rate"""
    scale: float = 1.0


METRICS: tuple[Metric, ...] = (
    Metric("SR", "%", True, ""),
    Metric("FR", "%", False, ""),
    Metric("RC", "%", True, "route_completion", 100.0),
    Metric("AES", "m/s", True, "mean_speed_mps"),
    Metric("AER", "", True, "episode_reward"),
    Metric("VR", "%", False, ""),
    Metric("min_DTC", "m", True, "min_dtc_m"),
)
STATISTICS = Summary._fields
METRIC_COLUMNS: tuple[str, ...] = tuple(f"{m.name}_{s}" for m in METRICS for s in STATISTICS)


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
    decision_ms: float
    """ms, mean over episodes of the mean time for a decision"""

    def row(self) -> list[object]:
        """Cells of `metrics.csv` after the key."""
        cells = [value for metric in METRICS for value in self.metrics[metric.name]]
        return [self.episodes, self.errors, *cells]


def group_metrics(rows: Iterable[Row], by: Sequence[str]) -> list[Group]:
    """The metrics of the rows grouped by columns, groups in order of first appearance."""
    groups: dict[tuple[str, ...], list[Row]] = {}
    for row in rows:
        groups.setdefault(tuple(row[column] for column in by), []).append(row)
    return [_measure(key, members) for key, members in groups.items()]


def _measure(key: tuple[str, ...], rows: list[Row]) -> Group:
    done = [row for row in rows if not row["error"]]
    happened = {
        "SR": [row["outcome"] == "success" for row in done],
        "FR": [row["outcome"] == "frozen" for row in done],
        "VR": [bool(row["violation"]) for row in done],
    }
    metrics = {}
    for metric in METRICS:
        if metric.column:
            metrics[metric.name] = summarise_mean(metric.scale * numbers(done, metric.column))
        else:
            metrics[metric.name] = summarise_rate(np.array(happened[metric.name], dtype=bool))
    times = numbers(done, "decision_ms_mean")
    mean_ms = float(np.nanmean(times)) if np.isfinite(times).any() else math.nan
    return Group(key, len(done), len(rows) - len(done), metrics, mean_ms)


def numbers(rows: Sequence[Row], column: str) -> Array:
    """(n,) the column's numbers, nan where it is empty."""
    return np.array([float(row[column]) if row[column] else math.nan for row in rows], dtype=float)
