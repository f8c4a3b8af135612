"""`rudc table`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from rudc.cli.complete import complete_columns, complete_metrics
from rudc.cli.console import Quiet, warn
from rudc.errors import InputError


def table(
    folders: Annotated[
        list[Path],
        typer.Argument(
            metavar="DIR...",
            help="Folder of a sweep, finished or not. Of several the rows count together; "
            "`--by folder,agent` keeps them apart.",
        ),
    ],
    style: Annotated[
        Literal["csv", "markdown", "latex"] | None,
        typer.Option("--format", "-f", help="How it is written. Default: for reading on this screen."),
    ] = None,
    by: Annotated[
        str | None,
        typer.Option(
            metavar="COLUMN,...",
            help="Columns of episodes.csv to group by: `priority`, `turn`, `events_fired`, ... "
            "Default: scenario, swept values, agent.",
            autocompletion=complete_columns,
        ),
    ] = None,
    metrics: Annotated[
        str | None,
        typer.Option(
            metavar="NAME,...",
            help="What is shown: SR, VR, ..., or columns: `interventions`, `mean_sigma`, ... "
            "Default: the paper's seven metrics.",
            autocompletion=complete_metrics,
        ),
    ] = None,
    as_json: Annotated[
        bool, typer.Option("--json", help="As JSON, numbers in full; instead of --format.")
    ] = False,
    against: Annotated[
        Literal["comparison", "ablation", "paper"] | None,
        typer.Option(help="Put a table of the paper beside, or both."),
    ] = None,
    quiet: Quiet = False,
) -> None:
    """The metrics of a sweep, or of several, with 95 % intervals: Wilson's for rates; for means Student's
    below 20 episodes, the bootstrap's from 20 on, the normal one from 2,000 on. On the screen stand those of
    rates only; `--format markdown` and `csv` have those of means, too. Bold: better than all other agents in
    the scenario, by intervals that do not overlap.

    **Examples**

    `rudc table out/all --format latex > table.tex`

    `rudc table out/all --by scenario,agent,priority`

    `rudc table out/all --by agent,events_fired --metrics SR,VR,interventions`

    `rudc table out/all --json | jq '.[] | select(.agent == "rudc-t") | .SR.mean'`

    `rudc table out/part-0 out/part-1`: one sweep that was driven in parts

    `rudc table out/before out/after --by folder,agent`: two sweeps side by side

    `rudc table out/all --against comparison --format markdown`
    """
    from rudc.cli.metrics_table import print_metrics
    from rudc.evaluation.columns import DECISION_MS, METRICS
    from rudc.evaluation.joined import joined_rows
    from rudc.evaluation.paper import is_from_paper, tasks
    from rudc.evaluation.tables import measured, named_metrics, written
    from rudc.evaluation.unfinished import lacking

    if as_json and style is not None:
        raise InputError("--json is a format of its own: give it, or --format")
    warnings: list[str] = []
    rows = joined_rows(folders, _names(by) if by else ["scenario", "agent"], warnings)
    for text in (*warnings, *filter(None, map(lacking, folders))):
        warn(f"warning: {text}")
    columns = _names(by) if by else ["scenario", *rows.parameters, "agent"]
    chosen = named_metrics(_names(metrics)) if metrics else None
    form = "json" if as_json else style
    groups = measured(rows, columns, against, chosen or (METRICS if form else (*METRICS, DECISION_MS)))
    if form is None:
        print_metrics(groups, columns, chosen)
    else:
        typer.echo(written(groups, columns, form, chosen or METRICS), nl=False)
    if against is not None and not any(map(is_from_paper, groups)):
        its = " and ".join(tasks(against))
        warn(f"nothing to put beside: the paper's tasks are {its}, and none of them was driven")


def _names(text: str) -> list[str]:
    """Each once, in the order given."""
    return list(dict.fromkeys(name.strip() for name in text.split(",") if name.strip()))
