"""Metrics as tables: CSV (numbers in full), Markdown and LaTeX (rounded, with intervals, best in bold)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Literal

from rudc.errors import InputError
from rudc.evaluation.folder import metrics_csv
from rudc.evaluation.metrics import METRICS, Group, Metric, group_metrics
from rudc.evaluation.paper import is_from_paper, paper_groups
from rudc.evaluation.statistics import Summary

Format = Literal["csv", "markdown", "latex"]
MISSING = "–"
"""stands where a number is not known"""


def make_table(
    rows: Sequence[dict[str, str]], by: Sequence[str], style: Format = "markdown", against: str | None = None
) -> str:
    """The metrics of a sweep's rows grouped by columns, as text ending in a line break.

    `against`: which of the paper's tables (`rudc.evaluation.paper.TABLES`) to put beside. Raises InputError
    for an unknown column.
    """
    groups = measured(rows, by, against)
    if style == "csv":
        return metrics_csv(groups, by)
    return _markdown(groups, by) if style == "markdown" else _latex(groups, by)


def measured(rows: Sequence[dict[str, str]], by: Sequence[str], against: str | None = None) -> list[Group]:
    """The groups of a table, those of the paper after ours of the same scenario."""
    if not rows:
        raise InputError("there is no finished episode to make a table of")
    unknown = [name for name in by if name not in rows[0]]
    if unknown or not by:
        raise InputError(f"no column {', '.join(unknown)!r} to group by; there are: {', '.join(rows[0])}")
    groups = group_metrics(rows, by)
    if against is None:
        return groups
    if not {"scenario", "agent"} <= set(by):
        raise InputError("to compare with the paper, group by scenario and agent at least")
    at = list(by).index("scenario")
    scenarios = list(dict.fromkeys(group.key[at] for group in groups))
    theirs = paper_groups(against, by)
    ordered = [[g for g in (*groups, *theirs) if g.key[at] == scenario] for scenario in scenarios]
    return [group for family in ordered for group in family]


def decimals(metric: Metric) -> int:
    """Decimals that a metric is shown with."""
    return 2 if metric.name == "min_DTC" else 1


def cell(metric: Metric, value: Summary) -> str:
    """`mean [low, high]`; `mean (std)` where there is no interval."""
    n = decimals(metric)
    if math.isnan(value.mean):
        return MISSING
    if not math.isnan(value.low):
        return f"{value.mean:.{n}f} [{value.low:.{n}f}, {value.high:.{n}f}]"
    return f"{value.mean:.{n}f}" + ("" if math.isnan(value.std) else f" ({value.std:.{n}f})")


def heading(metric: Metric) -> str:
    """Name and unit of a metric's column."""
    return metric.name.replace("_", "-") + (f" ({metric.unit})" if metric.unit else "")


def best_of(groups: Sequence[Group], by: Sequence[str]) -> set[tuple[int, str]]:
    """(index of a group, metric) of the best values, as shown, among groups that differ in their agent only.

    A group without competitors has no best value, and the paper's do not compete: its simulator is another.
    """
    families: dict[tuple[str, ...], list[int]] = {}
    for i, group in enumerate(groups):
        if not is_from_paper(group) and group.episodes:
            rest = tuple(value for name, value in zip(by, group.key, strict=True) if name != "agent")
            families.setdefault(rest, []).append(i)
    best = set()
    for members in families.values():
        for metric in METRICS if len(members) > 1 else ():
            shown = {i: round(groups[i].metrics[metric.name].mean, decimals(metric)) for i in members}
            known = [value for value in shown.values() if not math.isnan(value)]
            top = (max if metric.higher_is_better else min)(known, default=math.nan)
            best |= {(i, metric.name) for i, value in shown.items() if value == top}
    return best


def _markdown(groups: Sequence[Group], by: Sequence[str]) -> str:
    best = best_of(groups, by)
    lines = [[*by, "episodes", *(heading(m) + (" ↑" if m.higher_is_better else " ↓") for m in METRICS)]]
    for i, group in enumerate(groups):
        cells = [cell(m, group.metrics[m.name]) for m in METRICS]
        bold = [
            f"**{text}**" if (i, m.name) in best else text for m, text in zip(METRICS, cells, strict=True)
        ]
        lines.append([*group.key, _count(group), *bold])
    widths = [max(len(line[k]) for line in lines) for k in range(len(lines[0]))]
    rule = ["-" * width if k < len(by) else "-" * (width - 1) + ":" for k, width in enumerate(widths)]
    padded = [
        [
            text.ljust(w) if k < len(by) else text.rjust(w)
            for k, (text, w) in enumerate(zip(line, widths, strict=True))
        ]
        for line in lines
    ]
    return "".join(f"| {' | '.join(line)} |\n" for line in [padded[0], rule, *padded[1:]])


def _latex(groups: Sequence[Group], by: Sequence[str]) -> str:
    best, columns = best_of(groups, by), len(METRICS) + 1
    names = " & ".join(
        [*map(_escaped, by), "$n$", *(_escaped(m.name.replace("_", "-")) + _arrow(m) for m in METRICS)]
    )
    units = " & ".join([*[""] * len(by), "", *(f"({_escaped(m.unit)})" if m.unit else "" for m in METRICS)])
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
        cells = [_latex_cell(m, group.metrics[m.name], (i, m.name) in best) for m in METRICS]
        lines.append(" & ".join([*map(_escaped, group.key), _count(group), *cells]) + " \\\\")
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


def _arrow(metric: Metric) -> str:
    return "\\,$\\uparrow$" if metric.higher_is_better else "\\,$\\downarrow$"


def _escaped(text: str) -> str:
    for sign in "&%$#_{}":
        text = text.replace(sign, f"\\{sign}")
    return text
