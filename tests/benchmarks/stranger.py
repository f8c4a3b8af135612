"""A stranger's path, timed: from `git clone` with nothing installed to the first replay.

    python -m tests.benchmarks.stranger [--repository URL]

The commands are those of README.md, in its order; what pip downloads comes from the network, not from its
cache. The replay is opened in headless Chromium, where there is one.
"""

from __future__ import annotations

import argparse
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from tests.blocks import blocks_of
from tests.reporting.browser import CHROMIUM, driven

ROOT = Path(__file__).parents[2]
OPENED = "finish({ seconds: document.getElementById('clock').textContent });"


class Step(NamedTuple):
    """One thing that a stranger does."""

    text: str
    """what is there after it"""
    script: str


def steps() -> list[Step]:
    """What README.md tells a stranger to do, after the clone."""
    blocks = [block.text for block in blocks_of(ROOT / "README.md") if block.language == "bash"]
    sweeping = next(text for text in blocks if "rudc table" in text)
    authoring = next(text for text in blocks if "rudc scenario new" in text)
    return [
        Step("set up: `make setup`", "make setup"),
        Step("first table", "\n".join(_lines(sweeping, "rudc sweep", "rudc table"))),
        Step("first replay written", "\n".join(_lines(sweeping, "rudc replay"))),
        Step("own scenario written and validated", "\n".join(_lines(authoring, "rudc scenario"))),
        Step("own scenario swept", "\n".join(_lines(authoring, "rudc sweep"))),
    ]


def _lines(script: str, *starts: str) -> Iterator[str]:
    return (line for line in script.splitlines() if line.startswith(starts))


def main() -> None:
    """Walk the path, and print a table of times."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--repository", default=str(ROOT), help="what is cloned; default: this one")
    repository = parser.parse_args().repository
    with tempfile.TemporaryDirectory() as folder:
        home, clock = Path(folder) / "rudc", Clock()
        env = {**os.environ, "PATH": f"{home / '.venv' / 'bin'}{os.pathsep}{os.environ['PATH']}"}
        env |= {"PIP_NO_CACHE_DIR": "1", "PYTHON": f"{sys.base_prefix}/bin/python3"}
        env.pop("PYTHONPATH", None)
        print("| step | s | s since the beginning | s of processor time |\n|---|---:|---:|---:|")
        clone = Step("`git clone`", f"git clone --quiet '{repository}' '{home}'")
        for step in [clone, *steps()]:
            where = home if home.exists() else Path(folder)
            subprocess.run(["bash", "-euc", step.script], cwd=where, env=env, check=True, stdout=sys.stderr)
            clock.tell(step.text)
        if CHROMIUM is not None:
            page = (home / "replay.html").read_text(encoding="utf-8")
            said = driven(page, OPENED, Path(folder), 1400)
            clock.tell(f"first replay opened in Chromium ({said['seconds']})")


class Clock:
    """Tells of each step how long it took; processor time says what it would on a machine with nothing else
    to do.
    """

    def __init__(self) -> None:
        self._begin = self._last = time.monotonic()
        self._spent = _processor_s()

    def tell(self, step: str) -> None:
        """A line of the table."""
        now, spent = time.monotonic(), _processor_s()
        taken, worked = now - self._last, spent - self._spent
        print(f"| {step} | {taken:.1f} | {now - self._begin:.1f} | {worked:.1f} |", flush=True)
        self._last, self._spent = now, spent


def _processor_s() -> float:
    """s that ended children have spent."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


if __name__ == "__main__":
    main()
