"""`rudc search`."""

from __future__ import annotations

import math
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rudc.cli.complete import complete_agents, complete_scenarios
from rudc.cli.console import Quiet, note, resumable, sweep_progress, warn
from rudc.cli.options import ResultsFolder, Workers, cores, parse_overrides
from rudc.errors import InputError

if TYPE_CHECKING:
    from rudc.evaluation.search.region import Region
    from rudc.evaluation.search.search import Findings


def search(
    source: Annotated[
        str,
        typer.Argument(metavar="SCENARIO", help="Shipped name or file.", autocompletion=complete_scenarios),
    ],
    agents: Annotated[
        list[str],
        typer.Option(
            "--agent",
            "-a",
            metavar="NAME",
            help="The agent. See `rudc agent list`.",
            autocompletion=complete_agents,
        ),
    ],
    over: Annotated[
        list[str] | None,
        typer.Option(
            metavar="KEY=[LOW, HIGH]",
            help="Search over this key, too, all values equally likely. Repeat for several.",
        ),
    ] = None,
    episodes: Annotated[int, typer.Option("--episodes", "-n", min=1, help="Episodes in all.")] = 500,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the first episode; the others follow.")] = 0,
    workers: Workers = None,
    out: ResultsFolder = None,
    resume: Annotated[
        bool,
        typer.Option(
            "--resume", help="Finish the search in DIR, or add episodes to it; start it if there is none."
        ),
    ] = False,
    quiet: Quiet = False,
) -> None:
    """Find the episodes of a scenario in which an agent violates, where sweeps would take thousands.

    The numbers that the scenario draws once an episode are searched over (uniform and normal distributions;
    all else is drawn as usual). A third of the episodes is drawn as declared, the others where gaps are small
    and where violations were found. Each is weighted by how likely it is as declared, which also gives the
    violation rate. DIR gets `evaluations.csv` (all episodes), `failures.csv` (violations), and
    in `failures/` a scenario file for each violation, for `rudc run`. The same seed gives the same rows,
    whatever the workers; Ctrl-C keeps everything finished, and `--resume` goes on from there.

    **Examples**

    `rudc search icy_junction --agent gap-acceptance --episodes 200 --out out/ice`

    `rudc search dense_left_turn --agent planner --over 'traffic.density=[10, 40]' --out out/density`
    """
    from rudc.agents.registry import make_agent
    from rudc.evaluation.limits import EPISODE_LIMIT_S
    from rudc.evaluation.runner import EpisodeRunner
    from rudc.evaluation.search.folder import SearchPlan
    from rudc.evaluation.search.search import run_search
    from rudc.evaluation.search.space import space_of
    from rudc.scenario import load_scenario
    from rudc.scenario.library import overlooked
    from rudc.world.fitting import misfits

    if len(agents) > 1:
        raise InputError(
            f"{len(agents)} agents were named; `rudc search` takes one (search for each, with its own --out)"
        )
    agent = agents[0]
    if out is None:
        raise InputError("where to? give a folder for the results: --out DIR")
    make_agent(agent)
    given = _ranges(parse_overrides(over, "--over"))
    for text in overlooked([source]):
        warn(f"warning: {text}")
    scenario = load_scenario(source, given, misfits, by="--over")
    plan = SearchPlan(scenario, agent, episodes, seed, space_of(scenario, given))
    note(f"over {', '.join(plan.space.axes)}")
    progress = sweep_progress("evaluations.csv")
    with resumable(out, progress.close):
        found = run_search(
            plan,
            out,
            partial(EpisodeRunner, limit_s=EPISODE_LIMIT_S, folder=Path.cwd()),
            workers=workers or cores(),
            resume=resume,
            progress=progress,
        )
    _tell(found, out, scenario.name, agent)


def _ranges(given: dict[str, object]) -> dict[str, object]:
    """`[low, high]` of each key as the distribution it stands for. Raises InputError."""
    for key, value in given.items():
        if not isinstance(value, list) or len(value) != 2:
            raise InputError(f"--over {key}={value}: expected KEY=[LOW, HIGH]")
    return {key: {"uniform": value} for key, value in given.items()}


def _tell(found: Findings, out: Path, scenario: str, agent: str) -> None:
    """Print what was found; leaves with 1 if some episodes could not be run."""
    from rudc.imports import rudc_command

    kinds = ", ".join(f"{count} {kind}" for kind, count in found.kinds.items())
    typer.echo(
        f"violations: {len(found.violations)} of {found.episodes} episodes{': ' if kinds else ''}{kinds}"
    )
    rate = found.rate
    told = f"{_percent(rate.value)} % [{_percent(rate.low)}, {_percent(rate.high)}]"
    if math.isnan(rate.value):
        told = "cannot be told yet, as no episode that counts for it could be run"
    typer.echo(f"violation rate of {scenario} as declared: {told}")
    if rate.ceiling > rate.high:
        typer.echo(
            f"  if they lie only where some were found; wherever they lie, at most {_percent(rate.ceiling)} %"
        )
    if not math.isnan(rate.value):
        typer.echo(
            f"  reckoned from evaluations.csv, from seed {found.counted_from} on: the sum of `weight` over "
            "violations, divided by the number of episodes less the `weight` of those with an error"
        )
    if found.region is not None:
        where = found.region
        typer.echo(f"likeliest where: {where}\n  {_share(where)}")
        seed = found.violations[0]
        file = out / "failures" / f"{scenario}-{seed}.yaml"
        command = rudc_command("run", str(file), "--agent", agent, "--seed", str(seed))
        note(f"the first again: {command}")
    note(f"in {out}: evaluations.csv, failures.csv, failures/, manifest.json")
    if found.errors:
        warn(f"{len(found.errors)} episodes could not be run, and count for nothing; the first:")
        warn(f"  {found.errors[0]}")
        raise typer.Exit(1)


def _share(where: Region) -> str:
    """How many of the violations lie there, and how many of the episodes there violate."""
    lie = f"{where.violations} of the {where.of} violations lie there"
    if where.violations == where.of:
        lie = f"all {where.of} violations lie there" if where.of > 1 else "the only violation lies there"
    return f"{lie}; of the {where.episodes} episodes there, {where.violations} violate"


def _percent(rate: float) -> str:
    return f"{100 * rate:.3g}"
