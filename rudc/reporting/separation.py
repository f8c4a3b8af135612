"""AUROC with 95 % intervals: a panel for each agent and task, a row for each scenario."""

from __future__ import annotations

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
}  # fmt: skip
_COLOURS: dict[str, str] = dict(zip(_LABELS, (PALETTE[0], PALETTE[4], PALETTE[1]), strict=True))
_SHIFT: dict[str, float] = dict(zip(_LABELS, (-0.22, 0.0, 0.22), strict=True))


class Mark(NamedTuple):
    """One AUROC."""

    agent: str
    task: str
    scenarios: str
    sigma: str
    value: tuple[float, float, float]
    """and the ends of its interval; nan where there is none"""


def draw_separation(marks: Sequence[Mark], path: Path) -> Path:
    """All AUROCs; pooled ones at the top, scenarios below from best to worst separated by sigma_total."""
    agents, tasks = list(dict.fromkeys(m.agent for m in marks)), list(dict.fromkeys(m.task for m in marks))
    most = max(len({m.scenarios for m in marks if m.task == task}) for task in tasks)
    size = (5.6 * len(tasks), 0.8 + len(agents) * (0.8 + 0.27 * most))
    with grid(len(agents), len(tasks), size, path, sharex="col") as (figure, panels):
        for i, agent in enumerate(agents):
            for k, task in enumerate(tasks):
                axes = panels[i, k]
                _panel(axes, [m for m in marks if (m.agent, m.task) == (agent, task)])
                axes.set_title(f"{agent}: {TITLES.get(task, task)}")
                if i == len(agents) - 1:
                    axes.set_xlabel("AUROC (0.5: no better than chance)")
        legend_below(figure, _handles())
    return path


def _panel(axes: Axes, marks: Sequence[Mark]) -> None:
    totals = {m.scenarios: m.value[0] for m in marks if m.sigma == "total"}
    pooled = [name for name in totals if " " in name]
    single = sorted(
        (name for name in totals if " " not in name),
        key=lambda name: (totals[name] != totals[name], -totals[name]),
    )
    rows = [*pooled, *single]
    axes.axvline(0.5, color=FAINT, lw=1.0, zorder=1)
    if pooled and single:
        axes.axhline(len(pooled) - 0.5, color=FAINT, lw=0.8)
    for m in marks:
        value, low, high = m.value
        y = rows.index(m.scenarios) + _SHIFT[m.sigma]
        if value != value:
            if m.sigma == "route":
                axes.text(0.51, y, "none happened", va="center", fontsize=7.5, color="#767d88")
            continue
        if low == low:
            axes.plot([low, high], [y, y], color=_COLOURS[m.sigma], lw=1.1, alpha=0.6)
        axes.plot([value], [y], "o", color=_COLOURS[m.sigma], markersize=4.0)
    axes.set_yticks(range(len(rows)), rows)
    axes.set_ylim(len(rows) - 0.5, -0.5)
    low, high = axes.get_xlim()
    axes.set_xlim(max(min(low, 0.4), 0.0), min(max(high, 0.6), 1.005))
    axes.grid(axis="y", visible=False)
    axes.tick_params(axis="y", length=0)


def _handles() -> list:
    from matplotlib.lines import Line2D

    return [Line2D([], [], color=_COLOURS[s], marker="o", markersize=4, label=_LABELS[s]) for s in _LABELS]
