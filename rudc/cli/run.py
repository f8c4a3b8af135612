"""`rudc run`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer

from rudc.cli.complete import complete_agents, complete_scenarios
from rudc.cli.console import Quiet, note
from rudc.cli.replay import MOST
from rudc.cli.scenario import Overrides, parse_overrides
from rudc.errors import InputError

if TYPE_CHECKING:
    from rudc.agents.base import Agent, Decision
    from rudc.drawing.window import Window
    from rudc.env.episode import StepResult
    from rudc.evaluation.record import EpisodeRecord
    from rudc.scenario.model import Scenario
    from rudc.world.scene import Scene


def run(
    source: Annotated[
        str,
        typer.Argument(metavar="SCENARIO", help="Shipped name or file.", autocompletion=complete_scenarios),
    ],
    agents: Annotated[
        list[str] | None,
        typer.Option(
            "--agent",
            "-a",
            help="Who drives; default gap-acceptance. See `rudc agent list`. Twice, with --replay: beside "
            "each other.",
            autocompletion=complete_agents,
        ),
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Which episode.")] = 0,
    video: Annotated[
        Path | None,
        typer.Option(metavar="F.gif|F.webp|F.mp4", help="Film of the episode; .mp4 needs the extra `video`."),
    ] = None,
    replay: Annotated[
        Path | None,
        typer.Option(metavar="F.html", help="A page to look at the episode in, for any browser, offline."),
    ] = None,
    steps: Annotated[
        Path | None, typer.Option(metavar="F.csv", help="Every decision: action, filter, gap, reward terms.")
    ] = None,
    fcd: Annotated[
        Path | None,
        typer.Option(metavar="F.xml", help="SUMO's floating car data: all vehicles at every step."),
    ] = None,
    gui: Annotated[
        bool, typer.Option("--gui", help="Show it in a window as it happens (needs pygame).")
    ] = False,
    overrides: Overrides = None,
    quiet: Quiet = False,
) -> None:
    """Run one episode and say how it went.

    **Examples**

    `rudc run blocked_left_turn --agent gap-acceptance+ttcbf --seed 3 --video blocked.gif`

    `rudc run blocked_left_turn -a follower -a follower+ttcbf --seed 3 --replay both.html`

    `rudc run random_destination --set traffic.density=40 --steps steps.csv`
    """
    from rudc.agents.registry import make_agent
    from rudc.drawing.picture_file import check_film
    from rudc.reporting.html.page import check_page
    from rudc.reporting.replay.page import WHAT, save_replay
    from rudc.scenario import load_scenario
    from rudc.world.fitting import misfits

    drivers = [make_agent(name) for name in agents or ["gap-acceptance"]]
    _check_several(len(drivers), {"--video": video, "--steps": steps, "--fcd": fcd, "--gui": gui}, replay)
    scenario = load_scenario(source, parse_overrides(overrides), misfits)
    if video is not None:
        check_film(video)
    if replay is not None:
        check_page(replay, WHAT)
    files = _Files(video, steps, fcd, gui, replay is not None)
    pages = [_drive(scenario, seed, driver, files) for driver in drivers]
    if replay is not None:
        save_replay(replay, pages)
    for written in (video, replay, steps, fcd):
        if written is not None:
            note(f"{written} written")


class _Files(NamedTuple):
    """What an episode leaves besides its row."""

    video: Path | None
    steps: Path | None
    fcd: Path | None
    gui: bool
    replay: bool


def _check_several(agents: int, single: dict[str, Path | bool | None], replay: Path | None) -> None:
    """Raise InputError for several agents where there can be one."""
    if agents == 1:
        return
    if agents > MOST or replay is None:
        raise InputError(
            f"{agents} agents were named; `rudc run` takes one, or two with --replay F.html (for more, see "
            "`rudc sweep`)"
        )
    given = [name for name, value in single.items() if value]
    if given:
        raise InputError(f"{given[0]} shows one agent, and {agents} were named")


def _drive(scenario: Scenario, seed: int, driver: Agent, files: _Files) -> dict[str, Any]:
    """Drive an episode, say how it went, write films and tables; its recording if there is to be a replay."""
    from rudc.env.episode import Episode
    from rudc.evaluation.film import Film
    from rudc.evaluation.recording import Recording
    from rudc.evaluation.rollout import run_episode
    from rudc.evaluation.trace import Trace
    from rudc.files import make_folder_of
    from rudc.network.network import load_network
    from rudc.world.events import event_lines
    from rudc.world.world import World

    if files.fcd is not None:
        make_folder_of(files.fcd)
    options = ("--fcd-output", str(files.fcd.absolute())) if files.fcd is not None else ()
    with World(load_network(scenario.network, scenario.junction)) as world:
        episode = Episode(world)
        trace, recording = Trace(), Recording(episode, driver)
        window = _window(scenario.name, world.config.decision_s) if files.gui else None
        film = Film(episode, driver.name, window)
        watchers = [trace.watch]
        if files.gui or files.video is not None:
            watchers.append(film.watch)
        if files.replay:
            watchers.append(recording.watch)

        def watch(scene: Scene, decision: Decision, result: StepResult) -> None:
            for watcher in watchers:
                watcher(scene, decision, result)

        record = run_episode(episode, scenario.plan(seed), driver, options=options, watch=watch)
        events = event_lines(world.plan, world.happenings())
        page = recording.data(record) if files.replay else {}
    _show(record)
    for line in events:
        typer.echo(f"event {line}")
    if files.steps is not None:
        trace.save(files.steps)
    if files.video is not None:
        film.save(files.video)
    return page


def _window(title: str, decision_s: float) -> Window:
    from rudc.drawing.window import Window

    return Window(title, 1.0 / decision_s)


def _show(record: EpisodeRecord) -> None:
    from rudc.evaluation.columns import COLUMNS

    rows = list(zip(COLUMNS, record.row(), strict=True))
    width = max(len(name) for name, _ in rows)
    for name, text in rows:
        if text:
            typer.echo(f"{name.ljust(width)}  {text}")
