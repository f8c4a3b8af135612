"""Violations against standstill: one panel for each agent, domain and choice of constrained vehicles."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from rudc.reporting.figures import INK, PALETTE, Label, bare, grid, legend_below, place_labels

if TYPE_CHECKING:
    from matplotlib.axes import Axes

OFF = "off"


class _Look(NamedTuple):
    """How a variant is drawn, and what it is called."""

    colour: str
    marker: str
    label: str


_LOOKS = {
    "fixed": _Look(PALETTE[5], "o", "fixed"),
    "residual": _Look(PALETTE[2], "s", "residual only"),
    "slack": _Look(PALETTE[4], "^", "slack only"),
    "both": _Look(PALETTE[1], "D", "residual and slack"),
    "last_resort": _Look(PALETTE[3], "v", "and last resort"),
    "level_route": _Look(PALETTE[0], "P", "slack by route"),
    "rate_route": _Look(INK, "X", "the same as a rate"),
}

DRAWN = tuple(_LOOKS)
"""variants that are drawn, besides OFF"""

Estimate = tuple[float, float, float]
"""value and ends of its interval"""


@dataclass(frozen=True)
class Point:
    """One variant of a filter."""

    agent: str
    domain: str
    constrained: str
    """empty for `off`, which belongs to all panels of its agent and domain"""
    variant: str
    d_safe: float
    """m; nan for `off`"""
    fr: Estimate
    """percent"""
    vr: Estimate
    """percent"""


def draw_tradeoff(points: Sequence[Point], path: Path) -> Path:
    """VR over FR with 95 % intervals; a line joins the d_safe of one variant, and its ends say which."""
    agents = list(dict.fromkeys(p.agent for p in points))
    columns = list(dict.fromkeys((p.domain, p.constrained) for p in points if p.constrained))
    columns = [
        (d, c) for c in dict.fromkeys(c for _, c in columns) for d in dict.fromkeys(d for d, _ in columns)
    ]
    size = (3.6 * len(columns), 0.5 + 3.4 * len(agents))
    with grid(len(agents), len(columns), size, path, sharex="col", sharey="col") as (figure, panels):
        labels: list[Label] = []
        for i, agent in enumerate(agents):
            for k, (domain, constrained) in enumerate(columns):
                inside = [p for p in points if (p.agent, p.domain) == (agent, domain)]
                labels += _panel(panels[i, k], [p for p in inside if p.constrained in ("", constrained)])
                name = agent.rsplit("/", 1)[-1]  # of a folder: a path would be wider than the panel
                panels[i, k].set_title(f"{name}, {constrained}\n{domain}")
                panels[i, k].set_xlabel("frozen, FR (%)" if i == len(agents) - 1 else "")
                panels[i, k].set_ylabel("violations, VR (%)" if k == 0 else "")
        legend_below(figure, _handles(points))
        place_labels(figure, labels)
    return path


def _panel(axes: Axes, points: Sequence[Point]) -> list[Label]:
    """Draw a panel; the labels that are still to be placed."""
    shown = [p for p in points if not math.isnan(p.fr[0])]
    if not shown:
        bare(axes, "no episode ended")
        return []
    labels = []
    for p in shown:
        colour = INK if p.variant == OFF else _LOOKS[p.variant].colour
        (x, y), (x_error, y_error) = (p.fr[0], p.vr[0]), (_arms(p.fr), _arms(p.vr))
        axes.errorbar(x, y, y_error, x_error, fmt="none", ecolor=colour, elinewidth=0.8, alpha=0.3)
    for variant in dict.fromkeys(p.variant for p in shown):
        line = sorted((p for p in shown if p.variant == variant), key=lambda p: p.d_safe)
        x, y = [p.fr[0] for p in line], [p.vr[0] for p in line]
        if variant == OFF:
            axes.plot(x, y, "*", color=INK, markersize=12, zorder=5)
            continue
        look = _LOOKS[variant]
        axes.plot(x, y, color=look.colour, lw=1.2, marker=look.marker, markersize=4.5, zorder=4)
        labels += [Label(axes, place, text, look.colour) for place, text in _ends(line).items()]
    axes.set_xlim(left=min(0.0, axes.get_xlim()[0]))
    axes.set_ylim(bottom=min(0.0, axes.get_ylim()[0]))
    return labels


def _ends(line: Sequence[Point]) -> dict[tuple[float, float], str]:
    """Where a line begins and ends, and the d_safe there; both in one text where that is the same place.
    Nothing of a line with one d_safe: the note says it."""
    if line[0].d_safe == line[-1].d_safe:
        return {}
    found: dict[tuple[float, float], list[str]] = {}
    for p in dict.fromkeys((line[0], line[-1])):
        found.setdefault((p.fr[0], p.vr[0]), []).append(f"{p.d_safe:g}")
    return {place: "–".join(texts) for place, texts in found.items()}


def _arms(estimate: Estimate) -> list[list[float]]:
    """Lengths of an error bar below and above."""
    value, low, high = estimate
    return [[max(value - low, 0.0)], [max(high - value, 0.0)]]


def _handles(points: Sequence[Point]) -> list:
    from matplotlib.lines import Line2D

    variants = {p.variant for p in points}
    d_safe = sorted({p.d_safe for p in points if p.variant != OFF})
    numbers = f"d_safe {d_safe[0]:g} m" if len(d_safe) == 1 else "numbers: d_safe (m)"

    off = Line2D([], [], color=INK, marker="*", markersize=11, ls="none", label="filter off")
    rest = [
        Line2D([], [], color=look.colour, marker=look.marker, markersize=5, label=look.label)
        for variant, look in _LOOKS.items()
        if variant in variants
    ]
    note = Line2D([], [], ls="none", label=f"{numbers}; thin lines: 95 % intervals")
    return [off, *rest, note]
