"""Metrics as tables: CSV and JSON (numbers in full), Markdown and LaTeX (rounded, with intervals).

Bold: the best of the agents in a scenario, if its 95 % interval overlaps with no other's.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Sequence
from typing import Literal

from rudc.errors import InputError
from rudc.evaluation.columns import COLUMNS, DECISION_MS, METRICS, Metric, metric_names, metric_of
from rudc.evaluation.folder import metrics_csv
from rudc.evaluation.metrics import Group, group_metrics, in_order
from rudc.evaluation.paper import beside, is_from_paper, paper_groups
from rudc.evaluation.rows import Row, SweepRows
from rudc.evaluation.statistics import Summary
from rudc.evaluation.text import MISSING, markdown, rate_decimals
from rudc.hints import did_you_mean, there_are

Format = Literal["csv", "markdown", "latex", "json"]
NAMES = frozenset({"scenario", "agent", "folder", "network", "junction", "origin", "destination"})
"""columns of names"""
_NUMBER = re.compile(r"-?(0|[1-9]\d*)(\.\d+)?(e[+-]?\d+)?")
_ARROWS = {"higher": " ↑", "lower": " ↓", None: ""}
_LATEX_SIGNS = str.maketrans(
    {sign: f"\\{sign}" for sign in "&%$#_{}"}
    | {"~": "\\textasciitilde{}", "^": "\\textasciicircum{}", "\\": "\\textbackslash{}"}
)
_LATEX_ARROWS = {"higher": "\\,$\\uparrow$", "lower": "\\,$\\downarrow$", None: ""}


def make_table(
    rows: Sequence[Row] | SweepRows,
    by: Sequence[str],
    style: Format = "markdown",
    against: str | None = None,
    metrics: Sequence[Metric] = METRICS,
) -> str:
    """The metrics of a sweep's rows grouped by columns, as text ending in a line break.

    `against`: which of the paper's tables (`rudc.evaluation.paper.TABLES`) to put beside. Raises InputError
    for an unknown column, and one that is both grouped by and shown.
    """
    return written(measured(rows, by, against, metrics), by, style, metrics)


def written(
    groups: Sequence[Group], by: Sequence[str], style: Format, metrics: Sequence[Metric] = METRICS
) -> str:
    """The same, of groups that are measured already."""
    if style == "csv":
        return metrics_csv(groups, by, metrics)
    if style == "json":
        return _json(groups, by, metrics)
    return _markdown(groups, by, metrics) if style == "markdown" else _latex(groups, by, metrics)


def named_metrics(names: Sequence[str]) -> tuple[Metric, ...]:
    """Metrics by name, those of the paper and means of columns, each once, however often and in whichever
    spelling it is named. Raises InputError for an unknown one.
    """
    found = {name: metric_of(name) for name in names}
    for name, metric in found.items():
        if metric is None:
            raise InputError(f"no metric {name!r}{there_are(name, metric_names())}")
    return tuple(dict.fromkeys(metric for metric in found.values() if metric is not None))


def measured(
    rows: Sequence[Row] | SweepRows,
    by: Sequence[str],
    against: str | None = None,
    metrics: Sequence[Metric] = (*METRICS, DECISION_MS),
) -> list[Group]:
    """The groups of a table, `in_order`; those of the paper beside ours of the same algorithm and
    scenario, or after them.
    """
    names = rows.names if isinstance(rows, SweepRows) else tuple(rows[0]) if rows else ()
    if not names:
        raise InputError("there is no finished episode to make a table of")
    unknown = [name for name in by if name not in names]
    if unknown or not by:
        hint = did_you_mean(unknown[0], names) if unknown else ""
        raise InputError(f"no column {', '.join(unknown)!r} to group by{hint}; there are: {', '.join(names)}")
    if both := [metric.name for metric in metrics if metric.name in by]:
        raise InputError(f"column {both[0]!r} is both grouped by and shown; leave it out of one of the two")
    groups = in_order(group_metrics(rows, by, metrics))
    if against is None:
        return groups
    if not {"scenario", "agent"} <= set(by):
        raise InputError("to compare with the paper, group by scenario and agent at least")
    at = list(by).index("scenario")
    scenarios = list(dict.fromkeys(group.key[at] for group in groups))
    families = [(s, [g for g in groups if g.key[at] == s]) for s in scenarios]
    theirs = paper_groups(against, by, metrics)
    algorithms = rows.algorithms if isinstance(rows, SweepRows) else {}
    agent = list(by).index("agent")
    return [
        group
        for scenario, ours in families
        for group in beside(ours, [g for g in theirs if g.key[at] == scenario], agent, algorithms)
    ]


def cell(metric: Metric, value: Summary) -> str:
    """`mean [low, high]`; `mean (std)` where there is no interval."""
    if math.isnan(value.mean):
        return MISSING
    n = decimals_of(metric, value.mean)
    if not math.isnan(value.low):
        return f"{value.mean:.{n}f} [{value.low:.{n}f}, {value.high:.{n}f}]"
    return f"{value.mean:.{n}f}" + ("" if math.isnan(value.std) else f" ({value.std:.{n}f})")


def decimals_of(metric: Metric, value: float) -> int:
    """With how many decimals a value of a metric, or its change, is written."""
    return rate_decimals(value, metric.decimals) if metric.outcomes else metric.decimals


def shown_key(key: tuple[str, ...]) -> list[str]:
    """What a group has in common, as tables show it: where an episode says nothing (one that failed has no
    outcome), `MISSING`.
    """
    return [value or MISSING for value in key]


def heading(metric: Metric) -> str:
    """Name and unit of a metric's column; a column of `episodes.csv` is called as it is there."""
    name = metric.name if metric.name in COLUMNS else metric.name.replace("_", "-")
    return name + (f" ({metric.unit})" if metric.unit else "")


def best_of(groups: Sequence[Group], by: Sequence[str], metrics: Sequence[Metric]) -> set[tuple[int, str]]:
    """(index of a group, metric) of values that are better than all others by more than chance, among groups
    that differ in their agent only: whose interval overlaps with that of none of them.

    A group without competitors has no best value, and the paper's do not compete: its simulator is another.
    """
    families: dict[tuple[str, ...], list[int]] = {}
    for i, group in enumerate(groups):
        if not is_from_paper(group) and group.episodes:
            rest = tuple(value for name, value in zip(by, group.key, strict=True) if name != "agent")
            families.setdefault(rest, []).append(i)
    best = set()
    for members in families.values():
        for metric in metrics:
            known = [i for i in members if not math.isnan(groups[i].metrics[metric.name].mean)]
            values = [groups[i].metrics[metric.name] for i in known]
            if metric.better is None or len(values) < 2:
                continue
            sign = 1.0 if metric.better == "higher" else -1.0
            first = max(range(len(values)), key=lambda k: sign * values[k].mean)
            if all(_apart(values[first], other) for k, other in enumerate(values) if k != first):
                best.add((known[first], metric.name))
    return best


def _apart(a: Summary, b: Summary) -> bool:
    """Whether two intervals have nothing in common; False where one is not known, or has no width: of values
    that are all the same it does not say where others would lie.
    """
    return a.low < a.high and b.low < b.high and (a.low > b.high or a.high < b.low)


def _json(groups: Sequence[Group], by: Sequence[str], metrics: Sequence[Metric]) -> str:
    """A list with an object for each group: what it has in common, `episodes`, `errors`, and for each metric
    its statistics; null for what is not known. A column grouped by is one of numbers where each row has one.
    """
    columns = [_values(name, [group.key[k] for group in groups]) for k, name in enumerate(by)]
    lines = [
        dict(zip(by, key, strict=True))
        | {"episodes": group.episodes, "errors": group.errors}
        | {m.name: {k: _or_none(v) for k, v in group.metrics[m.name]._asdict().items()} for m in metrics}
        for group, key in zip(groups, zip(*columns, strict=True), strict=True)
    ]
    return json.dumps(lines, indent=1, allow_nan=False) + "\n"


def _values(column: str, cells: Sequence[str]) -> Sequence[str | float]:
    """The cells of a column grouped by: numbers if all are; a name stays a name, whatever it looks like."""
    if column in NAMES or not all(map(_NUMBER.fullmatch, cells)):
        return cells
    return [int(cell) if cell.isdecimal() else float(cell) for cell in cells]


def _or_none(value: float) -> float | None:
    return None if math.isnan(value) else value


def _markdown(groups: Sequence[Group], by: Sequence[str], metrics: Sequence[Metric]) -> str:
    best = best_of(groups, by, metrics)
    lines = [[*by, "episodes", *(heading(m) + _ARROWS[m.better] for m in metrics)]]
    for i, group in enumerate(groups):
        cells = [cell(m, group.metrics[m.name]) for m in metrics]
        bold = [
            f"**{text}**" if (i, m.name) in best else text for m, text in zip(metrics, cells, strict=True)
        ]
        lines.append([*shown_key(group.key), _count(group), *bold])
    return markdown(lines[0], lines[1:], left=len(by))


def _latex(groups: Sequence[Group], by: Sequence[str], metrics: Sequence[Metric]) -> str:
    best, columns = best_of(groups, by, metrics), len(metrics) + 1
    names = " & ".join(
        [
            *map(_escaped, by),
            "$n$",
            *(_escaped(heading(m).partition(" ")[0]) + _LATEX_ARROWS[m.better] for m in metrics),
        ]
    )
    units = " & ".join([*[""] * len(by), "", *(f"({_escaped(m.unit)})" if m.unit else "" for m in metrics)])
    lines = [
        "% needs \\usepackage{booktabs}; brackets: 95 % intervals, parentheses: standard deviations",
        f"\\begin{{tabular}}{{{'l' * len(by)}{'r' * columns}}}",
        "\\toprule",
        f"{names} \\\\",
        f"{units} \\\\",
    ]
    before: tuple[str, ...] | None = None
    for i, group in enumerate(groups):
        family = tuple(value for name, value in zip(by, group.key, strict=True) if name != "agent")
        if family != before:
            lines.append("\\midrule")
            before = family
        cells = [_latex_cell(m, group.metrics[m.name], (i, m.name) in best) for m in metrics]
        lines.append(" & ".join([*map(_escaped, shown_key(group.key)), _count(group), *cells]) + " \\\\")
    return "\n".join([*lines, "\\bottomrule", "\\end{tabular}", ""])


def _latex_cell(metric: Metric, value: Summary, bold: bool) -> str:
    if math.isnan(value.mean):
        return "--"
    number, _, rest = cell(metric, value).replace("-", "$-$").partition(" ")
    number = f"\\textbf{{{number}}}" if bold else number
    return f"{number} {{\\scriptsize {rest}}}" if rest else number


def _count(group: Group) -> str:
    if is_from_paper(group):
        return MISSING
    return str(group.episodes) + (f" (+{group.errors} failed)" if group.errors else "")


def _escaped(text: str) -> str:
    return text.translate(_LATEX_SIGNS)
