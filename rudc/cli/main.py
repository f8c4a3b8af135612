"""The command `rudc`: errors turned into one message and an exit status.

0 done, 1 the work failed, 2 the input was wrong, 130 interrupted. Worker processes import the file that was
run, and this with it, so what the commands need is imported in `main`.
"""

from __future__ import annotations

import contextlib
import errno
import io
import os
import signal
import sys
from types import FrameType
from typing import TextIO

from rudc.errors import RudcError


def main() -> None:
    """Run the command line and leave with its exit status."""
    _interrupt_alike()
    _spell_out(sys.stdout)
    _drop_odd_sizes()
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # for arrays this small, more gain nothing
    try:
        try:
            sys.argv[1:] = map(_with_home, sys.argv[1:])
            _workers_first()
            from rudc.cli.commands import app

            app(prog_name="rudc")
        finally:
            sys.stdout.flush()
    except RudcError as error:
        print(f"error: {error}", file=sys.stderr)
        sys.exit(error.exit_code)
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        sys.exit(130)
    except SystemExit as ended:
        if isinstance(getattr(ended.__context__, "__cause__", None), KeyboardInterrupt):
            print("interrupted", file=sys.stderr)  # nobody took it but typer, who says nothing
        raise
    except OSError as error:
        if error.errno == errno.ENAMETOOLONG:
            print(f"error: {str(error)[:200]}...: give a shorter path", file=sys.stderr)
            sys.exit(2)
        if not isinstance(error, BrokenPipeError):  # else the reader of our output has stopped reading
            print(f"error: {error}", file=sys.stderr)
        _drop_output()
        sys.exit(1)


def _with_home(argument: str) -> str:
    """An argument with the home folder in the place of a `~` that the shell left, as it does in quotes and
    behind `--out=`."""
    option, sign, path = argument.partition("=") if argument.startswith("--") else ("", "", argument)
    return option + sign + (os.path.expanduser(path) if path.startswith("~") else path)


def _workers_first() -> None:
    """If the command will need workers, have what they need imported while this process checks the
    command."""
    given = sys.argv[1:]
    drives = given[:1] in (["sweep"], ["train"], ["study"], ["search"])
    if drives and "ray" not in given and any(a.startswith(("-o", "--out")) for a in given):
        from rudc.evaluation.starting import prepare

        prepare()


def _interrupt_alike() -> None:
    """Let SIGTERM, and SIGHUP of a terminal that closes, do what Ctrl-C does; not where it is ignored
    (nohup)."""

    def interrupt(number: int, _frame: FrameType | None) -> None:
        raise KeyboardInterrupt(signal.Signals(number).name)

    for name in ("SIGTERM", "SIGHUP"):
        number = getattr(signal, name, None)  # no SIGHUP on Windows
        if number is not None and signal.getsignal(number) == signal.SIG_DFL:
            signal.signal(number, interrupt)


def _spell_out(stream: TextIO) -> None:
    """Write signs that the stream's encoding lacks as stderr does (`\\u2191`), unless users say otherwise."""
    if isinstance(stream, io.TextIOWrapper) and stream.errors == "strict":
        stream.reconfigure(errors="backslashreplace")


def _drop_odd_sizes() -> None:
    """Pass over COLUMNS and LINES that are no size of a screen: rich fails at some digits, and at 0 shows
    nothing.
    """
    for name in ("COLUMNS", "LINES"):
        said = os.environ.get(name, "")
        if not (said.isascii() and said.isdigit() and len(said) < 6 and int(said) > 0):
            os.environ.pop(name, None)


def _drop_output() -> None:
    """Discard what cannot be written to stdout any more; else the interpreter would try again at its end."""
    with contextlib.suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
