"""Damaged folders of sweeps: table, report, replay, verify and resume."""

from __future__ import annotations

import json
import random
import shutil
from collections.abc import Callable
from pathlib import Path

from tests.fuzz.fuzzer import Case, Command, Fuzzer
from tests.fuzz.mutations import (
    NUMBERS,
    another_number,
    another_word,
    changed_tree,
    instead,
    scratched_bytes,
    scratched_text,
)
from tests.fuzz.swept import SWEEP, finished_sweep

COMMANDS: tuple[Command, ...] = (
    ("table", "swept"),
    ("table", "swept", "--by", "agent,ego.speed", "--format", "markdown"),
    ("table", "swept", "--json"),
    ("report", "swept", "--replays", "0"),
    ("replay", "swept", "--episode", "1", "--out", "replay.html"),
    ("replay", "swept", "--episode", "own:follower:1", "--out", "replay.html"),
    ("sweep", "--verify", "swept", "--share", "0.2"),
    (*SWEEP, "--resume"),
)
CELLS = (
    *NUMBERS,
    "banana",
    "success",
    "frozen",
    "None",
    "own",
    "follower",
    "sumo",
    '"',
    "a,b",
    "=1+1",
    "\U0001f697",
    "x" * 5000,
)


def prepare(folder: Path) -> Callable[[random.Random, Path], Case]:
    """Of one small sweep, with a network and an agent of its own, and episodes that failed."""
    made = finished_sweep(folder)

    def make(rng: random.Random, place: Path) -> Case:
        shutil.copytree(made, place, dirs_exist_ok=True)
        kind = rng.choice(tuple(_DEEDS))
        _DEEDS[kind](rng, place / "swept")
        return Case(kind, rng.sample(COMMANDS, 2))

    return make


def _text(name: str, *deeds: Callable[[random.Random, str], str]) -> Callable[[random.Random, Path], None]:
    def change(rng: random.Random, folder: Path) -> None:
        path = folder / name
        path.write_bytes(rng.choice(deeds)(rng, path.read_text(encoding="utf-8")).encode("utf-8", "replace"))

    return change


def _bytes(rng: random.Random, folder: Path) -> None:
    path = rng.choice(sorted(path for path in folder.rglob("*") if path.is_file()))
    path.write_bytes(scratched_bytes(rng, path.read_bytes()))


def _tree(rng: random.Random, folder: Path) -> None:
    path = folder / "manifest.json"
    tree = json.loads(path.read_text(encoding="utf-8"))
    path.write_text(json.dumps(changed_tree(rng, tree, [tree])), encoding="utf-8")


def _cell(rng: random.Random, text: str) -> str:
    """A table with one to three cells replaced, by something wild or by another of the column."""
    rows = [line.split(",") for line in text.split("\n")]
    for _ in range(rng.choice((1, 1, 3))):
        row = rng.choice(rows)
        column = rng.randrange(len(row))
        others = [other[column] for other in rows if column < len(other)]
        row[column] = rng.choice((rng.choice(CELLS), rng.choice(others)))
    return "\n".join(map(",".join, rows))


def _column(rng: random.Random, text: str) -> str:
    """A table with a column removed, doubled or moved."""
    rows = [line.split(",") for line in text.split("\n")]
    at, to = rng.randrange(len(rows[0])), rng.randrange(len(rows[0]))
    deed = rng.choice(("remove", "double", "move"))
    for row in rows:
        if len(row) > max(at, to):
            cell = row[at] if deed == "double" else row.pop(at)
            if deed != "remove":
                row.insert(to, cell)
    return "\n".join(map(",".join, rows))


def _files(rng: random.Random, folder: Path) -> None:
    """A file or folder that is missing, empty, of the other sort, or a link to itself; or one too many."""
    path = rng.choice(sorted(folder.rglob("*")))
    if path.is_dir():
        shutil.rmtree(path)
    else:
        path.unlink()
    deed = rng.choice(("missing", "empty", "folder", "loop", "null", "conditions"))
    instead(path, deed)
    if deed == "conditions":
        (folder / "conditions.csv").write_text(
            rng.choice(("", "scenario,agent,seed\n", "a\nb\n", "scenario,x\nown,1\n"))
        )


_ROWS = "episodes.csv"
_DEEDS: dict[str, Callable[[random.Random, Path], None]] = {
    "manifest: values": _tree,
    "manifest: text": _text("manifest.json", scratched_text, another_number, another_word),
    "rows: cells": _text(_ROWS, _cell),
    "rows: text": _text(_ROWS, scratched_text, scratched_text, another_number, another_word),
    "rows: columns": _text(_ROWS, _column),
    "metrics": _text("metrics.csv", _cell, scratched_text, _column),
    "bytes": _bytes,
    "files": _files,
}
FUZZER = Fuzzer("sweep folders", 5_000, prepare)
