"""`rudc run`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rudc.cli.complete import complete_agents, complete_scenarios
from rudc.cli.console import note
from rudc.cli.scenario import Overrides, parse_overrides

if TYPE_CHECKING:
    from rudc.agents.base import Decision
    from rudc.drawing.window import Window
    from rudc.env.episode import StepResult
    from rudc.evaluation.record import EpisodeRecord
    from rudc.world.scene import Scene


def run(
    source: Annotated[
        str,
        typer.Argument(metavar="SCENARIO", help="Shipped name or file.", autocompletion=complete_scenarios),
    ],
    agent: Annotated[
        str,
        typer.Option(
            "--agent", "-a", help="Who drives. See `rudc agent list`.", autocompletion=complete_agents
        ),
    ] = "gap-acceptance",
    seed: Annotated[int, typer.Option(min=0, help="Which episode.")] = 0,
    video: Annotated[
        Path | None,
        typer.Option(metavar="F.gif|F.mp4", help="Film of the episode; .mp4 needs the extra `video`."),
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
) -> None:
    """Run one episode and say how it went.

    **Examples**

    `rudc run blocked_left_turn --agent gap-acceptance+ttcbf --seed 3 --video blocked.gif`

    `rudc run random_destination --set traffic.density=40 --steps steps.csv`
    """
    from rudc.agents.registry import make_agent
    from rudc.drawing.picture_file import check_film
    from rudc.env.episode import Episode
    from rudc.evaluation.film import Film
    from rudc.evaluation.rollout import run_episode
    from rudc.evaluation.trace import Trace
    from rudc.network.network import load_network
    from rudc.scenario import load_scenario
    from rudc.world.events import event_lines
    from rudc.world.fitting import misfits
    from rudc.world.world import World

    driver = make_agent(agent)
    scenario = load_scenario(source, parse_overrides(overrides), misfits)
    if video is not None:
        check_film(video)
    options = ("--fcd-output", str(fcd.absolute())) if fcd is not None else ()
    with World(load_network(scenario.network, scenario.junction)) as world:
        episode = Episode(world)
        trace = Trace()
        film = Film(episode, driver.name, _window(scenario.name, world.config.decision_s) if gui else None)

        def watch(scene: Scene, decision: Decision, result: StepResult) -> None:
            trace.watch(scene, decision, result)
            if gui or video is not None:
                film.watch(scene, decision, result)

        record = run_episode(episode, scenario.plan(seed), driver, options=options, watch=watch)
        events = event_lines(world.plan, world.happenings())
    _show(record)
    for line in events:
        typer.echo(f"event {line}")
    if steps is not None:
        trace.save(steps)
    if video is not None:
        film.save(video)
    for written in (video, steps, fcd):
        if written is not None:
            note(f"{written} written")


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
