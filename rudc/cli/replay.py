"""`rudc replay`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer

from rudc.cli.console import Quiet, note
from rudc.errors import InputError

if TYPE_CHECKING:
    from rudc.agents.base import Agent
    from rudc.evaluation.record import EpisodeRecord
    from rudc.scenario.model import Scenario

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

    The episode is set up from DIR's manifest and compared with its row. Exit status 1 where it came out
    otherwise; the page is written all the same, and says so.

    **Examples**

    `rudc replay out/first --episode dense_left_turn:sumo:3 --out replay.html`

    `rudc replay out/first -e dense_left_turn:follower:0 -e dense_left_turn:follower+ttcbf:0 -o both.html`
    """
    from rudc.reporting.html.page import check_page
    from rudc.reporting.replay.page import WHAT, save_replay

    check_page(out, WHAT)
    if len(episodes) > MOST:
        raise InputError(f"{len(episodes)} episodes were asked for, at most {MOST} stand beside each other")
    done = [replayed(folder, which) for which in episodes]
    save_replay(out, [one.page for one in done], [one.check for one in done])
    note(f"{out} written")
    if not all(one.same for one in done):
        raise typer.Exit(1)


class Replayed(NamedTuple):
    """An episode of a sweep that was run again."""

    page: dict[str, Any]
    """its recording"""
    check: str
    """what comparing it with its row says"""
    same: bool


def replayed(folder: Path, which: str) -> Replayed:
    """Run an episode of a sweep again, and say how it went. Raises SweepError, AgentError."""
    from rudc.agents.registry import make_agent
    from rudc.evaluation.rerun import differences, find_episode

    found = find_episode(folder, which)
    record, page = recorded(found.task.scenario, found.task.seed, make_agent(found.task.agent))
    other = differences(found.row, record)
    check = _check(folder, found.number, other, found.changes)
    note(f"{found.task}: {record.outcome}; {check}")
    return Replayed(page, check, not other)


def recorded(scenario: Scenario, seed: int, driver: Agent) -> tuple[EpisodeRecord, dict[str, Any]]:
    """An episode driven, and its recording."""
    from rudc.env.episode import Episode
    from rudc.evaluation.recording import Recording
    from rudc.evaluation.rollout import run_episode
    from rudc.network.network import load_network
    from rudc.world.world import World

    with World(load_network(scenario.network, scenario.junction)) as world:
        episode = Episode(world)
        recording = Recording(episode, driver)
        record = run_episode(episode, scenario.plan(seed), driver, watch=recording.watch)
        return record, recording.data(record)


def _check(folder: Path, number: int, other: Sequence[str], changes: Sequence[str]) -> str:
    row = f"row {number} of {folder.name}/episodes.csv"
    if not other:
        return f"came out the same as {row}"
    since = f" (since then: {', '.join(changes)})" if changes else ""
    return f"came out otherwise than {row}: {'; '.join(other)}{since}"
