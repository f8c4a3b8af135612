"""`rudc table`, and the table at the end of a sweep."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Literal

import typer

from rudc.cli.console import console


def table(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder of a sweep, finished or not.")],
    style: Annotated[
        Literal["csv", "markdown", "latex"] | None,
        typer.Option("--format", "-f", help="How it is written. Default: for reading on this screen."),
    ] = None,
    by: Annotated[
        str | None,
        typer.Option(
            metavar="COLUMN,...",
            help="Columns to group by, also those of conditions.csv: `priority`, `turn`, `origin`. "
            "Default: scenario, swept values, agent.",
        ),
    ] = None,
    against: Annotated[
        Literal["comparison", "ablation", "paper"] | None,
        typer.Option(help="Put a table of the paper beside, or both."),
    ] = None,
) -> None:
    """The metrics of a sweep, with 95 % intervals: Wilson's for rates, bootstrap for means.

    **Examples**

    `rudc table out/all --format latex > table.tex`

    `rudc table out/all --by scenario,agent,priority`

    `rudc table out/all --against comparison --format markdown`
    """
    from rudc.evaluation.folder import read_sweep
    from rudc.evaluation.tables import make_table

    rows, parameters = read_sweep(folder)
    columns = [name.strip() for name in by.split(",")] if by else ["scenario", *parameters, "agent"]
    if style is None:
        print_metrics(rows, columns, against)
    else:
        typer.echo(make_table(rows, columns, style, against), nl=False)


def print_metrics(rows: Sequence[dict[str, str]], by: Sequence[str], against: str | None = None) -> None:
    """The table for a screen: rates with their intervals, means without, the best in bold."""
    from rich.table import Table
    from rich.text import Text

    from rudc.evaluation.metrics import METRICS
    from rudc.evaluation.paper import is_from_paper
    from rudc.evaluation.tables import MISSING, best_of, cell, decimals, heading, measured

    groups = measured(rows, by, against)
    best = best_of(groups, by)
    grid = Table(header_style="bold", pad_edge=False, box=None)
    for name in by:
        grid.add_column(name, overflow="fold")
    for name in ("n", *map(heading, METRICS), "decision (ms)"):
        grid.add_column(name, justify="right")
    before: tuple[str, ...] = ()
    for i, group in enumerate(groups):
        key = ["" if group.key[: k + 1] == before[: k + 1] else value for k, value in enumerate(group.key)]
        cells = []
        for metric in METRICS:
            value = group.metrics[metric.name]
            means_only = metric.column and not is_from_paper(group) and value.mean == value.mean
            text = f"{value.mean:.{decimals(metric)}f}" if means_only else cell(metric, value)
            cells.append(Text(text, style="bold" if (i, metric.name) in best else ""))
        count = (
            MISSING
            if is_from_paper(group)
            else str(group.episodes) + (f"+{group.errors}!" if group.errors else "")
        )
        spent = f"{group.decision_ms:.2f}" if group.decision_ms == group.decision_ms else MISSING
        if before and group.key[:1] != before[:1] and len(by) > 1:
            grid.add_section()
        grid.add_row(*map(Text, key), count, *cells, spent)
        before = group.key
    console().print(grid)
