"""Whether the rows of a sweep say what episodes can: outcomes, numbers, each episode once."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

from rudc.env.episode import Outcome
from rudc.errors import SweepError
from rudc.evaluation.columns import COLUMNS, IDENTITY
from rudc.evaluation.store import MENDED

_NUMBERS = tuple(name for name, column in COLUMNS.items() if column.average is not None)
_OUTCOMES = frozenset(map(str, Outcome))


def refuse_damaged(rows: Sequence[Mapping[str, str]], parameters: Sequence[str], path: Path) -> None:
    """Raise SweepError, with the line's number, for the first row that no episode has written. Rows are those
    of the whole file, without its header.
    """
    first: dict[tuple[str, ...], int] = {}
    for line, row in enumerate(rows, 2):
        if wrong := _wrong(row):
            raise SweepError(f"{path}:{line}: {wrong}; {MENDED}")
        key = tuple(row[name] for name in (*IDENTITY, *parameters))
        other = first.setdefault(key, line)
        if other != line and not row["error"] and not rows[other - 2]["error"]:
            raise SweepError(f"{path}:{line}: the same episode as line {other}; delete one of them")


def _wrong(row: Mapping[str, str]) -> str:
    """What is wrong with a row, in words; empty for nothing."""
    seed, outcome = row["seed"], row["outcome"]
    if not (seed.isascii() and seed.isdigit() and len(seed) < 20):
        return f"seed: {seed[:40]!r} is no number of an episode"
    if row["error"] and outcome:
        return f"outcome: {outcome[:40]!r} of an episode that has an error"
    if not row["error"] and outcome not in _OUTCOMES:
        return f"outcome: {outcome[:40]!r} is none; there are {', '.join(sorted(_OUTCOMES))}"
    for name in _NUMBERS:
        if row[name] and not _is_number(row[name]):
            return f"{name}: {row[name][:40]!r} is no finite number"
    return ""


def _is_number(text: str) -> bool:
    try:
        return math.isfinite(float(text))
    except ValueError:
        return False
