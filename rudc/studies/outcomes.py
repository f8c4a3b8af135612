"""Episodes of a comparison: which row of the tables drove them, and with which training seed."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from rudc.evaluation.columns import COLUMNS, Metric, happened
from rudc.evaluation.seeds import Cells, OverSeeds, Paired, over_seeds, paired

Episode = Mapping[str, str]
"""a row of `episodes.csv`"""
Key = tuple[int, str, str]
"""what two rows of the tables must share to be compared: training seed, scenario, seed of the episode"""
TRAINING_SEED = "training_seed"
"""column that tells trainings of one row apart"""


class Outcomes:
    """What each row's trainings did in each episode."""

    def __init__(self) -> None:
        self._done: dict[str, dict[Key, Episode]] = {}
        self._errors: dict[str, list[Key]] = {}

    def add(self, row: str, training_seed: int, episodes: Iterable[Episode]) -> None:
        """Take in what one training of a row drove."""
        done, errors = self._done.setdefault(row, {}), self._errors.setdefault(row, [])
        for episode in episodes:
            key = (training_seed, episode["scenario"], episode["seed"])
            if episode["error"]:
                errors.append(key)
            else:
                done[key] = episode

    def rows(self) -> tuple[str, ...]:
        """Names of the rows that drove."""
        return tuple(self._done)

    def errors(self, row: str, scenarios: Sequence[str]) -> int:
        """Episodes that could not be run."""
        return sum(scenario in scenarios for _, scenario, _ in self._errors.get(row, ()))

    def training_seeds(self, row: str) -> tuple[int, ...]:
        """Seeds of the trainings that drove, in order."""
        return tuple(sorted({seed for seed, _, _ in self._done.get(row, {})}))

    def over_seeds(self, row: str, metric: Metric, scenarios: Sequence[str]) -> OverSeeds:
        """A metric of a row in these scenarios."""
        done = self._done.get(row, {})
        values = {key: value(metric, done[key]) for key in done if key[1] in scenarios}
        return over_seeds(_cells(values, scenarios), rate=bool(metric.outcomes))

    def paired(self, row: str, than: str, metric: Metric, scenarios: Sequence[str]) -> Paired | None:
        """By how much a row has more of a metric than another, in the episodes that trainings of one seed
        drove for both; None if there are none.
        """
        ours, theirs = self._done.get(row, {}), self._done.get(than, {})
        keys = [key for key in ours if key in theirs and key[1] in scenarios]
        if not keys:
            return None
        new, old = (_cells({key: value(metric, m[key]) for key in keys}, scenarios) for m in (ours, theirs))
        return paired(new, old, rate=bool(metric.outcomes))

    def lead(self, row: str, than: Sequence[str], metric: Metric, scenarios: Sequence[str]) -> Cells:
        """By how much a row has more of a metric than the others have on average, in each episode that
        trainings of one seed drove for all.
        """
        ours, others = self._done.get(row, {}), [self._done.get(name, {}) for name in than]
        keys = [k for k in ours if k[1] in scenarios and all(k in other for other in others)]
        mean = {k: float(np.mean([value(metric, other[k]) for other in others])) for k in keys}
        return _cells({k: value(metric, ours[k]) - mean[k] for k in keys}, scenarios)

    def table(self) -> list[dict[str, str]]:
        """All finished episodes as rows of `episodes.csv`: `agent` is the row's name, and the last column
        tells trainings apart.
        """
        return [
            {**{name: episode[name] for name in COLUMNS}, "agent": row, TRAINING_SEED: str(key[0])}
            for row, episodes in self._done.items()
            for key, episode in episodes.items()
        ]


def value(metric: Metric, episode: Episode) -> float:
    """What one episode gives to a metric, 0 or 100 to a rate; nan where it is empty."""
    if metric.outcomes:
        return 100.0 * happened(metric.name, episode["outcome"])
    text = episode[metric.column]
    return metric.scale * float(text) if text else math.nan


def _cells(values: Mapping[Key, float], scenarios: Sequence[str]) -> Cells:
    """Values of episodes as cells, by training seed and in the scenarios' order."""
    found: dict[tuple[int, str], list[float]] = {}
    for (seed, scenario, _), number in values.items():
        found.setdefault((seed, scenario), []).append(number)
    order = {name: k for k, name in enumerate(scenarios)}
    cells = sorted(found.items(), key=lambda item: (item[0][0], order[item[0][1]]))
    return {key: np.array(numbers) for key, numbers in cells}
