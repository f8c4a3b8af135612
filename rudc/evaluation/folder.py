"""A sweep's folder: manifest, rows, metrics; and what is finished when a sweep is resumed.

    manifest.json    what the rows were made from
    episodes.csv     one row an episode, its conditions included; columns as in `columns.py`
    networks/        copies of road networks that do not come with RUDC; the episodes run on these
    errors/          a traceback for each episode that went wrong, named in its row
    metrics.csv      one row for each scenario, agent and swept value, when all episodes are there

An episode is finished when it has a row without an error: episodes that failed are run again. Folders that an
earlier version wrote are read (`read_sweep`), and not resumed: their rows would mix with others.
"""

from __future__ import annotations

import contextlib
import os
import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property, partial
from pathlib import Path
from typing import Any

from rudc.errors import SimulationError, SweepError
from rudc.evaluation.columns import COLUMNS, IDENTITY, METRICS, Metric, missing_columns
from rudc.evaluation.manifest import (
    FORMAT,
    agent_algorithms,
    agent_digests,
    agent_reads,
    as_json,
    gone_on_with,
    grown,
    manifest,
    read_manifest,
    resumed,
    version_changes,
)
from rudc.evaluation.metrics import STATISTICS, Group, group_metrics
from rudc.evaluation.own_networks import keep_networks, with_copies
from rudc.evaluation.record import EpisodeRecord, as_text
from rudc.evaluation.rows import Columns, SweepRows, by_row, undamaged
from rudc.evaluation.store import Cells, RowFile, format_row, one_line, read_header, table_blocks
from rudc.evaluation.tasks import Key, SweepPlan, Task
from rudc.files import make_folder, take_lock, write_atomically

_ERROR = list(COLUMNS).index("error")
_RENAMED = {"interventions": "engaged_steps"}
"""old name -> present one, in files that have no column of the present name"""
_DROPPED = ("violation",)
"""columns of old files that repeat what other columns say"""
TRACEBACK = "; traceback in "
"""stands in a row's error before the name of the file"""


class SweepFolder:
    """Where one sweep keeps its results. A context: while it is open no other sweep may write there."""

    def __init__(self, path: Path, plan: SweepPlan) -> None:
        self.path = path
        self.parameters = plan.parameters
        self.tasks = plan.tasks()
        self._plan = plan
        self._episodes = RowFile(path / "episodes.csv", [*COLUMNS, *plan.parameters])
        self._there = RowFile(self._episodes.path, self._episodes.header)
        """the file as the folder has it when it is opened"""
        self._lock: int | None = None
        self.finished: set[Key] = set()
        """keys of the episodes that need not be run"""
        self.warnings: list[str] = []
        """what the user should know about what was found there"""

    def __enter__(self) -> SweepFolder:
        return self

    def __exit__(self, *_: object) -> None:
        self._episodes.close()
        if self._lock is not None:
            os.close(self._lock)
            self._lock = None

    def open(self, resume: bool) -> None:
        """Lock the folder for this sweep. Raises InputError when it is in use or cannot be made, SweepError
        when something else is in it."""
        new = manifest(self._plan)  # refuses unknown agents, before there is a folder
        make_folder(self.path)
        self._lock = take_lock(self.path, self.warnings)
        content = settled(self.path, new, resume, "finish the sweep", partial(self._grown, new))
        self._take_order_of_columns()
        copies = keep_networks(self._plan, self.path)
        digests = agent_digests(content)
        own = {
            id(s): with_copies(s, copies) for s in {id(t.scenario): t.scenario for t in self.tasks}.values()
        }
        self.tasks = [
            replace(
                task,
                scenario=own[id(task.scenario)],
                agent_digest=digests[task.agent],
                agent_reads=agent_reads(content, task.agent),
            )
            for task in self.tasks
        ]
        kept = self._kept_rows()
        if resume:  # before the rows, so that it names their columns after any kill
            write_atomically(self.path / "manifest.json", as_json(content))
        self._drop_all_but(kept)
        left = len(self.finished) < len(self.tasks)
        content = with_versions(self.path, content, new["versions"] if left else None, self.warnings)
        write_atomically(self.path / "manifest.json", as_json(content))

    def add(self, task: Task, record: EpisodeRecord) -> EpisodeRecord:
        """Append an episode, and return it as its row says; a traceback goes to a file that the row names.
        Raises StorageError.
        """
        key = task.key(self.parameters)
        if record.traceback:
            record = self._keep_traceback(task, record)
        n = len(IDENTITY)
        self._episodes.append([*key[:n], *record.row()[n:], *key[n:]])
        return record

    @cached_property
    def _numbers(self) -> dict[int, int]:
        """id of a task -> its place in the canonical order, from 1 on."""
        return {id(task): number for number, task in enumerate(self.tasks, 1)}

    def _keep_traceback(self, task: Task, record: EpisodeRecord) -> EpisodeRecord:
        name = f"{self._numbers[id(task)]:0{len(str(len(self.tasks)))}}"
        return keep_traceback(self.path, name, record, about=f"{task}\n")

    def complete(self) -> None:
        """Sort the rows into the canonical order, and write the metrics. Raises SimulationError where a row
        is missing.
        """
        order = {task.key(self.parameters): i for i, task in enumerate(self.tasks)}
        lines = [""] * len(order)
        for row in self._episodes.rows():
            lines[order[self._key(row)]] = format_row(row)
        if lost := [task for task, line in zip(self.tasks, lines, strict=True) if not line]:
            raise SimulationError(
                f"the engine ended without {len(lost)} of {len(lines)} episodes, the first: {lost[0]}; "
                "what is finished is kept, and --resume runs the others"
            )
        self._episodes.rewrite(lines)
        by = ("scenario", "agent", *self.parameters)
        groups = group_metrics(sweep_rows(self.path), by, METRICS)
        write_atomically(self.path / "metrics.csv", metrics_csv(groups, by))

    def _grown(self, new: Mapping[str, Any], old: Mapping[str, Any]) -> dict[str, Any]:
        """The manifest that is there, with the scenarios and agents that the new one has besides. Raises
        SweepError when the folder's rows mean something else than new ones would.
        """
        header = read_header(self.path / "episodes.csv")
        lacking = missing_columns(header) if header else []
        more = [name for name in header[: len(COLUMNS)] if name not in COLUMNS]
        if old.get("format") == FORMAT and not lacking and not more:
            return grown(old, new)
        difference = f", without {', '.join(lacking)}" if lacking else ""
        difference += f", with {', '.join(more)}" if more else ""
        raise SweepError(
            f"{self.path} was written by another version of RUDC{difference}: its rows and new ones would "
            f"mix. `rudc table {self.path}` reads it; to run the sweep again, give another --out"
        )

    def _take_order_of_columns(self) -> None:
        """Keep swept values in the order in which the rows that are there have them; `--set` may name the
        same keys in another. Those that only new scenarios sweep come last.
        """
        header, n = read_header(self._episodes.path), len(COLUMNS)
        if header[:n] == list(COLUMNS) and set(header[n:]) <= set(self.parameters):
            self.parameters = (*header[n:], *(key for key in self.parameters if key not in header[n:]))
            self._episodes.header = [*COLUMNS, *self.parameters]
            self._there.header = header

    def _key(self, row: Sequence[str]) -> Key:
        return (*row[: len(IDENTITY)], *row[len(COLUMNS) :])

    def _kept_rows(self) -> list[str]:
        """The rows of finished episodes, with an empty cell for each key that only new scenarios sweep."""
        wanted = {task.key(self.parameters) for task in self.tasks}
        header, kept = self._there.header, []
        added = ("",) * (len(self._episodes.header) - len(header))
        blocks = (dict(zip(header, cells, strict=True)) for cells in self._there.blocks())
        for block in undamaged(blocks, header[len(COLUMNS) :], self._episodes.path):
            for row in zip(*block.values(), strict=True):
                key = self._key((*row, *added))
                if key in wanted and not row[_ERROR]:
                    self.finished.add(key)
                    kept.append(format_row((*row, *added)))
        return kept

    def _drop_all_but(self, kept: list[str]) -> None:
        """Drop what a kill or an error left."""
        self._episodes.rewrite(kept)
        with contextlib.suppress(FileNotFoundError):
            (self.path / "metrics.csv").unlink()
        shutil.rmtree(self.path / "errors", ignore_errors=True)


def settled(
    path: Path,
    content: dict[str, Any],
    resume: bool,
    to_go_on: str,
    accepted: Callable[[Mapping[str, Any]], Mapping[str, Any]],
) -> dict[str, Any]:
    """What the manifest of a folder will hold, before `with_versions`: `content` for a new folder; for one
    that is resumed, what follows from its manifest, as `accepted` gives it, and `content`
    (`manifest.resumed`). A new folder gets its manifest at once, before all else, so that --resume works
    after any kill.

    Raises SweepError when the folder is not empty and not to be resumed, and whatever `accepted` raises for
    the manifest that is there. `to_go_on` says what --resume would do.
    """
    present = sorted(entry.name for entry in path.iterdir() if not entry.name.startswith("."))
    if present and not resume:
        raise SweepError(
            f"{path} is not empty ({', '.join(present[:4])}); "
            f"add --resume to {to_go_on} in it, or give another --out"
        )
    if not present:
        write_atomically(path / "manifest.json", as_json(content))
        return content
    return resumed(accepted(read_manifest(path)), content, path)


def with_versions(
    path: Path, content: dict[str, Any], now: dict[str, str] | None, warnings: list[str]
) -> dict[str, Any]:
    """A folder's manifest, with the versions `now` that its remaining episodes run with (None: no episode is
    left to run); `warnings` gets what differs between rows.
    """
    if now is not None:
        content = gone_on_with(content, now)
    if changes := version_changes(content):
        warnings.append(f"rows in {path} come from several versions: {', '.join(changes)}")
    return content


def keep_traceback(path: Path, name: str, record: EpisodeRecord, about: str = "") -> EpisodeRecord:
    """Write an episode's traceback into errors/NAME.txt of a folder; the record with the file in its error.
    Raises StorageError.
    """
    file = path / "errors" / f"{name}.txt"
    make_folder(file.parent)
    write_atomically(file, f"{about}{record.error}\n\n{record.traceback}")
    told = f"{record.error}{TRACEBACK}{file.relative_to(path)}"
    return EpisodeRecord({**record.values, "error": told}, record.traceback)


def metrics_csv(groups: Sequence[Group], by: Sequence[str], metrics: Sequence[Metric] = METRICS) -> str:
    """The text of `metrics.csv`: the columns grouped by, episodes, errors, and each metric's statistics."""
    lines = [[*by, "episodes", "errors", *(f"{m.name}_{s}" for m in metrics for s in STATISTICS)]]
    for group in groups:
        values = [value for metric in metrics for value in group.metrics[metric.name]]
        lines.append([*group.key, *map(as_text, (group.episodes, group.errors, *values))])
    return "".join(map(format_row, lines))


def read_sweep(path: str | Path) -> tuple[list[dict[str, str]], tuple[str, ...]]:
    """All rows of a sweep's folder and the names of its swept parameters, as `sweep_rows` has them."""
    rows = sweep_rows(path)
    return by_row(rows.blocks()), rows.parameters


def sweep_rows(path: str | Path) -> SweepRows:
    """The rows of a sweep's folder, read as they are used; without any row there are no columns. Columns that
    did not exist yet when the folder was written are empty; columns that are not known here, such as a user's
    own, stand after the known ones. Raises SweepError when it is not the folder of a sweep.
    """
    path = Path(path)
    file = path / "episodes.csv"
    header, blocks = _read(path)
    if next(blocks, None) is None:
        return SweepRows((), (), lambda: iter(()))
    missing = [name for name in (*IDENTITY, "outcome", "error") if name not in header]
    if missing:
        raise SweepError(f"{file} has no column {missing[0]!r}; is it the file of a sweep?")
    renamed = {old: new for old, new in _RENAMED.items() if new not in header}
    there = [renamed.get(name, name) for name in header]
    others = [name for name in there if name not in COLUMNS and name not in _DROPPED]
    swept = _swept(path)
    parameters = tuple(name for name in others if swept is None or name in swept)
    names = (*COLUMNS, *(name for name in others if name not in parameters), *parameters)

    def columns() -> Iterator[Columns]:
        named = _named(path)
        for cells in _read(path)[1]:
            known = dict(zip(there, cells, strict=True))
            nothing = [""] * len(cells[0])
            for column, those in named.items():
                _refuse_strangers(path, column, set(known[column]) - those)
            yield {name: known.get(name, nothing) for name in names}

    lacking = frozenset(missing_columns(there))
    return SweepRows(
        names, parameters, lambda: undamaged(columns(), parameters, file), lacking, _algorithms(path)
    )


def _algorithms(path: Path) -> dict[str, str]:
    """Agent -> algorithm, as a folder's manifest says it; empty without a sound one."""
    try:
        return agent_algorithms(read_manifest(path))
    except SweepError:
        return {}


def _named(path: Path) -> dict[str, set[str]]:
    """Column -> the agents or scenarios of a folder's manifest; empty without a sound one."""
    try:
        told = read_manifest(path)["configuration"]
    except SweepError:
        return {}
    parts = {"agent": "agents", "scenario": "scenarios"}
    return {column: {one_line(as_text(name)) for name in told[part]} for column, part in parts.items()}


def _refuse_strangers(path: Path, column: str, others: set[str]) -> None:
    """Raise SweepError for rows of agents or scenarios of which the manifest says nothing, so that nobody
    knows what they were made from."""
    if others:
        raise SweepError(
            f"{path / 'episodes.csv'} has rows of the {column} {min(others)!r}, of which manifest.json says "
            "nothing; leave them in the folder where they were driven: `rudc table` takes several folders"
        )


def _swept(path: Path) -> set[str] | None:
    """The dotted keys that a folder's scenarios sweep, as its manifest says; None without a sound one."""
    try:
        scenarios = read_manifest(path)["configuration"]["scenarios"]
    except SweepError:
        return None
    found: set[str] = set()
    for scenario in scenarios.values():
        sweep = scenario["values"].get("sweep", {})
        if not (isinstance(sweep, dict) and all(isinstance(values, list) for values in sweep.values())):
            return None
        found |= sweep.keys()
    return found


def _read(path: Path) -> tuple[list[str], Iterator[Cells]]:
    """Names of the columns of `episodes.csv` and its cells, a block at a time, with those of
    `conditions.csv`, which earlier versions kept apart.
    """
    header, blocks = table_blocks(path / "episodes.csv")
    if not (path / "conditions.csv").is_file():
        return header, blocks
    others, apart = table_blocks(path / "conditions.csv")
    more = [name for name in others if name not in header]
    by, added = ([k for k, name in enumerate(others) if (name in more) == new] for new in (False, True))
    rows = (row for block in apart for row in zip(*block, strict=True))
    known = {tuple(row[k] for k in by): [row[k] for k in added] for row in rows}
    at, nothing = [header.index(others[k]) for k in by], [""] * len(more)

    def joined() -> Iterator[Cells]:
        for cells in blocks:
            keys = zip(*(cells[k] for k in at), strict=True) if at else [()] * len(cells[0])
            found = [known.get(key, nothing) for key in keys]
            yield [*cells, *([row[k] for row in found] for k in range(len(more)))]

    return [*header, *more], joined()
