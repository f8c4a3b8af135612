"""What the commands share for talking to a user: consoles, tables, progress.

Results go to stdout, everything else to stderr.
"""

from __future__ import annotations

import contextlib
import json
import math
import os
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console
from rich.table import Table
from rich.text import Text

if TYPE_CHECKING:
    from rich.progress import Progress

    from rudc.evaluation.record import EpisodeRecord
    from rudc.evaluation.tasks import Task
    from rudc.scenario.model import Scenario

FAILURES_NAMED = 5
"""failed episodes named while a sweep runs"""
TRIED_AGAIN = (
    "--resume tries them again; where you change code of your own to mend them, give a new --out instead: "
    "rows of old and new code would mix"
)
"""advice for episodes that failed"""
SILENCE_S = 30.0
"""s without a word at most, off a terminal"""
WIDE = 200
"""columns assumed where there is no terminal: nothing is cut off in a log"""


def console(*, to_stderr: bool = False) -> Console:
    """A console as wide as the terminal or as COLUMNS says, or else wide enough for anything."""
    stream = sys.stderr if to_stderr else sys.stdout
    told = stream.isatty() or "COLUMNS" in os.environ  # `main` has dropped what is no number
    return Console(file=stream, width=None if told else WIDE, highlight=False, emoji=False)


class _Manner:
    """How the command line talks."""

    quiet = False


def _be_quiet(quiet: bool) -> bool:
    _Manner.quiet = quiet
    return quiet


Quiet = Annotated[
    bool,
    typer.Option("--quiet", "-q", callback=_be_quiet, help="Say nothing but results, warnings and errors."),
]
"""an option of commands that say how they are getting on"""
AsJson = Annotated[bool, typer.Option("--json", help="As JSON, for programs.")]
"""an option of commands whose output a program may want to read"""


def note(text: str) -> None:
    """A line for the user that is not a result; left out by `--quiet`."""
    if not _Manner.quiet:
        warn(text)


def warn(text: str) -> None:
    """A line that `--quiet` does not leave out."""
    print(text, file=sys.stderr, flush=True)


@contextlib.contextmanager
def broken_left_out() -> Iterator[None]:
    """In the block, parts that installed packages offer but that cannot be imported are left out, with a
    warning.
    """
    from rudc.imports import leaving_out

    with leaving_out(lambda text: warn(f"warning: left out: {text}")):
        yield


def note_sweep(scenario: Scenario) -> None:
    """For a scenario with a sweep, say which values a single episode of it has."""
    from rudc.hints import listed
    from rudc.scenario.dotted import value_at, value_text

    if not scenario.sweep:
        return
    data, keys = scenario.data(), list(scenario.sweep)
    swept = [f"{key} ({listed([*map(value_text, scenario.sweep[key])])})" for key in keys]
    here = [f"{key}={value_text(value)}" for key in keys if (value := value_at(data, key)) is not None]
    note(
        f"{scenario.name} sweeps {', '.join(swept)}; this is one episode, "
        f"with {', '.join(here) or 'none of these values'}: `rudc sweep` drives the grid, "
        f"`--set {keys[0]}=VALUE` chooses a value"
    )


@contextlib.contextmanager
def resumable(out: Path, close: Callable[[], None]) -> Iterator[None]:
    """Work that keeps what is finished in the folder `out`. `close` ends what shows its progress; Ctrl-C
    says how to go on, and leaves with 130.
    """
    try:
        yield
    except KeyboardInterrupt:
        close()
        note(f"interrupted; what is finished is kept in {out}: add --resume to go on")
        raise typer.Exit(130) from None
    finally:
        close()


def print_json(found: object) -> None:
    """Write values as JSON; null stands for a number that is not known or not finite."""
    typer.echo(json.dumps(_plain(found), indent=1, allow_nan=False))


def _plain(found: Any) -> Any:
    if isinstance(found, Mapping):
        return {str(key): _plain(value) for key, value in found.items()}
    if isinstance(found, (list, tuple)):
        return [_plain(value) for value in found]
    if hasattr(found, "tolist"):  # NumPy's
        return _plain(found.tolist())
    if isinstance(found, float) and not math.isfinite(found):
        return None
    return str(found) if isinstance(found, Path) else found


def print_table(
    headings: Sequence[str],
    rows: Sequence[Sequence[str | Text]],
    right: Sequence[int] = (),
    *,
    widest: int | None = None,
) -> None:
    """Print a plain table, of text as it is or with a style. `right`: indices of the columns aligned to the
    right; `widest`: characters that it may be wide, where the screen has more.
    """
    grid = Table(box=None, pad_edge=False, header_style="bold")
    for k, heading in enumerate(headings):
        grid.add_column(heading, justify="right" if k in right else "left", overflow="fold")
    for row in rows:
        grid.add_row(
            *(Text(cell) if isinstance(cell, str) else cell for cell in row)
        )  # text of users is not read as markup
    screen = console()
    screen.print(grid, width=screen.width if widest is None else min(widest, screen.width))


def sweep_progress(rows: str = "episodes.csv") -> SweepBar | SweepLines:
    """A bar on a terminal, a line now and then elsewhere. `rows`: file of the episodes' rows, if any."""
    return SweepBar(rows) if shows_bars() else SweepLines(rows)


def shows_bars() -> bool:
    """Whether there is a terminal, and `--quiet` was not given."""
    return sys.stderr.isatty() and not _Manner.quiet


class _Outcomes:
    """How the episodes run so far have ended."""

    def __init__(self) -> None:
        self._counts = Counter[str]()

    def __str__(self) -> str:
        """`SR 97 %, VR 1 %`, or nothing before the first."""
        from rudc.evaluation.columns import rates_of

        rates = rates_of(self._counts)
        return f"SR {rates['SR']:.0f} %, VR {rates['VR']:.0f} %" if self._counts else ""

    def count(self, record: EpisodeRecord) -> None:
        """Take in an episode that has ended."""
        if not record.error:
            self._counts[record.outcome] += 1


class SweepLines:
    """Says how far a sweep is: at each tenth, and at least every 30 s."""

    def __init__(self, rows: str = "episodes.csv") -> None:
        self._rows = rows

    def begin(self, total: int, finished: int, warnings: Sequence[str]) -> None:
        """Say what there is to do."""
        self._total, self._done, self._first, self._failed = total, finished, finished, 0
        self._start = self._last = time.monotonic()
        self._outcomes = _Outcomes()
        _begin_notes(total, finished, warnings)

    def advance(self, task: Task, record: EpisodeRecord) -> None:
        """Count an episode."""
        self._done += 1
        self._failed += bool(record.error)
        self._outcomes.count(record)
        if record.error:
            _note_failure(self._failed, task, record, self._rows)
        now = time.monotonic()
        tenth = 10 * self._done // self._total > 10 * (self._done - 1) // self._total
        if tenth or now - self._last > SILENCE_S:
            self._last = now
            rate = (self._done - self._first) / max(now - self._start, 1e-9)
            left = (self._total - self._done) / rate
            failed = f", {self._failed} failed" if self._failed else ""
            so_far = f", {self._outcomes}" if str(self._outcomes) else ""
            note(
                f"{self._done}/{self._total} episodes{failed}{so_far}, {rate:.1f}/s, about {left:.0f} s left"
            )

    def close(self) -> None:
        """Nothing to tidy up."""


def progress_bar() -> Progress:
    """A bar with a count, the time left and a description, on stderr; it vanishes when stopped."""
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns: list[Any] = [
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
        TextColumn("{task.description}", markup=False),
    ]
    return Progress(*columns, console=console(to_stderr=True), transient=True)


class SweepBar:
    """A bar that shows how far a sweep is and what it is doing."""

    def __init__(self, rows: str = "episodes.csv") -> None:
        self._rows = rows
        self._progress = progress_bar()
        self._failed = 0
        self._outcomes = _Outcomes()

    def begin(self, total: int, finished: int, warnings: Sequence[str]) -> None:
        """Show the bar."""
        _begin_notes(total, finished, warnings)
        self._id = self._progress.add_task("", total=total, completed=finished)
        if finished < total:
            self._progress.start()

    def advance(self, task: Task, record: EpisodeRecord) -> None:
        """Move it."""
        if record.error:
            self._failed += 1
            _note_failure(self._failed, task, record, self._rows, self._progress.console)
        self._outcomes.count(record)
        failed = f"{self._failed} failed" if self._failed else ""
        parts = [failed, str(self._outcomes), task.scenario.name, task.agent]
        self._progress.update(self._id, advance=1, description=", ".join(filter(None, parts)))

    def close(self) -> None:
        """Take it away."""
        self._progress.stop()


def _note_failure(
    count: int, task: Task, record: EpisodeRecord, rows: str, on: Console | None = None
) -> None:
    """Name the first failures, and say in which file the others stand."""
    if count > FAILURES_NAMED + 1 or _Manner.quiet:
        return
    text = f"failed: {task}: {record.error}"
    if count > FAILURES_NAMED:
        text = "failed: more" + (f"; see the column `error` of {rows}" if rows else "")
    (on or console(to_stderr=True)).print(text, markup=False)


def _begin_notes(total: int, finished: int, warnings: Sequence[str]) -> None:
    for warning in warnings:
        warn(f"warning: {warning}")
    there = f", {finished} of them finished already" if finished else ""
    note(f"{total} episodes{there}")
