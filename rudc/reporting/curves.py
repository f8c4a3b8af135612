"""Curves with bands: a column for each place where it was measured, a row for each metric."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rudc.reporting.figures import PALETTE, grid, legend_below

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_LABELS = {
    "SR": "success, SR (%)",
    "VR": "violations, VR (%)",
    "FR": "frozen, FR (%)",
    "reward": "reward of an episode",
}
_DASHES = ("-", "--", ":", "-.")
"""of curves, where there are more of them than colours"""


class Curve(NamedTuple):
    """One metric over training."""

    agent: str
    place: str
    """scenario, or `while training`"""
    metric: str
    trainings: int
    steps: np.ndarray
    """(n,) decisions"""
    mean: np.ndarray
    """(n,)"""
    low: np.ndarray
    """(n,) of the band; nan where there is none"""
    high: np.ndarray
    """(n,)"""


def draw_curves(curves: Sequence[Curve], path: Path) -> Path:
    """Mean over trainings and 95 % band; of one training only its rates have a band."""
    places = list(dict.fromkeys(c.place for c in curves))
    agents = {c.agent: c.trainings for c in curves}
    styles: dict[str, dict[str, str]] = {
        name: {"color": PALETTE[k % len(PALETTE)], "ls": _DASHES[k // len(PALETTE) % len(_DASHES)]}
        for k, name in enumerate(agents)
    }
    size = (0.6 + 3.6 * len(places), 0.6 + 2.3 * len(_LABELS))
    with grid(len(_LABELS), len(places), size, path, sharex=True, sharey="row") as (figure, panels):
        for i, metric in enumerate(_LABELS):
            for k, place in enumerate(places):
                inside = [c for c in curves if (c.place, c.metric) == (place, metric)]
                for curve in inside:
                    _draw(panels[i, k], curve, styles[curve.agent])
                if i == 0:
                    panels[i, k].set_title(place)
                if i == len(_LABELS) - 1:
                    panels[i, k].set_xlabel("decisions (thousands)")
            panels[i, 0].set_ylabel(_LABELS[metric])
            if metric != "reward":
                _limit(panels[i, 0], [c for c in curves if c.metric == metric])
        legend_below(figure, _handles(agents, styles))
    return path


def _draw(axes: Axes, curve: Curve, style: dict[str, str]) -> None:
    steps = curve.steps / 1000.0
    axes.plot(steps, curve.mean, zorder=3, color=style["color"], ls=style["ls"])
    axes.fill_between(steps, curve.low, curve.high, color=style["color"], alpha=0.18, lw=0)


def _limit(axes: Axes, curves: Sequence[Curve]) -> None:
    """Set limits so that rates near their good end fill the panel; by means only, as bands may be wide."""
    means = np.concatenate([c.mean[np.isfinite(c.mean)] for c in curves] or [np.zeros(1)])
    if curves and curves[0].metric == "SR":
        axes.set_ylim(max(float(means.min(initial=100.0)) - 10.0, 0.0), 101.0)
    else:
        axes.set_ylim(-1.0, min(float(means.max(initial=0.0)) + 10.0, 101.0))


def _handles(agents: dict[str, int], styles: dict[str, dict[str, str]]) -> list:
    from matplotlib.lines import Line2D

    handles = []
    for name, n in agents.items():
        of = f"mean and 95 % band of {n} trainings" if n > 1 else "one training, 95 % band of its rates"
        handles.append(
            Line2D([], [], color=styles[name]["color"], ls=styles[name]["ls"], label=f"{name}, {of}")
        )
    return handles
