"""`rudc study`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from rudc.cli.complete import complete_agents
from rudc.cli.console import (
    TRIED_AGAIN,
    Quiet,
    SweepBar,
    SweepLines,
    note,
    print_table,
    resumable,
    sweep_progress,
    warn,
)
from rudc.cli.options import ResultsFolder, Workers, cores
from rudc.errors import InputError


def study(
    name: Annotated[str, typer.Argument(metavar="NAME", help="A study; `list` says which there are.")],
    folders: Annotated[
        list[Path] | None,
        typer.Argument(metavar="[DIR]...", help="Folders of trainings, for studies of them."),
    ] = None,
    agents: Annotated[
        list[str] | None,
        typer.Option(
            "--agent",
            "-a",
            metavar="NAME",
            help="An agent; repeat for several. Default: for `filter` and `sigma`, rudc-t and rudc-e with "
            "all training seeds (`--budget quick`: rudc-e alone); for `comparison` and `ablation`, where an "
            "agent is a row of their table, all rows; else those that the study is about.",
            autocompletion=complete_agents,
        ),
    ] = None,
    episodes: Annotated[
        int | None,
        typer.Option(
            "--episodes", "-n", min=1, help="Episodes of each scenario and agent. Default: by the budget."
        ),
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the first episode; the others follow.")] = 0,
    workers: Workers = None,
    out: ResultsFolder = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="Finish the study in DIR; start it if there is none.")
    ] = False,
    budget: Annotated[
        Literal["quick", "full", "paper"],
        typer.Option(help="`quick`: few episodes, a part of the settings; minutes. `paper`: the most."),
    ] = "full",
    seeds: Annotated[
        str | None,
        typer.Option(metavar="N,...", help="Training seeds, of studies that train. Default: by the budget."),
    ] = None,
    trainings: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            help="Trainings made before, DIR/NAME-seedN; what is missing is left out, not trained.",
        ),
    ] = None,
    quiet: Quiet = False,
) -> None:
    """Repeat one of the experiments behind the claims: a table (CSV and Markdown) and a figure in DIR.

    `filter` drives N `--episodes` of each of the two tasks, and 2 N more that its out-of-distribution
    scenarios share equally.
    Agents named `NAME-seedN` are pooled with `NAME`: the same algorithm, trained with other seeds.
    Of `comparison` and `ablation`, `--episodes` is for each task, and the budget says how many fewer each
    other scenario gets; rows and training seeds can be added later, with `--resume`. An option that has
    no effect in a study is refused.

    **Examples**

    `rudc study filter --budget quick --out out/filter`

    `rudc study sigma -a rudc-t -a rudc-t-seed1 -a rudc-t-seed2 --out out/sigma --resume`

    `rudc study comparison --budget quick --agent sac --agent rudc-t --out out/comparison`

    `rudc study curves results/checkpoints/rudc-t* --out out/curves`
    """
    from rudc.studies.base import Order
    from rudc.studies.catalogue import STUDIES, find_study

    if name == "list":
        print_table(["study", "what it shows"], [[s.name, s.summary] for s in STUDIES.values()])
        return
    order = Order(
        out or Path(),
        tuple(agents or ()),
        tuple(folders or ()),
        episodes,
        seed,
        workers or cores(),
        resume,
        budget,
        _numbers(seeds),
        trainings,
    )
    chosen = find_study(name, order, workers)
    if out is None:
        raise InputError("where to? give a folder for the results: --out DIR")
    bars: list[SweepBar | SweepLines] = []

    def begin(what: str) -> SweepBar | SweepLines:
        _close(bars)
        note(f"{name}: {what}")
        bars.append(sweep_progress())
        return bars[-1]

    with resumable(out, lambda: _close(bars)):
        report = chosen.run(order, begin)
    typer.echo(report.table, nl=False)
    for text in report.notes:
        note(text)
    names = [str(path.resolve().relative_to(out.resolve())) for path in report.files]
    note(f"in {out}: {', '.join(names)}")
    if report.errors:
        warn(f"some episodes failed, in {len(report.errors)} way(s); the first: {report.errors[0]}")
        warn(TRIED_AGAIN)
        raise typer.Exit(1)


def _numbers(text: str | None) -> tuple[int, ...]:
    if text is None:
        return ()
    from rudc.evaluation.rows import is_whole

    parts = [part.strip() for part in text.split(",")]
    if not all(map(is_whole, parts)):
        raise InputError(f"--seeds {text[:80]!r}: expected numbers with commas between, such as 0,1,2")
    return tuple(dict.fromkeys(map(int, parts)))


def _close(bars: list[SweepBar | SweepLines]) -> None:
    for bar in bars:
        bar.close()
    bars.clear()
