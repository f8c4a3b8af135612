"""Metrics over a setting: a panel for each, a line for each task."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rudc.reporting.figures import INK, PALETTE, grid, legend_below

if TYPE_CHECKING:
    from matplotlib.axes import Axes

LABELS = {
    "SR": "success, SR (%)",
    "VR": "violations, VR (%)",
    "FR": "frozen, FR (%)",
    "AER": "reward of an episode",
    "AES": "speed (m/s)",
    "mean_sigma": r"mean $\sigma_{total}$",
    "weights": "weights (thousands)",
    "critics_ms": "critics, ms a decision",
}
COLUMNS = 3


def draw_sensitivity(
    lines: Sequence[Mapping[str, Any]], key: str, label: str, metrics: Sequence[str], pooled: str, path: Path
) -> Path:
    """`lines`: of a value of `key`, a scenario (or all of them, `pooled`) and metrics with `_low` and
    `_high`, or one number that belongs to the value alone.
    """
    scenarios = list(dict.fromkeys(line["scenario"] for line in lines))
    rows = -(-len(metrics) // COLUMNS)
    with grid(rows, COLUMNS, (7.2, 0.5 + 1.9 * rows), path, sharex=True) as (figure, panels):
        for axes in panels.ravel()[len(metrics) :]:
            axes.axis("off")
        for axes, metric in zip(panels.ravel(), metrics, strict=False):
            axes.tick_params(labelsize=7.5)
            axes.set_ylabel(LABELS.get(metric, metric), fontsize=8.5)
            if f"{metric}_low" in lines[0]:
                for k, scenario in enumerate(scenarios):
                    _line(
                        axes,
                        [m for m in lines if m["scenario"] == scenario],
                        key,
                        metric,
                        _look(k, scenario, pooled),
                    )
            else:
                _alone(axes, [m for m in lines if m["scenario"] == pooled], key, metric)
        for axes in panels.ravel()[max(len(metrics) - COLUMNS, 0) : len(metrics)]:  # lowest of their columns
            axes.tick_params(labelbottom=True)
            axes.set_xlabel(label, fontsize=8.5)
            axes.set_xticks(sorted({line[key] for line in lines}))
        legend_below(figure, [_handle(k, scenario, pooled) for k, scenario in enumerate(scenarios)])
    return path


def _look(k: int, scenario: str, pooled: str) -> dict[str, Any]:
    if scenario == pooled:
        return {"color": INK, "lw": 1.8, "marker": "o", "markersize": 4}
    return {"color": PALETTE[k % len(PALETTE)], "lw": 1.0, "marker": "s^v"[k % 3], "markersize": 3}


def _line(
    axes: Axes, lines: Sequence[Mapping[str, Any]], key: str, metric: str, look: dict[str, Any]
) -> None:
    members = sorted(lines, key=lambda line: line[key])
    x = [m[key] for m in members]
    axes.plot(x, [m[metric] for m in members], zorder=3, **look)
    if look["color"] == INK:
        low, high = (np.array([m[f"{metric}_{end}"] for m in members], float) for end in ("low", "high"))
        axes.fill_between(x, low, high, color=INK, alpha=0.13, lw=0)


def _alone(axes: Axes, lines: Sequence[Mapping[str, Any]], key: str, metric: str) -> None:
    members = sorted(lines, key=lambda line: line[key])
    scale = 1e-3 if metric == "weights" else 1.0
    axes.plot(
        [m[key] for m in members], [scale * m[metric] for m in members], color=INK, marker="o", markersize=4
    )
    axes.set_ylim(bottom=0.0)


def _handle(k: int, scenario: str, pooled: str) -> Any:
    from matplotlib.lines import Line2D

    text = f"{scenario}, with 95 % intervals" if scenario == pooled else scenario
    return Line2D([], [], label=text, **_look(k, scenario, pooled))
