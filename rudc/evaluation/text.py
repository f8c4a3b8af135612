"""Tables as CSV and as Markdown."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from rudc.evaluation.columns import RATES
from rudc.evaluation.record import as_text
from rudc.evaluation.store import format_row

MISSING = "–"
"""stands where a number is not known"""


def csv_text(rows: Sequence[Mapping[str, object]]) -> str:
    """Rows of equal keys as CSV; numbers to six decimals, nothing for nan."""
    cells = [list(rows[0]), *([_cell(value) for value in row.values()] for row in rows)]
    return "".join(map(format_row, cells))


def markdown(headings: Sequence[str], rows: Sequence[Sequence[str]], left: int = 1) -> str:
    """A table whose first `left` columns are aligned to the left, the others to the right."""
    lines = [[text.replace("|", "\\|") for text in line] for line in (headings, *rows)]
    widths = [max(len(line[k]) for line in lines) for k in range(len(headings))]
    rule = ["-" * width if k < left else "-" * (width - 1) + ":" for k, width in enumerate(widths)]
    padded = [
        [
            text.ljust(w) if k < left else text.rjust(w)
            for k, (text, w) in enumerate(zip(line, widths, strict=True))
        ]
        for line in lines
    ]
    return "".join(f"| {' | '.join(line)} |\n" for line in [padded[0], rule, *padded[1:]])


def number(value: float, decimals: int = 1) -> str:
    """A number; `MISSING` where it is not known."""
    return MISSING if math.isnan(value) else f"{value:.{decimals}f}"


def rate_decimals(rate: float, decimals: int = 1) -> int:
    """With how many decimals a rate in percent, or its change, is written: one more, and more if need be,
    where it would look like 0 or 100 and is not.
    """
    return next((n for n in range(decimals, 6) if round(abs(rate), n) not in (0.0, 100.0)), decimals)


def interval(mean: float, low: float, high: float, decimals: int = 1) -> str:
    """`mean [low, high]`, without the interval where there is none."""
    text = number(mean, decimals)
    known = not any(map(math.isnan, (mean, low, high)))
    return f"{text} [{low:.{decimals}f}, {high:.{decimals}f}]" if known else text


def interval_of(line: Mapping[str, Any], name: str, decimals: int = 1) -> str:
    """`interval` of a line's NAME, NAME_low and NAME_high; with `rate_decimals` where NAME is or begins with
    that of a rate.
    """
    if name.partition("_")[0] in RATES:
        decimals = rate_decimals(line[name], decimals)
    return interval(line[name], line[f"{name}_low"], line[f"{name}_high"], decimals)


def _cell(value: object) -> str:
    return as_text(round(float(value), 6)) if isinstance(value, float) else as_text(value)
