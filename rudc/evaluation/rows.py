"""Rows of a sweep by column, a block at a time, and a check that episodes can have written them: outcomes,
numbers, each episode once. Of a million rows only a block is in memory.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from rudc.arrays import Array, Index
from rudc.env.outcome import Outcome
from rudc.errors import SweepError
from rudc.evaluation.columns import BOUND, COLUMNS, IDENTITY
from rudc.evaluation.store import MENDED

Row = Mapping[str, str]
"""a row of `episodes.csv`: column name -> text"""
Columns = Mapping[str, Sequence[str]]
"""some rows of it: column name -> text in each, (n,)"""

_NUMBERS = tuple(name for name, column in COLUMNS.items() if column.average is not None)
_OUTCOMES = frozenset(map(str, Outcome))
_SEED_DIGITS = 20
"""a seed has fewer"""


@dataclass(frozen=True)
class SweepRows:
    """The rows of a sweep's folder, read as they are used."""

    names: tuple[str, ...]
    """names of the columns: those of `COLUMNS`, those that are not known here, `parameters`"""
    parameters: tuple[str, ...]
    """dotted keys that were swept, columns too"""
    blocks: Callable[[], Iterator[Columns]]
    """reads them from the first on. Raises SweepError, with the line's number, where one is damaged"""
    lacking: frozenset[str] = frozenset()
    """columns of `COLUMNS` that the file does not have; they read as empty"""
    algorithms: Mapping[str, str] = field(default_factory=dict)
    """agent -> the algorithm that it learnt by, as far as the folder's manifest says it"""


def by_column(rows: Sequence[Row], names: Iterable[str]) -> Columns:
    """Some columns of rows. Cells may be texts, as in a sweep's rows, or what pandas makes of them: numbers,
    with nan where a cell is empty, and whole ones as floats in a column with an empty cell.
    """
    return {name: [_text(row[name]) for row in rows] for name in names}


def _text(cell: object) -> str:
    if isinstance(cell, float):
        return "" if cell != cell else f"{cell:.0f}" if cell.is_integer() else str(cell)
    return str(cell)


def by_row(blocks: Iterable[Columns]) -> list[dict[str, str]]:
    """Rows one by one."""
    return [
        dict(zip(block, cells, strict=True))
        for block in blocks
        for cells in zip(*block.values(), strict=True)
    ]


def as_numbers(texts: Sequence[str]) -> Array:
    """(n,) what cells say, nan where they are empty. Raises ValueError."""
    if "" in texts:
        texts = [text or "nan" for text in texts]
    return np.fromiter(map(float, texts), float, len(texts))


def undamaged(blocks: Iterable[Columns], parameters: Sequence[str], path: Path) -> Iterator[Columns]:
    """The same blocks, each checked first. Raises SweepError, with the line's number, for the first row that
    no episode can have written; and, after the last block, for an episode that stands there twice (recognised
    by a 64-bit hash of its identity). The blocks are those of the whole file at `path`, without its header.
    """
    lines, keys, begun = [], [], 2
    for block in blocks:
        count = len(block["seed"])
        if not _sound(block):
            for number, row in enumerate(by_row([block]), begun):
                if wrong := _wrong(row):
                    raise SweepError(f"{path}:{number}: {wrong}; {MENDED}")
        ran = np.array([not error for error in block["error"]], dtype=bool)
        identity = zip(*(block[name] for name in (*IDENTITY, *parameters)), strict=True)
        keys.append(np.fromiter(map(hash, identity), np.int64, count)[ran])
        lines.append(begun + np.flatnonzero(ran))
        begun += count
        yield block
    if keys:
        _refuse_twice(np.concatenate(keys), np.concatenate(lines), path)


def _refuse_twice(keys: Index, lines: Index, path: Path) -> None:
    """Raise SweepError for the first line whose key an earlier line has."""
    order = np.argsort(keys, kind="stable")
    again = np.flatnonzero(keys[order][1:] == keys[order][:-1])
    if len(again):
        k = again[np.argmin(order[again + 1])]
        line, other = lines[order[k + 1]], lines[order[k]]
        raise SweepError(f"{path}:{line}: the same episode as line {other}; delete one of them")


def _sound(block: Columns) -> bool:
    """Whether no row of a block is wrong; as `_wrong`, for all at once."""
    seeds = block["seed"]
    digits = "".join(seeds)
    if not (digits.isascii() and digits.isdigit() and all(seeds) and max(map(len, seeds)) < _SEED_DIGITS):
        return False
    ends = set(zip(map(bool, block["error"]), block["outcome"], strict=True))
    if any(bool(outcome) if failed else outcome not in _OUTCOMES for failed, outcome in ends):
        return False
    try:  # where sizes add up to less than the bound, each is below it
        return all(sum(map(abs, map(float, {*block[name]} - {""}))) < BOUND for name in _NUMBERS)
    except ValueError:
        return False


def _wrong(row: Row) -> str:
    """What is wrong with a row, in words; empty for nothing."""
    seed, outcome = row["seed"], row["outcome"]
    if not is_whole(seed):
        return f"seed: {seed[:40]!r} is no number of an episode"
    if row["error"] and outcome:
        return f"outcome: {outcome[:40]!r} of an episode that has an error"
    if not row["error"] and outcome not in _OUTCOMES:
        return f"outcome: {outcome[:40]!r} is none; there are {', '.join(sorted(_OUTCOMES))}"
    for name in _NUMBERS:
        if row[name] and not _is_number(row[name]):
            return f"{name}: {row[name][:40]!r} is no number between -{BOUND:g} and {BOUND:g}"
    return ""


def is_whole(text: str) -> bool:
    """Whether a text is a whole number as seeds and rows have: digits from 0 to 9 only, and fewer than 20."""
    return text.isascii() and text.isdigit() and len(text) < _SEED_DIGITS


def _is_number(text: str) -> bool:
    try:
        return abs(float(text)) < BOUND
    except ValueError:
        return False
