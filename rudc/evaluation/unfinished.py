"""What a sweep's folder lacks of the episodes that were asked for, as its manifest says."""

from __future__ import annotations

import math
import os
from collections.abc import Collection, Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from rudc.errors import SweepError
from rudc.evaluation.columns import IDENTITY
from rudc.evaluation.manifest import FORMAT, read_manifest
from rudc.evaluation.record import as_text
from rudc.evaluation.rows import is_whole
from rudc.evaluation.store import one_line, table_blocks
from rudc.hints import listed
from rudc.imports import rudc_command

_LISTED = 4
"""names listed at most"""


class Asked(NamedTuple):
    """What a sweep consists of."""

    scenarios: tuple[str, ...]
    agents: tuple[str, ...]
    seeds: range
    episodes: int
    """of all scenarios, swept values and agents together"""
    swept: tuple[str, ...]
    """dotted keys that any of the scenarios sweeps"""


def asked(configuration: Mapping[str, Any]) -> Asked | None:
    """What a sweep has when it is finished; None where its manifest's configuration does not say."""
    points, swept = 0, dict[str, None]()
    for entry in configuration.get("scenarios", {}).values():
        sweep = entry["values"].get("sweep", {})
        if not (isinstance(sweep, dict) and all(isinstance(values, list) for values in sweep.values())):
            return None
        points += math.prod(map(len, sweep.values()))
        swept |= dict.fromkeys(sweep)
    if not points:
        return None
    scenarios, agents = (
        tuple(one_line(as_text(name)) for name in configuration[part]) for part in ("scenarios", "agents")
    )
    first, each = configuration["seed"], configuration["episodes"]
    return Asked(scenarios, agents, range(first, first + each), points * len(agents) * each, tuple(swept))


def lacking(folder: Path) -> str:
    """Which episodes a sweep's folder lacks, and how to go on with it, in a sentence; empty where it lacks
    none, or does not say which it should have. Raises SweepError where it holds no rows.
    """
    file = folder / "episodes.csv"
    cut = _cut(file)
    try:
        content = read_manifest(folder)
        wanted = asked(content["configuration"])
    except SweepError:
        content, wanted = {}, None
    complete = f"{folder}: {cut}" if cut else ""
    # Rows are counted by their line breaks first: to read a million once more takes seconds.
    if wanted is None or (file.is_file() and _line_breaks(file) == 1 + wanted.episodes):
        return complete
    count, scenarios, agents = _there(file, wanted)
    if count >= wanted.episodes:
        return complete
    told = [f"{folder} is not finished: {count} of {wanted.episodes} episodes are there"]
    said = ", ".join((*told, *none_yet(wanted, scenarios, agents))) + (f"; {cut}" if cut else "")
    if content["format"] != FORMAT:
        return said
    return f"{said}; `{rudc_command('sweep', '--resume', '--out', str(folder))}` goes on with it"


def none_yet(wanted: Asked, scenarios: Collection[str], agents: Collection[str]) -> Iterator[str]:
    """In words, the scenarios and the agents that were asked for and are not among these."""
    for what, names, begun in (("scenario", wanted.scenarios, scenarios), ("agent", wanted.agents, agents)):
        if none := [name for name in names if name not in begun]:
            yield f"none yet of the {what}{'s' * (len(none) > 1)} {listed(none, _LISTED)}"


def _line_breaks(file: Path) -> int:
    with file.open("rb") as lines:
        return sum(block.count(b"\n") for block in iter(partial(lines.read, 1 << 20), b""))


def _there(file: Path, wanted: Asked) -> tuple[int, set[str], set[str]]:
    """How many of the episodes that were asked for have a row, failed ones included; and their scenarios and
    agents. Each counts once (recognised by a 64-bit hash of its identity).
    """
    keys, scenarios, agents = [np.zeros(0, np.int64)], set[str](), set[str]()
    header, blocks = table_blocks(file)
    at = [header.index(name) for name in (*IDENTITY, *wanted.swept) if name in header]
    for cells in blocks:
        rows = [
            row
            for row in zip(*(cells[k] for k in at), strict=True)
            if is_whole(row[2]) and int(row[2]) in wanted.seeds
        ]
        keys.append(np.fromiter(map(hash, rows), np.int64, len(rows)))
        scenarios |= {row[0] for row in rows}
        agents |= {row[1] for row in rows}
    return len(np.unique(np.concatenate(keys))), scenarios, agents


def _cut(file: Path) -> str:
    """What to say of a file that ends within a line; empty for any other."""
    if not file.is_file() or not file.stat().st_size:
        return ""
    with file.open("rb") as lines:
        lines.seek(-1, os.SEEK_END)
        whole = lines.read() == b"\n"
    return "" if whole else f"{file.name} ends within a line, which is left out"
