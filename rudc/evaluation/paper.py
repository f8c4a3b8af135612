"""What the paper reports (Tab. "Performance comparison", Tab. "Ablation study"): mean (standard deviation).

The numbers stand in `paper.csv` as printed. They come from another simulator; the spread of rates there is
over training runs, ours over episodes.
"""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Mapping, Sequence
from pathlib import Path

from rudc.agents.variation import split
from rudc.errors import InputError
from rudc.evaluation.columns import METRICS, Metric
from rudc.evaluation.metrics import Group
from rudc.evaluation.statistics import Summary
from rudc.learning.algorithms import ALGORITHMS

TABLES: dict[str, tuple[str, ...]] = {
    "comparison": ("comparison",),
    "ablation": ("ablation",),
    "paper": ("comparison", "ablation"),
}
"""what `--against` may name -> tables of the paper"""
_MARK = " (paper)"


def is_from_paper(group: Group) -> bool:
    """Whether a group stands for what the paper reports."""
    return any(value.endswith(_MARK) for value in group.key)


def paper_groups(table: str, by: Sequence[str], metrics: Sequence[Metric] = METRICS) -> list[Group]:
    """The paper's rows, keyed like groups by these columns; of metrics that it does not report, nan. Raises
    InputError for an unknown table.
    """
    if table not in TABLES:
        raise InputError(f"the paper has no table {table!r}; there are: {', '.join(TABLES)}")
    text = Path(__file__).with_name("paper.csv").read_text(encoding="utf-8")
    found: dict[tuple[str, ...], Group] = {}
    for row in csv.DictReader(text.splitlines()):
        if row["table"] in TABLES[table]:
            known = {"scenario": row["scenario"], "agent": row["agent"] + _MARK}
            key = tuple(known.get(name, "") for name in by)
            found.setdefault(key, Group(key, 0, 0, {m.name: _summary(row, m.name) for m in metrics}))
    return list(found.values())


def tasks(table: str) -> list[str]:
    """Scenarios of the paper's rows. Raises InputError for an unknown table."""
    return list(dict.fromkeys(group.key[0] for group in paper_groups(table, ["scenario", "agent"])))


def beside(
    ours: Sequence[Group], theirs: Sequence[Group], at: int, algorithms: Mapping[str, str]
) -> list[Group]:
    """Our groups, the last one of each algorithm followed by the paper's group of that algorithm; then the
    paper's other groups. `at`: where in their keys the agent stands. `algorithms`: see `paper_name`.
    """
    names = [paper_name(group.key[at], algorithms) + _MARK for group in ours]
    found: list[Group] = []
    for k, (group, name) in enumerate(zip(ours, names, strict=True)):
        found.append(group)
        if name not in names[k + 1 :]:
            found += [other for other in theirs if other.key[at] == name]
    return found + [other for other in theirs if other.key[at] not in names]


def paper_name(agent: str, algorithms: Mapping[str, str]) -> str:
    """What the paper's tables call an agent that drives as it learnt; empty for others, those with settings
    behind their names included. `algorithms`: agent -> the algorithm that it learnt by; an agent that is not
    there is called as its algorithm, or with a training seed behind it (`sac-seed1`).
    """
    if split(agent)[1]:
        return ""
    algorithm = ALGORITHMS.get(algorithms.get(agent) or re.sub(r"-seed\d+$", "", agent))
    return "" if algorithm is None else algorithm.paper


def _summary(row: dict[str, str], name: str) -> Summary:
    mean, std = (float(row.get(f"{name}_{of}", "nan")) for of in ("mean", "std"))
    return Summary(mean, std, math.nan, math.nan)
