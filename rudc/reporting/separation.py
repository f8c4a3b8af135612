"""AUROC with 95 % intervals: a panel for each agent and task, a row for each scenario."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from rudc.reporting.figures import FAINT, PALETTE, grid, legend_below

if TYPE_CHECKING:
    from matplotlib.axes import Axes

TITLES = {
    "violation": "violation within 2 s", "violation seen": "the same, cause in sight",
    "violation hidden": "the same, cause hidden", "exposed": "exposed to an event",
}  # fmt: skip
_LABELS = {
    "total": r"$\sigma_{total}$", "route": r"$\sigma$ by route",
    "route_or_mismatch": "by route, and plant monitor",
    "route_or_monitors": "by route, and both monitors",
}  # fmt: skip
_COLOURS: dict[str, str] = dict(zip(_LABELS, (PALETTE[k] for k in (0, 4, 1, 2)), strict=True))
_SHIFT: dict[str, float] = dict(zip(_LABELS, (-0.3, -0.1, 0.1, 0.3), strict=True))


class Mark(NamedTuple):
    """One AUROC."""

    agent: str
    task: str
    scenarios: str
    sigma: str
    value: tuple[float, float, float]
    """and the ends of its interval; nan where there is none"""


WIDTH, ROW = 7.2, 0.19
"""inches: of the figure, two columns of a paper; of a scenario"""
ACROSS = 2
"""panels beside each other"""


def draw_separation(marks: Sequence[Mark], path: Path) -> Path:
    """All AUROCs; pooled ones at the top, scenarios below from best to worst separated by sigma_total. Where
    too little happened there is none; the panel says in how many scenarios.
    """
    agents, tasks = list(dict.fromkeys(m.agent for m in marks)), list(dict.fromkeys(m.task for m in marks))
    shown = [(agent, task) for agent in agents for task in tasks]
    parts = [[m for m in marks if (m.agent, m.task) == which] for which in shown]
    lines = -(-len(parts) // ACROSS)
    most = [max(len(_rows(p)) for p in parts[ACROSS * i : ACROSS * (i + 1)]) for i in range(lines)]
    size = (WIDTH, 0.5 + sum(0.75 + ROW * count for count in most))
    with grid(lines, ACROSS, size, path, height_ratios=[0.6 + ROW * count for count in most]) as (
        figure,
        panels,
    ):
        for k, (axes, (agent, task), part) in enumerate(zip(panels.flat, shown, parts, strict=False)):
            _panel(axes, part, most[k // ACROSS])
            axes.set_title(f"{agent}: {TITLES.get(task, task)}", fontsize=8.5)
        for axes in panels.flat[len(parts) :]:
            axes.axis("off")
        for axes in panels[-1]:
            axes.set_xlabel("AUROC (0.5: no better than chance)")
        legend_below(figure, _handles())
    return path


def _rows(marks: Sequence[Mark]) -> list[str]:
    """Scenarios that have an AUROC, in the order that they are drawn in."""
    totals = {m.scenarios: m.value[0] for m in marks if m.sigma == "total" and not math.isnan(m.value[0])}
    single = sorted((name for name in totals if " " not in name), key=lambda name: -totals[name])
    return [*(name for name in totals if " " in name), *single]


def _panel(axes: Axes, marks: Sequence[Mark], room: int) -> None:
    """`room`: for so many rows, as many as its neighbour has."""
    rows = _rows(marks)
    pooled = sum(" " in name for name in rows)
    axes.axvline(0.5, color=FAINT, lw=1.0, zorder=1)
    if 0 < pooled < len(rows):
        axes.axhline(pooled - 0.5, color=FAINT, lw=0.8)
    for m in marks:
        if m.scenarios not in rows:
            continue
        value, low, high = m.value
        y = rows.index(m.scenarios) + _SHIFT[m.sigma]
        if not math.isnan(low):
            axes.plot([low, high], [y, y], color=_COLOURS[m.sigma], lw=1.1, alpha=0.6)
        axes.plot([value], [y], "o", color=_COLOURS[m.sigma], markersize=3.0)
    others = {m.scenarios for m in marks if " " not in m.scenarios} - set(rows)
    axes.set_yticks(range(len(rows)), [name.replace("_", " ") for name in rows], fontsize=7.5)
    axes.set_ylim(room + 0.5, -0.5)
    axes.set_xlim(0.0, 1.01)
    if others:
        text = f"too little happened in {len(others)} scenario{'s' * (len(others) != 1)}"
        axes.text(0.02, len(rows) - 0.1, text, va="center", fontsize=6.5, color="#767d88")
    axes.grid(axis="y", visible=False)
    axes.tick_params(axis="y", length=0)


def _handles() -> list:
    from matplotlib.lines import Line2D

    return [Line2D([], [], color=_COLOURS[s], marker="o", markersize=4, label=_LABELS[s]) for s in _LABELS]
