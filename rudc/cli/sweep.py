"""`rudc sweep`."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rudc.cli.complete import complete_agents, complete_scenarios
from rudc.cli.console import TRIED_AGAIN, Quiet, SweepBar, SweepLines, note, resumable, sweep_progress, warn
from rudc.cli.options import LiveReport, ResultsFolder, Workers, cores, parse_overrides
from rudc.cli.verify import verify_folder
from rudc.errors import InputError
from rudc.evaluation.limits import EPISODE_LIMIT_S
from rudc.hints import listed

if TYPE_CHECKING:
    from rudc.evaluation.record import EpisodeRecord
    from rudc.evaluation.sweep import SweepResult
    from rudc.evaluation.tasks import SweepPlan, Task
    from rudc.scenario.model import Scenario

SHIPPED_AGENTS = (
    "sumo",
    "follower",
    "gap-acceptance",
    "gap-acceptance+ttcbf",
    "planner",
    "rudc-wo-cbf",
    "rudc-t",
    "rudc-e",
)
"""drivers of `--shipped` when none are named"""


def sweep(
    scenarios: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="SCENARIO...",
            help="Shipped names, files, or patterns of either: `'*left*'`, `'my*.yaml'`.",
            autocompletion=complete_scenarios,
        ),
    ] = None,
    agents: Annotated[
        list[str] | None,
        typer.Option(
            "--agent",
            "-a",
            metavar="NAME",
            help="An agent; repeat for several. See `rudc agent list`.",
            autocompletion=complete_agents,
        ),
    ] = None,
    episodes: Annotated[
        int | None,
        typer.Option(
            "--episodes",
            "-n",
            min=1,
            help="Episodes of each scenario, swept value and agent; 100 by default.",
        ),
    ] = None,
    seed: Annotated[
        int | None,
        typer.Option(
            min=0,
            help="Seed of the first episode; the others follow, the same for each agent; 0 by default.",
        ),
    ] = None,
    workers: Workers = None,
    out: ResultsFolder = None,
    overrides: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="KEY=VALUE|LIST",
            help="Another value at a dotted key of all scenarios; each value of a list is run. Repeat: grid.",
        ),
    ] = None,
    engine: Annotated[
        str, typer.Option(metavar="NAME", help="`local`: processes here; `ray`: actors of a ray cluster.")
    ] = "local",
    resume: Annotated[
        bool,
        typer.Option(
            "--resume",
            help="Finish the sweep in DIR, or add episodes, agents or scenarios to it; start it if there is "
            "none. SCENARIO and --agent need not be given again.",
        ),
    ] = False,
    shipped: Annotated[
        bool,
        typer.Option("--shipped", help="All shipped scenarios; with all kinds of drivers if none are named."),
    ] = False,
    limit: Annotated[
        float,
        typer.Option(
            "--episode-limit", min=1.0, metavar="S", help="Wall time after which an episode is given up."
        ),
    ] = EPISODE_LIMIT_S,
    verify: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Run a sample of a finished sweep's episodes again, and compare."),
    ] = None,
    share: Annotated[
        float | None,
        typer.Option(
            metavar="X",
            help="With --verify: share of the episodes to run again, drawn by --seed; 0.05 by default.",
        ),
    ] = None,
    report: LiveReport = False,
    as_json: Annotated[
        bool, typer.Option("--json", help="The table at the end as JSON, as `rudc table --json` writes it.")
    ] = False,
    quiet: Quiet = False,
) -> None:
    """Run scenarios x agents x seeds in parallel, into a folder of CSV files.

    DIR gets `episodes.csv` (a row an episode, written as each ends), `metrics.csv` (a row for each scenario,
    agent and swept value) and `manifest.json`. The rows depend neither on the number of workers nor on the
    engine. Ctrl-C keeps everything finished; `--resume` goes on from there, after any kill.

    **Examples**

    `rudc sweep dense_left_turn --agent gap-acceptance --episodes 20 --out out/first`

    `rudc sweep dense_left_turn -a rudc-t --set 'traffic.density=[10, 20, 30]' --out out/density`

    `rudc sweep dense_left_turn -a sumo -a rudc-t --report --out out/live`, and open `out/live/report.html`

    `rudc sweep random_destination '*left*' my.yaml -a sumo -a gap-acceptance+ttcbf -w 8 -o out/all --resume`

    `rudc sweep --resume --out out/all --workers 4`: goes on with what that folder holds

    `rudc sweep --resume --out out/all --agent rudc-e`: adds an agent to it

    `rudc sweep --verify out/all --share 0.1`: do its rows come out the same here? Exit status 1 if not
    """
    from rudc.evaluation.runner import EpisodeRunner
    from rudc.evaluation.sweep import run_sweep
    from rudc.scenario import shipped_scenarios

    if verify is not None:
        given = {
            "SCENARIO": scenarios,
            "--agent": agents,
            "--out": out,
            "--set": overrides,
            "--episodes": episodes,
            "--engine": engine != "local",
            "--resume": resume,
            "--shipped": shipped,
            "--report": report,
            "--json": as_json,
        }
        others = [name for name, value in given.items() if value]
        verify_folder(verify, others, share, seed or 0, workers, limit)
        return
    if share is not None:
        raise InputError("--share says how much of a sweep --verify DIR runs again; there is no --verify")
    values, named, drivers = parse_overrides(overrides), scenarios or [], agents or []
    if shipped:
        named, drivers = [*shipped_scenarios(), *named], drivers or list(SHIPPED_AGENTS)
    if resume and out is not None and (out / "manifest.json").exists():
        plan = _grown_plan(out, named, drivers, episodes, seed, values)
    elif resume and out is not None and not (named and drivers):
        missing = "agents" if named else "scenarios"
        how = "at least one --agent NAME" if named else "names, files or patterns"
        raise InputError(f"which {missing}? {out} holds no sweep to go on with; give {how}")
    else:
        plan = _plan(named, drivers, episodes or 100, seed or 0, values)
    if out is None:
        raise InputError("where to? give a folder for the results: --out DIR")
    progress = _Reported(sweep_progress(), out) if report else sweep_progress()
    with resumable(out, progress.close):
        result = run_sweep(
            plan,
            out,
            partial(EpisodeRunner, limit_s=limit, folder=Path.cwd()),
            workers=workers or cores(),
            engine=engine,
            resume=resume,
            limit_s=limit,
            progress=progress,
        )
    _report(result, as_json)


class _Reported:
    """A progress, with a page that is kept fresh beside it."""

    def __init__(self, inner: SweepBar | SweepLines, folder: Path) -> None:
        from rudc.reporting.report.live import LivePage

        self._inner, self._page, self._begun = inner, LivePage(folder), False

    def begin(self, total: int, finished: int, warnings: Sequence[str]) -> None:
        """Say what there is to do, and where the page is."""
        self._begun = True
        self._inner.begin(total, finished, warnings)
        note(f"live page: {self._page.path}")

    def advance(self, task: Task, record: EpisodeRecord) -> None:
        """Count an episode."""
        self._inner.advance(task, record)
        self._page.refresh()

    def close(self) -> None:
        """Write the page for the last time, once, if there is anything to write."""
        self._inner.close()
        if self._begun:
            self._begun = False
            self._page.finish()
            if self._page.problem:
                warn(f"warning: no report: {self._page.problem}")


def _plan(
    scenarios: list[str],
    agents: list[str],
    episodes: int,
    seed: int,
    overrides: dict[str, object],
) -> SweepPlan:
    from rudc.evaluation.tasks import SweepPlan

    if not scenarios:
        raise InputError(
            "which scenarios? give names, files or patterns, or --shipped; see `rudc scenario list`"
        )
    if not agents:
        raise InputError("which agents? give at least one --agent NAME; see `rudc agent list`")
    each = _agents(agents)
    return SweepPlan(tuple(_scenarios(scenarios, overrides)), each, episodes, seed)


def _agents(names: list[str]) -> tuple[str, ...]:
    """Each once; made once, so that an unknown one is refused."""
    from rudc.agents.registry import make_agent

    for name in names:
        make_agent(name)
    _warn_of_repeated("--agent", names)
    return tuple(dict.fromkeys(names))


def _scenarios(names: list[str], overrides: dict[str, object]) -> list[Scenario]:
    from rudc.evaluation.preflight import never_happening
    from rudc.scenario import find_scenarios
    from rudc.scenario.library import given_twice, overlooked
    from rudc.world.fitting import misfits

    for text in overlooked(names):
        warn(f"warning: {text}")
    found = find_scenarios(names, misfits, overrides=overrides, by="--set")
    for scenario in found:
        for text in never_happening(scenario):
            warn(f"warning: {scenario.name}: {text}")
    _warn_of_repeated("SCENARIO", names)
    for text in given_twice(names):
        warn(f"warning: {text}")
    return found


def _warn_of_repeated(what: str, given: list[str]) -> None:
    if twice := [name for name in dict.fromkeys(given) if given.count(name) > 1]:
        warn(f"warning: {what} names {', '.join(twice)} more than once; each counts once")


def _grown_plan(
    folder: Path,
    scenarios: list[str],
    agents: list[str],
    episodes: int | None,
    seed: int | None,
    overrides: dict[str, object],
) -> SweepPlan:
    """The plan of the sweep in a folder, with what is given besides."""
    from rudc.evaluation.kept import kept_plan, with_more

    if overrides and not scenarios:
        raise InputError(
            f"--set changes the scenarios of a command, not those of {folder}: name scenarios, or drop it"
        )
    each = _agents(agents)
    kept = kept_plan(folder, episodes, seed)
    plan = with_more(kept, _scenarios(scenarios, overrides) if scenarios else (), each)
    new = [s.name for s in plan.scenarios if s.name not in {old.name for old in kept.scenarios}]
    new += [agent for agent in plan.agents if agent not in kept.agents]
    if new:
        note(f"adding {listed(new)} to the sweep in {folder}")
    return plan


def _report(result: SweepResult, as_json: bool) -> None:
    from rudc.cli.metrics_table import print_metrics
    from rudc.evaluation.folder import TRACEBACK, sweep_rows
    from rudc.evaluation.tables import make_table, measured

    rows = sweep_rows(result.folder)
    by = ["scenario", *rows.parameters, "agent"]
    if as_json:
        typer.echo(make_table(rows, by, "json"), nl=False)
    else:
        groups = measured(rows, by)
        print_metrics(groups, by)
        if len(groups) > len({group.key[-1] for group in groups}):
            typer.echo("")  # and over all scenarios together
            print_metrics(measured(rows, ["agent"]), ["agent"])
    note(f"in {result.folder}: episodes.csv, metrics.csv, manifest.json")
    if result.errors:
        episodes = sum(len(block["seed"]) for block in rows.blocks())
        kinds = dict.fromkeys(row["error"].partition(TRACEBACK)[0] for row in result.errors)
        warn(f"{len(result.errors)} of {episodes} episodes failed, in {len(kinds)} way(s); the first:")
        warn(f"  {result.errors[0]['error']}")
        warn(TRIED_AGAIN)
        raise typer.Exit(1)
