"""The table of metrics on a screen, as wide as the screen: rates with their intervals, means without.

Where it is too narrow, the first column becomes a line above its rows, less important metrics are left out,
and at last each row gets a line for its name. A number is never broken.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

from rich.text import Text

from rudc.cli.console import console, note
from rudc.evaluation.columns import DECISION_MS, METRICS, Metric
from rudc.evaluation.metrics import Group
from rudc.evaluation.paper import is_from_paper
from rudc.evaluation.tables import best_of, cell, heading, shown_key
from rudc.evaluation.text import MISSING

LEAST_IMPORTANT = ("decision", "AER", "RC", "AES", "min_DTC")
"""metrics that a narrow screen leaves out, in this order"""
GAP = "  "


class Layout(NamedTuple):
    """What is shown, and where the values grouped by stand."""

    metrics: tuple[Metric, ...]
    above: int
    """how many of the columns grouped by stand in lines above the rows"""


def print_metrics(
    groups: Sequence[Group], by: Sequence[str], metrics: Sequence[Metric] | None = None
) -> None:
    """Print the metrics of groups (`rudc.evaluation.tables.measured`) by columns; `metrics`: the paper's and
    the time for a decision if left out.
    """
    chosen = tuple(metrics or (*METRICS, DECISION_MS))
    screen = console()
    layout = _fitting(groups, by, chosen, screen.width, may_drop=metrics is None)
    for line in _lines(groups, by, layout):
        screen.print(line, soft_wrap=True)
    _note_fewer(groups, layout.metrics)
    gone = [metric.name.replace("_", "-") for metric in chosen if metric not in layout.metrics]
    if gone:
        note(f"too narrow for {', '.join(gone)}; --format csv or markdown shows all")


def _note_fewer(groups: Sequence[Group], metrics: Sequence[Metric]) -> None:
    """Say which means are from fewer episodes than their row has; of many the first, and how many more."""
    found = [(metric, group) for group in groups for metric in metrics if metric.name in group.fewer]
    if found:
        metric, group = found[0]
        name = heading(metric).partition(" ")[0]
        row = ", ".join(shown_key(group.key))
        more = f"; other means from fewer than n: {len(found) - 1}" if len(found) > 1 else ""
        note(f"{name} of {row}: from {group.fewer[metric.name]} of {group.episodes} episodes{more}")


def _fitting(
    groups: Sequence[Group], by: Sequence[str], metrics: tuple[Metric, ...], width: int, *, may_drop: bool
) -> Layout:
    """The layout nearest to the full one that fits; the narrowest if none does."""
    drops = [name for name in LEAST_IMPORTANT if may_drop and any(m.name == name for m in metrics)]
    beside = [above for above in (0, 1) if above < len(by)]
    options = [(n, above) for n in range(len(drops) + 1) for above in beside]
    options += [(n, len(by)) for n in range(len(drops) + 1)]
    layout = Layout(metrics, 0)
    for n, above in options:
        layout = Layout(tuple(m for m in metrics if m.name not in drops[:n]), above)
        widths = _widths(_heads(by, layout), _bodies(groups, layout))
        if sum(widths) + len(GAP) * (len(widths) - 1) <= width:
            break
    return layout


def _widths(heads: Sequence[Sequence[str]], bodies: Sequence[Sequence[str]]) -> list[int]:
    return [max(len(row[k]) for row in (*heads, *bodies)) for k in range(len(heads[0]))]


def _heads(by: Sequence[str], layout: Layout) -> list[list[str]]:
    """One line of headings, or two: name above unit, where room is scarce."""
    names = list(by[layout.above :])
    if layout.above == 0:
        return [[*names, "n", *map(heading, layout.metrics)]]
    parts = [heading(metric).partition(" ") for metric in layout.metrics]
    first = [*names, "n", *(name for name, _, _ in parts)]
    return [first, [*("" for _ in names), "", *(unit for _, _, unit in parts)]]


def _bodies(groups: Sequence[Group], layout: Layout) -> list[list[str]]:
    rows = []
    for group in groups:
        count = str(group.episodes) + (f"+{group.errors}!" if group.errors else "")
        cells = [_shown(metric, group) for metric in layout.metrics]
        name = shown_key(group.key[layout.above :])
        rows.append([*name, MISSING if is_from_paper(group) else count, *cells])
    return rows


def _shown(metric: Metric, group: Group) -> str:
    value = group.metrics[metric.name]
    mean_alone = metric.column and not is_from_paper(group) and not math.isnan(value.mean)
    return f"{value.mean:.{metric.decimals}f}" if mean_alone else cell(metric, value)


def _lines(groups: Sequence[Group], by: Sequence[str], layout: Layout) -> Iterator[Text]:
    heads, bodies = _heads(by, layout), _bodies(groups, layout)
    widths, keys = _widths(heads, bodies), len(by) - layout.above
    best = best_of(groups, by, layout.metrics)

    def aligned(cells: Sequence[str], bold: Sequence[bool]) -> Text:
        padded = [
            t.ljust(w) if k < keys else t.rjust(w) for k, (t, w) in enumerate(zip(cells, widths, strict=True))
        ]
        parts = [
            Text(text, style="bold" if strong else "") for text, strong in zip(padded, bold, strict=True)
        ]
        line = Text(GAP).join(parts)
        line.rstrip()
        return line

    for head in heads:
        yield aligned(head, [True] * len(head))
    before: tuple[str, ...] = ()
    for i, (group, body) in enumerate(zip(groups, bodies, strict=True)):
        if layout.above and group.key[: layout.above] != before[: layout.above]:
            yield Text(", ".join(shown_key(group.key[: layout.above])), style="underline")
        same = 0 if layout.above else _shared(group.key, before)
        cells = ["" if k < same else text for k, text in enumerate(body)]
        strong = [(i, metric.name) in best for metric in layout.metrics]
        yield aligned(cells, [False] * (keys + 1) + strong)
        before = group.key


def _shared(key: tuple[str, ...], before: tuple[str, ...]) -> int:
    """How many leading values two neighbours share."""
    return next((k for k, (a, b) in enumerate(zip(key, before, strict=False)) if a != b), len(before))
