"""Options that several commands have."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated

import typer

Workers = Annotated[
    int | None, typer.Option("--workers", "-w", min=1, help="Processes, a world each. Default: one a core.")
]
ResultsFolder = Annotated[
    Path | None, typer.Option("--out", "-o", metavar="DIR", help="Folder for the results.")
]
LiveReport = Annotated[
    bool, typer.Option("--report", help="Keep DIR/report.html fresh meanwhile: `rudc report`, live.")
]


def cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
