"""`rudc replay`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rudc.cli.console import Quiet, note, warn
from rudc.errors import InputError

MOST = 2
"""episodes beside each other"""


def replay(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder of a sweep, finished or not.")],
    episodes: Annotated[
        list[str],
        typer.Option(
            "--episode",
            "-e",
            metavar="SCENARIO:AGENT:SEED|ROW",
            help="Which one, or the number of its row in episodes.csv, from 1. Twice: beside each other.",
        ),
    ],
    out: Annotated[Path, typer.Option("--out", "-o", metavar="F.html", help="The page.")],
    quiet: Quiet = False,
) -> None:
    """Run an episode of a sweep again and write it as a page to look at: one file, for any browser, offline.

    The episode is set up from DIR's manifest and compared with its row. Exit status 1 if it came out
    differently; the page is written all the same, and says so. If the agent failed in the episode, the page
    has what came before.

    **Examples**

    `rudc replay out/first --episode dense_left_turn:sumo:3 --out replay.html`

    `rudc replay out/first -e dense_left_turn:follower:0 -e dense_left_turn:follower+ttcbf:0 -o both.html`
    """
    from rudc.evaluation.rerun import find_episode
    from rudc.reporting.html.page import check_page
    from rudc.reporting.replay.again import replayed
    from rudc.reporting.replay.page import WHAT, save_replay

    check_page(out, WHAT)
    if len(episodes) > MOST:
        raise InputError(f"{len(episodes)} episodes were asked for, at most {MOST} stand beside each other")
    done = []
    for which in episodes:
        done.append(replayed(folder, find_episode(folder, which)))
        (note if done[-1].same else warn)(done[-1].line)
    save_replay(out, [one.page for one in done], [one.check for one in done])
    note(f"{out} written")
    if not all(one.same for one in done):
        raise typer.Exit(1)
