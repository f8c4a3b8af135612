"""The command `rudc`: its commands put together, and errors turned into one message and an exit status.

0 done, 1 the work failed, 2 the input was wrong, 130 interrupted. Commands import what they need when they
run.
"""

from __future__ import annotations

import contextlib
import errno
import os
import signal
import sys
from types import FrameType
from typing import Annotated

import typer

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
from rudc.errors import RudcError

app = typer.Typer(
    name="rudc",
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


def main() -> None:
    """Run the command line and leave with its exit status."""
    _interrupt_alike()
    try:
        try:
            app(prog_name="rudc")
        finally:
            sys.stdout.flush()
    except RudcError as error:
        print(f"error: {error}", file=sys.stderr)
        sys.exit(error.exit_code)
    except KeyboardInterrupt:
        sys.exit(130)
    except OSError as error:
        if error.errno == errno.ENAMETOOLONG:
            print(f"error: {str(error)[:200]}...: give a shorter path", file=sys.stderr)
            sys.exit(2)
        if not isinstance(error, BrokenPipeError):  # with those, whoever read our output has had enough
            print(f"error: {error}", file=sys.stderr)
        _drop_output()
        sys.exit(1)


def _interrupt_alike() -> None:
    """Let SIGTERM, and SIGHUP of a terminal that closes, do what Ctrl-C does; not where it is ignored
    (nohup)."""

    def interrupt(number: int, _frame: FrameType | None) -> None:
        raise KeyboardInterrupt(signal.Signals(number).name)

    for name in ("SIGTERM", "SIGHUP"):
        number = getattr(signal, name, None)  # no SIGHUP on Windows
        if number is not None and signal.getsignal(number) == signal.SIG_DFL:
            signal.signal(number, interrupt)


def _drop_output() -> None:
    """What is still to be written to stdout cannot be; without this the interpreter would try at its end."""
    with contextlib.suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
