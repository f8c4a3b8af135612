"""What training writes as it goes: `progress.csv`, `evaluation.csv`, TensorBoard's files if it is installed.

Rows carry the number of decisions taken. On resuming, rows beyond the checkpoint are removed, so that a
training that was stopped leaves the same files as one that was not (except for wall times).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Protocol

from rudc.env.outcome import Outcome
from rudc.errors import InputError
from rudc.evaluation.record import EpisodeRecord
from rudc.evaluation.store import MENDED, format_row, read_header, read_table
from rudc.files import explain, write_atomically
from rudc.training.collect import Finished

OUTCOMES = tuple(map(str, Outcome))
BEFORE = ("steps", "updates", "episodes", *OUTCOMES, "episode_reward", "episode_cost", "episode_steps")
AFTER = ("sigma_l", "sigma_h", "wall_s")
"""columns of progress.csv, before and after the learner's statistics; outcomes are shares of the episodes
that ended since the last row, sigma_l and sigma_h those of the last decisions, empty where no sigma is
stated
"""
EVALUATION = (
    "steps",
    "scenario",
    "priority",
    "episodes",
    *OUTCOMES,
    "episode_reward",
    "mean_speed_mps",
    "duration_s",
)
"""columns of evaluation.csv; `priority`: all, or the arms that are major or minor"""
_TEXTS = ("scenario", "priority")
"""columns that hold no numbers"""


class Watcher(Protocol):
    """Is told how a training goes, for the user's eyes."""

    def progress(self, row: Mapping[str, Any]) -> None:
        """A new row of progress.csv."""
        ...

    def advance(self, steps: int) -> None:
        """`steps` decisions were taken in all; told once before the first round, too, when the folder is
        known to be the training's."""
        ...

    def note(self, text: str) -> None:
        """Something worth a line."""
        ...


class Log:
    """The files in a training's folder."""

    def __init__(self, folder: Path, from_step: int, statistics: Sequence[str]) -> None:
        """`statistics`: names of the learner's. Rows beyond `from_step` of files that are there already are
        removed. Raises InputError for files with other columns, or damaged.
        """
        self._files = {"progress": (*BEFORE, *statistics, *AFTER), "evaluation": EVALUATION}
        self._folder = folder
        for name, columns in self._files.items():
            _cut(folder / f"{name}.csv", columns, from_step)
        self._board: Any = None
        if find_spec("tensorboard") is not None:
            from torch.utils.tensorboard.writer import SummaryWriter

            self._board = SummaryWriter(str(folder / "tensorboard"), purge_step=from_step + 1)

    def write(self, name: str, row: Mapping[str, Any]) -> None:
        """Append a row to `progress` or `evaluation`."""
        columns = self._files[name]
        text = format_row([_shown(row[column]) for column in columns])
        try:
            with open(self._folder / f"{name}.csv", "a", encoding="utf-8") as file:
                file.write(text)
        except OSError as error:
            explain(self._folder / f"{name}.csv", error)
        if self._board is not None:
            head = "/".join(str(row[c]) for c in columns if isinstance(row[c], str)) or "train"
            for column in columns:
                if isinstance(row[column], int | float) and math.isfinite(row[column]):
                    self._board.add_scalar(f"{name}/{head}/{column}", row[column], row["steps"])

    def close(self) -> None:
        """Write out what is not yet on disk."""
        if self._board is not None:
            self._board.close()


def episode_columns(finished: Sequence[Finished]) -> dict[str, float]:
    """Columns of progress.csv about the episodes that ended."""
    count = len(finished)
    row: dict[str, float] = {"episodes": count}
    for outcome in OUTCOMES:
        row[outcome] = _mean([episode.outcome == outcome for episode in finished])
    row["episode_reward"] = _mean([episode.reward for episode in finished])
    row["episode_cost"] = _mean([episode.cost for episode in finished])
    row["episode_steps"] = _mean([episode.steps for episode in finished])
    return row


def evaluation_rows(steps: int, records: Sequence[EpisodeRecord]) -> list[dict[str, Any]]:
    """Rows of evaluation.csv: each scenario as a whole, its major and its minor arms."""
    rows = []
    for scenario in dict.fromkeys(record.scenario for record in records):
        for priority in ("all", "major", "minor"):
            chosen = [
                r for r in records if r.scenario == scenario and priority in ("all", r.text("priority"))
            ]
            if chosen:
                rows.append(_evaluation_row(steps, scenario, priority, chosen))
    return rows


def _evaluation_row(
    steps: int, scenario: str, priority: str, records: Sequence[EpisodeRecord]
) -> dict[str, Any]:
    row: dict[str, Any] = {
        "steps": steps,
        "scenario": scenario,
        "priority": priority,
        "episodes": len(records),
    }
    for outcome in OUTCOMES:
        row[outcome] = _mean([record.outcome == outcome for record in records])
    for column in ("episode_reward", "mean_speed_mps", "duration_s"):
        row[column] = _mean([record.number(column) for record in records])
    return row


def _mean(values: Sequence[float]) -> float:
    return math.fsum(values) / len(values) if values else math.nan


def _shown(value: Any) -> str:
    if isinstance(value, float):
        return "" if math.isnan(value) else f"{value:.6g}"
    return str(value)


def read_log(path: Path) -> list[dict[str, str]]:
    """The whole rows of one of the files. Raises InputError if there is none, and, with its line, for a cell
    that is no number where one should be.
    """
    rows = read_table(path)
    for line, row in enumerate(rows, 2):
        for name, cell in row.items():
            if name not in _TEXTS and not _is_number(cell, whole=name == "steps"):
                kind = "whole number" if name == "steps" else "number"
                raise InputError(f"{path}:{line}: {name} is {cell!r}, which is no {kind}; {MENDED}")
    return rows


def _is_number(cell: str, *, whole: bool) -> bool:
    try:
        _ = int(cell) if whole else float(cell or "nan")
    except ValueError:
        return False
    return True


def _cut(path: Path, columns: Sequence[str], step: int) -> None:
    """Leave in a file only its heading and the rows up to `step`; make it if there is none."""
    header = read_header(path)
    if header and header != list(columns):
        raise InputError(
            f"{path} has other columns than are written now: move it elsewhere to go on with a new one, or "
            "train anew in another folder"
        )
    rows = [list(row.values()) for row in read_log(path) if int(row["steps"]) <= step] if header else []
    write_atomically(path, "".join(map(format_row, [columns, *rows])))
