"""`rudc report`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rudc.cli.console import Quiet, note, warn


def report(
    folder: Annotated[
        Path,
        typer.Argument(
            metavar="DIR", help="Folder of a sweep, finished or not, of a training, or of a study."
        ),
    ],
    out: Annotated[
        Path | None, typer.Option("--out", "-o", metavar="F.html", help="The page. Default: DIR/report.html.")
    ] = None,
    replays: Annotated[
        int,
        typer.Option(
            min=0,
            metavar="N",
            help="Replay the N worst episodes, at most three of each scenario and agent, into `replays` "
            "beside it.",
        ),
    ] = 0,
    quiet: Quiet = False,
) -> None:
    """Write what a sweep, a training or a study says as a page: one file, for any browser, offline.

    Of a sweep: what stands out in sentences, rates of each scenario and agent, the table of metrics with its
    intervals, differences between any two agents in the same episodes, distributions, how episodes ended,
    whether events happened, the worst episodes and how to replay them, and what it was made from.

    **Examples**

    `rudc report out/first`

    `rudc report out/first --out first.html --replays 5`
    """
    from rudc.reporting.html.page import check_page
    from rudc.reporting.report.page import NAME, save_report

    page = out or folder / NAME
    check_page(page, "a report")
    if replays:
        _replay_worst(folder, page, replays)
    save_report(folder, page)
    note(f"{page} written")


def _replay_worst(folder: Path, page: Path, count: int) -> None:
    """Pages of a sweep's worst episodes, in a folder beside the report."""
    from rudc.evaluation.rerun import Swept
    from rudc.reporting.replay.again import replayed
    from rudc.reporting.replay.page import save_replay
    from rudc.reporting.report.episodes import Episodes, replay_name, worst
    from rudc.reporting.report.sweep import REPLAYS

    sweep = Swept(folder)  # read once: a sweep that ends sorts its rows
    episodes = Episodes.of(sweep.rows, sweep.parameters)
    for i in worst(episodes)[:count]:
        done = replayed(folder, sweep.episode(i + 1))
        (note if done.same else warn)(done.line)
        save_replay(page.parent / REPLAYS / replay_name(episodes, i), [done.page], [done.check])
