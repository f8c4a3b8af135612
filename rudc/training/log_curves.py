"""Curves of a training, read from its folder.

training     episodes driven while learning (`progress.csv`), means over BIN decisions
evaluation   the held-out episodes (`evaluation.csv`), each scenario, and its arms apart
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from rudc.arrays import Array
from rudc.errors import InputError
from rudc.evaluation.columns import RATES
from rudc.evaluation.metrics import numbers
from rudc.training.log import EVALUATION, OUTCOMES, read_log

NEEDED = ("steps", "episodes", *OUTCOMES, "episode_reward")
"""columns of progress.csv; learners add others of their own"""
BIN = 5_000
"""decisions"""
RATE_COLUMNS = {rate: RATES[rate] for rate in ("SR", "VR", "FR")}
"""rate -> columns that it is the sum of"""

Key = tuple[str, str, str, str]
"""source, scenario, priority, metric"""


class Measured(NamedTuple):
    """What episodes of a training came to."""

    value: float
    """mean, percent or reward"""
    episodes: int


Series = dict[int, Measured]
"""decisions -> what was measured then"""


def read_training(folder: Path) -> dict[Key, Series]:
    """All curves of a training's folder. Raises InputError when its logs are not there, or damaged."""
    driven = _log(folder / "progress.csv", NEEDED)
    tested = _log(folder / "evaluation.csv", EVALUATION)
    curves: dict[Key, Series] = {}
    bins: dict[int, list[dict[str, str]]] = {}
    for row in driven:
        bins.setdefault(-(-int(row["steps"]) // BIN) * BIN, []).append(row)
    if bins and int(driven[-1]["steps"]) < max(bins):
        del bins[max(bins)]
    for step, rows in bins.items():
        for metric, value in _values(rows).items():
            curves.setdefault(("training", "", "all", metric), {})[step] = value
    for row in tested:
        for metric, value in _values([row]).items():
            key = ("evaluation", row["scenario"], row["priority"], metric)
            curves.setdefault(key, {})[int(row["steps"])] = value
    return curves


def _log(path: Path, columns: Sequence[str]) -> list[dict[str, str]]:
    if not path.is_file():
        raise InputError(f"no {path.name} in {path.parent}; is it the folder of a training?")
    rows = read_log(path)
    missing = [name for name in columns if rows and name not in rows[0]]
    if missing:
        raise InputError(f"{path} has no column {missing[0]!r}; is it the log of a training?")
    return rows


def _values(rows: Sequence[Mapping[str, str]]) -> dict[str, Measured]:
    """Rates in percent and the mean reward, over the episodes of all rows."""
    weight = numbers(rows, "episodes")
    found = {
        name: 100.0 * _mean(np.sum([numbers(rows, column) for column in columns], axis=0), weight)
        for name, columns in RATE_COLUMNS.items()
    }
    found["reward"] = _mean(numbers(rows, "episode_reward"), weight)
    return {name: Measured(value, round(float(np.nansum(weight)))) for name, value in found.items()}


def _mean(values: Array, weight: Array) -> float:
    known = np.isfinite(values) & (weight > 0)
    return float(np.average(values[known], weights=weight[known])) if known.any() else math.nan
