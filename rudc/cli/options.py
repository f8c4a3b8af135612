"""Options that several commands have."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated

import typer

from rudc.errors import InputError

Workers = Annotated[
    int | None, typer.Option("--workers", "-w", min=1, help="Processes, a world each. Default: one a core.")
]
ResultsFolder = Annotated[
    Path | None,
    typer.Option(
        "--out", "-o", metavar="DIR", help="Folder for the results.",
    ),
]  # fmt: skip
LiveReport = Annotated[
    bool,
    typer.Option(
        "--report",
        help="Write DIR/report.html again and again while this runs, as `rudc report` does at the end.",
    ),
]
Overrides = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="Another value at a dotted key; repeat for several."),
]


def cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def parse_overrides(given: list[str] | None, option: str = "--set") -> dict[str, object]:
    """`KEY=VALUE` texts of an option as a dictionary; values are read as in a scenario file. Raises
    InputError.
    """
    from rudc.scenario.yaml_text import read_value

    found: dict[str, object] = {}
    for text in given or []:
        key, equals, value = text.partition("=")
        if not equals or not key.strip():
            raise InputError(f"{option} {text!r}: expected KEY=VALUE")
        if (key := key.strip()) in found:
            raise InputError(f"{option} {text!r}: {key} is given twice; a sweep takes a list")
        try:
            found[key] = read_value(value)
        except ValueError as error:
            raise InputError(f"{option} {text!r}: {error}") from None
    return found
