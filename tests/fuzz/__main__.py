"""`make fuzz`: damaged inputs of every sort, and what came of them.

    python -m tests.fuzz [NAME...] [--share 0.01] [--first 0.5] [--seed 0] [--out DIR] [--only 7] [--most-s 2]

Each input is made from its number and the seed alone, so a part of a run can be run, and any input again
(`--only`, which keeps its files in DIR and shows what was said). DIR gets `fuzz.csv`, `fuzz.md`, `bugs.md`.
Exit status 1 where a bug was found.
"""

from __future__ import annotations

import argparse
import csv
import os
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

os.environ["OPENBLAS_NUM_THREADS"] = "1"  # as commands have it; read when numpy is imported

from tests.fuzz import arguments, checkpoints, networks, scenario_files, sweep_folders, trying
from tests.fuzz.fuzzer import Fuzzer
from tests.fuzz.trying import Attempt, attempts

FUZZERS = {
    module.FUZZER.name: module.FUZZER
    for module in (scenario_files, networks, checkpoints, sweep_folders, arguments)
}
SHOWN = 8
"""kinds of bugs said in full"""
HEADINGS = (
    "fuzzer", "inputs", "of", "kinds of mutation", "refused (2)", "valid (0)", "slowest (s)",
    "biggest (MB)", "inputs with bugs",
    "bugs", "seconds",
)  # fmt: skip


def main() -> int:
    """Run what is asked for; the exit status."""
    parser = argparse.ArgumentParser(description="Damaged inputs of every sort, and what comes of them.")
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"of: {', '.join(FUZZERS)}; all by default")
    parser.add_argument("--share", type=float, default=1.0, help="of the inputs of a whole run")
    parser.add_argument("--first", type=float, default=0.0, help="share after which to begin")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--out", type=Path, default=Path("out/fuzz"))
    parser.add_argument(
        "--most-s", type=float, default=trying.MOST_S, help="of processor time; more of it is a bug"
    )
    parser.add_argument(
        "--only", type=int, metavar="N", help="only this input of one fuzzer; its files are kept"
    )
    asked = parser.parse_args()
    trying.MOST_S = asked.most_s
    if unknown := set(asked.names) - set(FUZZERS):
        parser.error(f"no fuzzer {', '.join(sorted(unknown))}; there are {', '.join(FUZZERS)}")
    chosen = [FUZZERS[name] for name in asked.names or FUZZERS]
    asked.out.mkdir(parents=True, exist_ok=True)
    if asked.only is not None:
        return _one(chosen[0], asked.only, asked.seed, asked.out)
    rows, bugs = [], []
    for fuzzer in chosen:
        first, count = round(asked.first * fuzzer.full), max(1, round(asked.share * fuzzer.full))
        began = time.monotonic()
        with tempfile.TemporaryDirectory(prefix="rudc-fuzz-") as folder:
            numbers = range(first, first + count)
            found = list(
                _heard(attempts(fuzzer, numbers, asked.seed, Path(folder), asked.workers), fuzzer, count)
            )
        rows.append(_row(fuzzer, found, time.monotonic() - began))
        bugs += [(fuzzer, attempt) for attempt in found if attempt.bug]
        _write(asked.out, rows, bugs)
    print((asked.out / "fuzz.md").read_text(encoding="utf-8"))
    print((asked.out / "bugs.md").read_text(encoding="utf-8"), end="")
    return int(bool(bugs))


def _heard(found, fuzzer: Fuzzer, count: int):
    """Say how it goes, now and then."""
    said = time.monotonic()
    for done, attempt in enumerate(found, 1):
        if time.monotonic() - said > 20.0 or attempt.bug:
            said = time.monotonic()
            bug = f": input {attempt.number} ({attempt.kind}), {attempt.signature}" if attempt.bug else ""
            print(f"{fuzzer.name}: {done} of {count}{bug}", file=sys.stderr, flush=True)
        yield attempt


def _row(fuzzer: Fuzzer, found: list[Attempt], spent_s: float) -> list[str]:
    statuses, bugs = Counter(a.status for a in found), [a for a in found if a.bug]
    refused = [a for a in found if a.status == 2] or found
    return [
        fuzzer.name, str(len(found)), str(fuzzer.full), str(len({a.kind for a in found if a.kind})),
        str(statuses[2]),
        str(statuses[0]), f"{max(a.cpu_s for a in refused):.2f}", f"{max(a.memory_mb for a in found):.0f}",
        str(len(bugs)),
        str(len({a.signature for a in bugs})), f"{spent_s:.0f}",
    ]  # fmt: skip


def _write(out: Path, rows: list[list[str]], bugs: list[tuple[Fuzzer, Attempt]]) -> None:
    with (out / "fuzz.csv").open("w", encoding="utf-8", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows([HEADINGS, *rows])
    lines = [HEADINGS, ["---"] * len(HEADINGS), *rows]
    (out / "fuzz.md").write_text("".join(f"| {' | '.join(line)} |\n" for line in lines), encoding="utf-8")
    kinds: dict[str, list[tuple[Fuzzer, Attempt]]] = {}
    for fuzzer, attempt in bugs:
        kinds.setdefault(f"{fuzzer.name}: {attempt.signature}", []).append((fuzzer, attempt))
    told = []
    for signature, those in sorted(kinds.items(), key=lambda item: -len(item[1])):
        _, attempt = those[0]
        shown = ", ".join(str(a.number) for _, a in those[:SHOWN])
        said = attempt.said.strip()[-1500:]
        told.append(
            f"## {signature}\n\n{len(those)} inputs: {shown}\n\n"
            f"{' '.join(attempt.command)}: {attempt.bug}\n\n```\n{said}\n```\n"
        )
    (out / "bugs.md").write_text("\n".join(told), encoding="utf-8")


def _one(fuzzer: Fuzzer, number: int, seed: int, out: Path) -> int:
    """Try one input, keep its files, and show all that was said."""
    place = (out / f"{fuzzer.name}-{seed}-{number}").absolute()
    place.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix="rudc-fuzz-") as kept, tempfile.TemporaryDirectory() as tried:
        case = fuzzer.prepare(Path(kept))(fuzzer.randomness(seed, number), place)
        print(f"{place}: {case.kind}; {'; '.join(' '.join(command) for command in case.commands)}")
        (found,) = attempts(fuzzer, [number], seed, Path(tried))
    print(
        f"{found.said}\n{' '.join(found.command)}: status {found.status}, "
        f"{found.cpu_s:.2f} s, {found.memory_mb:.0f} MB"
    )
    print(found.signature if found.bug else "no bug")
    return int(bool(found.bug))


if __name__ == "__main__":
    sys.exit(main())
