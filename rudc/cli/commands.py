"""The commands, and the options that stand before them. Commands import what they need when they run."""

from __future__ import annotations

import re
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

import rudc
from rudc.cli import (
    agent,
    network,
    replay,
    report,
    residual,
    run,
    scenario,
    search,
    study,
    sweep,
    table,
    train,
)


class _Commands(TyperGroup):
    """Says in plain words what is wrong with what was given, and where `--import` must stand."""

    def invoke(self, ctx: Any) -> Any:
        """Run the command."""
        try:
            return super().invoke(ctx)
        except Exception as error:  # typer's errors of usage, which stand elsewhere in each of its versions
            if isinstance(getattr(error, "message", None), str) and hasattr(error, "ctx"):
                error.message = _in_plain_words(error)  # pyright: ignore
            raise


def _in_plain_words(error: Any) -> str:
    """What an error of usage says."""
    from rudc.settings import plainly

    if getattr(error, "option_name", "") == "--import":
        return f"{error.message}; it must stand before the command: rudc --import FILE.py COMMAND ..."
    more = re.fullmatch(r"Got unexpected extra argument\S* \((.*)\)", error.message)
    if more is None or error.ctx is None:
        return plainly(error.message)
    taken = [param for param in error.ctx.command.params if param.param_type_name == "argument"]
    names = " and ".join(f"one {param.metavar or param.name.upper()}" for param in taken)
    return f"`{error.ctx.command_path}` takes {names or 'options only'}; too many: {more[1]}"


app = typer.Typer(
    name="rudc",
    cls=_Commands,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode="markdown",
    context_settings={"help_option_names": ["-h", "--help"]},
    help="A SUMO-backed testbed for safe decision-making at unsignalized intersections.",
)
app.command("sweep")(sweep.sweep)
app.command("search")(search.search)
app.command("run")(run.run)
app.command("replay")(replay.replay)
app.command("report")(report.report)
app.command("table")(table.table)
app.command("train")(train.train)
app.command("study")(study.study)
app.add_typer(scenario.app, name="scenario")
app.add_typer(network.app, name="network")
app.add_typer(agent.app, name="agent")
app.add_typer(residual.app, name="residual")


def _show_version(wanted: bool) -> None:
    if wanted:
        typer.echo(rudc.__version__)
        raise typer.Exit


@app.callback()
def options(
    version: Annotated[
        bool, typer.Option("--version", callback=_show_version, is_eager=True, help="Show the version.")
    ] = False,
    imports: Annotated[
        list[str] | None,
        typer.Option(
            "--import",
            metavar="FILE.py|MODULE",
            help="Python to import first: it may register agents, events and more. Repeat for several.",
        ),
    ] = None,
) -> None:
    """A SUMO-backed testbed for safe decision-making at unsignalized intersections."""
    from rudc.imports import import_first

    for source in imports or []:
        import_first(source)
