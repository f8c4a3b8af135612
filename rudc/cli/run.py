"""`rudc run`."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer

from rudc.cli.complete import complete_agents, complete_scenarios
from rudc.cli.console import AsJson, Quiet, note, note_sweep, print_json, warn
from rudc.cli.options import Overrides, parse_overrides
from rudc.cli.replay import MOST
from rudc.errors import AgentFailedError, InputError, StorageError

if TYPE_CHECKING:
    from rudc.agents.base import Agent, Decision
    from rudc.env.episode import Episode, StepResult
    from rudc.evaluation.record import EpisodeRecord
    from rudc.evaluation.rollout import Watcher
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
        Path | None,
        typer.Option(
            metavar="F.csv",
            help="Every decision: action, filter, gap, reward terms, and the state at its start; x_m and y_m "
            "from the junction's centre. AES takes the speed after each decision, so it differs a little "
            "from the mean of speed_mps.",
        ),
    ] = None,
    fcd: Annotated[
        Path | None,
        typer.Option(
            metavar="F.xml",
            help="SUMO's floating car data, from the warm-up on: what SUMO drives, and the EV.",
        ),
    ] = None,
    gui: Annotated[
        bool,
        typer.Option(
            "--gui",
            help="Show it as it happens: in sumo-gui, which follows the ego (extra `networks`); "
            "where that is not installed, in a window of our own (extra `window`).",
        ),
    ] = False,
    overrides: Overrides = None,
    as_json: AsJson = False,
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
    from rudc.files import check_place
    from rudc.reporting.html.page import check_page
    from rudc.reporting.replay.page import WHAT, save_replay
    from rudc.scenario import load_scenario
    from rudc.scenario.library import overlooked
    from rudc.tracebacks import own_traceback
    from rudc.world.fitting import misfits

    drivers = [make_agent(name) for name in agents or ["gap-acceptance"]]
    _check_several(len(drivers), {"--video": video, "--steps": steps, "--fcd": fcd, "--gui": gui}, replay)
    for text in overlooked([source]):
        warn(f"warning: {text}")
    scenario = load_scenario(source, parse_overrides(overrides), misfits, by="--set")
    note_sweep(scenario)
    if video is not None:
        check_film(video)
    if replay is not None:
        check_page(replay, WHAT)
    if steps is not None:
        check_place(steps, "a table of decisions", ".csv")
    if fcd is not None:
        check_place(fcd, "SUMO's floating car data", ".xml", ".xml.gz", ".csv", ".parquet")
        _refuse_colon(fcd)
    _refuse_one_for_two({"--video": video, "--replay": replay, "--steps": steps, "--fcd": fcd})
    files = _Files(video, steps, fcd, gui, replay is not None)
    driven = [_drive(scenario, seed, driver, files) for driver in drivers]
    if as_json:
        print_json([{**one.record.values, "events": one.events} for one in driven])
    else:
        for one in driven:
            _show(one)
    begun = all(one.begun for one in driven)
    if replay is not None and begun:
        save_replay(replay, [one.page for one in driven])
    for written in (video, replay, steps, fcd):
        if written is not None and begun:
            note(f"{written} written")
    for one in driven:
        if one.failure is not None:
            if said := own_traceback(one.failure.__cause__ or one.failure):
                warn(said.rstrip())
            raise one.failure


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


def _refuse_colon(fcd: Path) -> None:
    """Raise InputError for a path that SUMO would take for a host and a port."""
    place = fcd.absolute()
    if ":" in str(place.relative_to(place.anchor)):  # Windows has one in the anchor
        raise InputError(f"--fcd: SUMO cannot write to {place}, which has a colon in it; name another place")


def _refuse_one_for_two(outputs: dict[str, Path | None]) -> None:
    """Raise InputError if two outputs would be written to one file; devices may take several."""
    from rudc.files import past_links

    taken: dict[Path, str] = {}
    for option, path in outputs.items():
        if path is None or (path.exists() and not path.is_file()):
            continue
        other = taken.setdefault(past_links(path), option)
        if other != option:
            raise InputError(f"{other} and {option} both name {path}: give each a file of its own")


class _Driven(NamedTuple):
    """An episode that was run."""

    record: EpisodeRecord
    failure: AgentFailedError | None
    """what the agent raised on the way; the rest is what came before"""
    events: list[str]
    """what became of each"""
    page: dict[str, Any]
    """its recording; empty if there is to be no replay"""
    begun: bool = True
    """whether the agent decided anything; if not, there is nothing to be written but `record`"""


def _drive(scenario: Scenario, seed: int, driver: Agent, files: _Files) -> _Driven:
    """Drive an episode, and write films and tables of it."""
    from rudc.env.episode import Episode
    from rudc.evaluation.film import Film
    from rudc.evaluation.record import EpisodeRecord
    from rudc.evaluation.recording import Recording
    from rudc.evaluation.rollout import run_until_failure
    from rudc.evaluation.trace import Trace
    from rudc.files import make_folder_of
    from rudc.network.network import load_network
    from rudc.world.events import event_lines
    from rudc.world.world import World

    if files.fcd is not None:
        make_folder_of(files.fcd)
    options = ("--fcd-output", str(files.fcd.absolute())) if files.fcd is not None else ()
    with ExitStack() as ends, World(load_network(scenario.network, scenario.junction)) as world:
        episode = Episode(world)
        trace, recording = Trace(driver.ego_driver), Recording(episode, driver)
        film = Film(episode, driver.name)
        watchers: list[Watcher] = []
        if files.steps is not None:
            watchers.append(trace.watch)
        if files.video is not None:
            watchers.append(film.watch)
        if files.gui:
            watchers.append(_gui(episode, scenario.name, driver.name, ends))
        if files.replay:
            watchers.append(recording.watch)

        def watch(scene: Scene, decision: Decision, result: StepResult) -> None:
            for watcher in watchers:
                watcher(scene, decision, result)

        plan = scenario.plan(seed)
        try:
            record, failure = run_until_failure(episode, plan, driver, options=options, watch=watch)
        except AgentFailedError as error:
            record = EpisodeRecord.failed(plan.scenario, driver.name, seed, str(error))
            if files.fcd is not None:
                files.fcd.unlink(missing_ok=True)  # of an episode that has not begun
            return _Driven(record, error, event_lines(world.plan, world.happenings()), {}, begun=False)
        events = event_lines(world.plan, world.happenings())
        page = recording.data(record) if files.replay else {}
    if files.fcd is not None:
        _refuse_torn(files.fcd)
    if files.steps is not None:
        trace.save(files.steps)
    if files.video is not None:
        film.save(files.video)
    return _Driven(record, failure, events, page)


def _refuse_torn(fcd: Path) -> None:
    """Raise StorageError for a file of SUMO's that has no end: SUMO does not report a full disk. A .csv that
    stops between two lines looks whole.
    """
    xml = b"</fcd-export>\n"
    end = {"": xml, ".xml": xml, ".csv": b"\n", ".parquet": b"PAR1"}.get(fcd.suffix.lower())
    if end is not None and fcd.is_file():
        with fcd.open("rb") as file:
            file.seek(max(fcd.stat().st_size - len(end), 0))
            if file.read() != end:
                raise StorageError(f"cannot write {fcd}: it stops in the middle; is the disk full?")


def _gui(episode: Episode, scenario: str, agent: str, ends: ExitStack) -> Watcher:
    """A watcher that shows an episode: in sumo-gui if it is installed, else in a window of our own. `ends`
    closes it."""
    from rudc.drawing.sumo_gui import SumoGui
    from rudc.drawing.view import view_of
    from rudc.drawing.window import Window
    from rudc.evaluation.film import Film
    from rudc.network.build import find_program

    world, program = episode.world, find_program("sumo-gui")
    rate = 1.0 / world.config.decision_s
    if program is None:
        window = Window(scenario, rate)
        ends.callback(window.close)
        return Film(episode, agent, window).watch
    shown = SumoGui(program, world.network.path, rate)
    ends.callback(shown.close)
    return lambda _scene, _decision, result: shown.show(view_of(world, result.outcome))


def _show(driven: _Driven) -> None:
    from rudc.evaluation.columns import COLUMNS

    rows = list(zip(COLUMNS, driven.record.row(), strict=True))
    width = max(len(name) for name, _ in rows)
    for name, text in rows:
        if text:
            typer.echo(f"{name.ljust(width)}  {text}")
    for line in driven.events:
        typer.echo(f"event {line}")
