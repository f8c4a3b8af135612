"""Whether a sweep can be believed: a sample of its episodes run again, and compared with their rows.

They are run in another order, so that the rows of an agent that keeps something from one episode to the next
come out differently. Timing columns are left out. On the machine that made the rows, with the same versions,
they come out the same to the last digit; elsewhere a difference in rounding may grow, in a few episodes, into
another course of events.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from rudc.errors import SweepError
from rudc.evaluation.columns import COLUMNS
from rudc.evaluation.engine import RunnerFactory
from rudc.evaluation.limits import EPISODE_LIMIT_S
from rudc.evaluation.rerun import Difference, Rerun, Swept, differences
from rudc.evaluation.sweep import ENGINES, Progress, Silent, check_limit, prepared

SHARE = 0.05
"""share of a sweep's episodes that are run again by default"""


class Off(NamedTuple):
    """How far a column is from what its rows say."""

    column: str
    episodes: int
    """episodes that say something else there"""
    largest: float
    """largest difference, in the column's unit; nan for texts, and where a number is missing"""


@dataclass(frozen=True)
class Verification:
    """What came of running episodes again."""

    of: int
    """episodes of the sweep that can be run again: those without an error"""
    failed: int
    """episodes with an error, which are left out"""
    again: int
    """how many of these were run again"""
    other: Sequence[tuple[Rerun, Sequence[Difference]]]
    """those that came out differently"""
    changes: tuple[str, ...]
    """what differs here from where the sweep ran, by its manifest"""

    @property
    def unfinished(self) -> int:
        """How many of the episodes that were run again failed; in the sweep none of these had."""
        return sum(any(off.column == "error" for off in found) for _, found in self.other)

    @property
    def columns(self) -> list[Off]:
        """The columns that differ, in their order."""
        found: dict[str, list[Difference]] = {}
        for _, those in self.other:
            for difference in those:
                found.setdefault(difference.column, []).append(difference)
        return [
            Off(name, len(those), max((d.size for d in those if not math.isnan(d.size)), default=math.nan))
            for name in COLUMNS
            if (those := found.get(name))
        ]


def verify_sweep(
    folder: Path,
    make_runner: RunnerFactory,
    *,
    share: float = SHARE,
    seed: int = 0,
    workers: int = 1,
    limit_s: float = EPISODE_LIMIT_S,
    progress: Progress | None = None,
) -> Verification:
    """Run a share of a folder's episodes again, at least one, drawn by `seed`; nothing is written.

    Raises SweepError when it is no sweep's folder, or holds no episode that could be run.
    """
    if not 0.0 < share <= 1.0:
        raise SweepError(f"--share is more than 0 and at most 1, not {share:g}")
    check_limit(limit_s)
    sweep = Swept(folder)
    drawn = _sample(sweep.rows, share, seed, folder)
    reruns = {r.task.key(sweep.parameters): r for r in (sweep.episode(number) for number in drawn.numbers)}
    progress = progress or Silent()
    progress.begin(len(reruns), 0, ())
    tasks = [rerun.task for rerun in reruns.values()]
    order = np.random.default_rng(seed).permutation(len(tasks))
    tasks = [tasks[k] for k in (order if np.any(np.diff(order) < 0) else order[::-1])]
    make_runner = prepared(make_runner, {task.agent for task in tasks})
    other = []
    with closing(ENGINES["local"].run(tasks, workers, limit_s, make_runner)) as results:  # pyright: ignore
        for task, record in results:
            progress.advance(task, record)
            rerun = reruns[task.key(sweep.parameters)]
            if found := differences(rerun.row, record):
                other.append((rerun, found))
    changes = tuple(dict.fromkeys(change for rerun in reruns.values() for change in rerun.changes))
    failed = len(sweep.rows) - drawn.of
    return Verification(drawn.of, failed, len(reruns), sorted(other, key=lambda one: one[0].number), changes)


class _Drawn(NamedTuple):
    """The numbers of the rows that were drawn, and the number of rows that they were drawn from."""

    numbers: list[int]
    of: int


def _sample(rows: Sequence[Mapping[str, str]], share: float, seed: int, folder: Path) -> _Drawn:
    able = [number for number, row in enumerate(rows, 1) if not row["error"]]
    if not able:
        raise SweepError(f"{folder} has no finished episode that could be run again")
    count = max(1, math.ceil(round(share * len(able), 9)))  # 0.07 * 100 is a little more than 7
    chosen = np.random.default_rng(seed).choice(len(able), size=count, replace=False)
    return _Drawn(sorted(able[k] for k in chosen), len(able))
