"""Predicted against true: the change of h over a step, and the part of it that the model leaves out, w."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rudc.arrays import Array
from rudc.reporting.figures import INK, grid

if TYPE_CHECKING:
    from matplotlib.axes import Axes


class Agreement(NamedTuple):
    """Samples of one head, m2."""

    action: str
    """kind of the actions"""
    head: str
    change: Array
    """(M,) true change of h"""
    w: Array
    """(M,) true residual"""
    expected: Array
    """(M,) predicted residual"""


WHOLE, REST = "change of h", "residual w"


def draw_agreement(found: Sequence[Agreement], path: Path) -> Path:
    """A row for each kind of action; of each head the change of h and w. Axes end at the 0.5 and 99.5
    percentiles of what is true; scores are of all samples.
    """
    actions = list(dict.fromkeys(a.action for a in found))
    names = list(dict.fromkeys(a.head for a in found))
    with grid(len(actions), 2 * len(names), (7.2, 0.3 + 1.65 * len(actions)), path) as (_, panels):
        for a in found:
            i, k = actions.index(a.action), 2 * names.index(a.head)
            _panel(panels[i, k], a.change, a.change - a.w + a.expected)
            _panel(panels[i, k + 1], a.w, a.expected)
            if i == 0:
                panels[i, k].set_title(f"{a.head}: {WHOLE}", fontsize=8.0)
                panels[i, k + 1].set_title(f"{a.head}: {REST}", fontsize=8.0)
            panels[i, 0].set_ylabel(f"{a.action}\npredicted (m²)", fontsize=8.5)
        for axes in panels[-1]:
            axes.set_xlabel("true (m²)", fontsize=8.5)
    return path


def _panel(axes: Axes, true: Array, predicted: Array) -> None:
    low, high = (float(v) for v in np.percentile(true, [0.5, 99.5]))
    margin = max(0.05 * (high - low), 1e-6)
    low, high = low - margin, high + margin
    axes.hexbin(
        true, predicted, gridsize=32, extent=(low, high, low, high), bins="log", cmap="Blues", mincnt=1,
        linewidths=0.1,
    )  # fmt: skip
    axes.plot([low, high], [low, high], color=INK, lw=0.8, ls="--")
    axes.set_xlim(low, high)
    axes.set_ylim(low, high)
    axes.set_aspect("equal")
    axes.tick_params(labelsize=7.0)
    error = predicted - true
    r2 = 1.0 - float(np.sum(error**2) / np.sum((true - true.mean()) ** 2))
    told = f"R² {r2:.4f}\nMAE {np.abs(error).mean():.3f}\nRMSE {np.sqrt(np.mean(error**2)):.3f}"
    axes.text(0.04, 0.96, told, transform=axes.transAxes, va="top", fontsize=6.8)
