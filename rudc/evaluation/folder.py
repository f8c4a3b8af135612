"""A sweep's folder: manifest, rows, metrics; and what is finished when a sweep is resumed.

    manifest.json    what the rows were made from
    episodes.csv     one row an episode
    conditions.csv   one row an episode: arm, turn, priority, density, redraws
    metrics.csv      one row for each scenario, agent and swept value, when all episodes are there

An episode is finished when both files have its row and that row has no error: episodes that failed are run
again.
"""

from __future__ import annotations

import contextlib
import json
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rudc.errors import SweepError
from rudc.evaluation.manifest import as_json, manifest, resumed, version_changes
from rudc.evaluation.metrics import METRIC_COLUMNS, Group, group_metrics
from rudc.evaluation.record import COLUMNS, CONDITIONS, EpisodeRecord, as_text
from rudc.evaluation.store import RowFile, format_row, read_table
from rudc.evaluation.tasks import Key, SweepPlan, Task
from rudc.files import make_folder, write_atomically

_ERROR = COLUMNS.index("error")


class SweepFolder:
    """Where one sweep keeps its results. A context: while it is open no other sweep may write there."""

    def __init__(self, path: Path, plan: SweepPlan) -> None:
        self.path = path
        self.parameters = plan.parameters
        self.tasks = plan.tasks()
        self._plan = plan
        self._episodes = RowFile(path / "episodes.csv", [*COLUMNS, *plan.parameters])
        names = ["scenario", "agent", "seed", *plan.parameters, *CONDITIONS]
        self._conditions = RowFile(path / "conditions.csv", names)
        self._lock: int | None = None
        self.finished: set[Key] = set()
        """keys of the episodes that need not be run"""
        self.warnings: list[str] = []
        """what the user should know about what was found there"""

    def __enter__(self) -> SweepFolder:
        return self

    def __exit__(self, *_: object) -> None:
        self._episodes.close()
        self._conditions.close()
        if self._lock is not None:
            os.close(self._lock)
            self._lock = None

    def open(self, resume: bool) -> None:
        """Take possession of the folder. Raises InputError when it cannot be had, SweepError when something
        else is in it."""
        make_folder(self.path)
        self._take_lock()
        present = sorted(entry.name for entry in self.path.iterdir() if not entry.name.startswith("."))
        content: dict[str, Any] = manifest(self._plan)
        if present and not resume:
            raise SweepError(
                f"{self.path} is not empty ({', '.join(present[:4])}); "
                "add --resume to finish the sweep in it, or give another --out"
            )
        if present:
            content = resumed(self._manifest(), content, self.path)
            changes = version_changes(content)
            if changes:
                self.warnings.append(f"rows in {self.path} come from several versions: {', '.join(changes)}")
        write_atomically(self.path / "manifest.json", as_json(content))
        self._keep_finished()

    def add(self, task: Task, record: EpisodeRecord) -> None:
        """Append an episode. Raises StorageError."""
        key = task.key(self.parameters)
        self._conditions.append([*key, *record.conditions_row()])
        self._episodes.append([*key[:3], *record.row()[3:], *key[3:]])

    def complete(self) -> list[dict[str, str]]:
        """Sort the files into the canonical order, write the metrics, and return the episodes' rows."""
        order = {task.key(self.parameters): i for i, task in enumerate(self.tasks)}
        rows = sorted(self._episodes.read(), key=lambda row: order[self._key(row)])
        width = 3 + len(self.parameters)
        conditions = sorted(self._conditions.read(), key=lambda row: order[tuple(row[:width])])
        self._conditions.rewrite(conditions)
        self._episodes.rewrite(rows)
        table = [dict(zip(self._episodes.header, row, strict=True)) for row in rows]
        by = ("scenario", "agent", *self.parameters)
        write_atomically(self.path / "metrics.csv", metrics_csv(group_metrics(table, by), by))
        return table

    def _take_lock(self) -> None:
        """Keep other sweeps out of the folder for as long as this process lives, where the system can."""
        try:
            import fcntl
        except ImportError:  # no such locks on Windows
            return
        self._lock = os.open(self.path, os.O_RDONLY)
        try:
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise SweepError(f"another sweep is writing to {self.path} at this moment") from None
        except OSError:
            self.warnings.append(f"{self.path} cannot be locked; run no second sweep into it meanwhile")

    def _manifest(self) -> dict[str, Any]:
        path = self.path / "manifest.json"
        try:
            return json.loads(path.read_text(encoding="utf-8"))
        except FileNotFoundError:
            raise SweepError(
                f"{self.path} is not empty and not the folder of a sweep; give another --out"
            ) from None
        except (OSError, ValueError) as error:
            raise SweepError(f"{path} cannot be read ({error}); give another --out") from None

    def _key(self, row: Sequence[str]) -> Key:
        return (*row[:3], *row[len(COLUMNS) :])

    def _keep_finished(self) -> None:
        """Keep the rows of finished episodes, once each, and drop what a kill or an error left."""
        wanted = {task.key(self.parameters) for task in self.tasks}
        width = 3 + len(self.parameters)
        conditions = {tuple(row[:width]): row for row in self._conditions.read()}
        episodes = {}
        for row in self._episodes.read():
            key = self._key(row)
            if key in wanted and key in conditions and not row[_ERROR]:
                episodes.setdefault(key, row)
        self.finished = set(episodes)
        self._conditions.rewrite([conditions[key] for key in episodes])
        self._episodes.rewrite(episodes.values())
        with contextlib.suppress(FileNotFoundError):
            (self.path / "metrics.csv").unlink()


def metrics_csv(groups: Sequence[Group], by: Sequence[str]) -> str:
    """The text of `metrics.csv`: the columns grouped by, episodes, errors, and each metric's statistics."""
    lines = [[*by, "episodes", "errors", *METRIC_COLUMNS]]
    lines += [[*group.key, *map(as_text, group.row())] for group in groups]
    return "".join(map(format_row, lines))


def read_sweep(path: Path) -> tuple[list[dict[str, str]], tuple[str, ...]]:
    """All rows of a sweep's folder, conditions joined on, and the names of its swept parameters."""
    rows = read_table(path / "episodes.csv")
    missing = [name for name in COLUMNS if rows and name not in rows[0]]
    if missing:
        raise SweepError(f"{path / 'episodes.csv'} has no column {missing[0]!r}; is it the file of a sweep?")
    parameters = tuple(name for name in rows[0] if name not in COLUMNS) if rows else ()
    if (path / "conditions.csv").is_file():
        names = ("scenario", "agent", "seed", *parameters)
        known = {tuple(row[n] for n in names): row for row in read_table(path / "conditions.csv")}
        nothing = dict.fromkeys(CONDITIONS, "")
        rows = [{**(known.get(tuple(row[n] for n in names)) or nothing), **row} for row in rows]
    return rows, parameters
