"""Grids of a filter's rates: TTCBF's as lines, ECBF's two as maps; a row for each driver and choice of
vehicles.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rudc.evaluation.text import MISSING
from rudc.reporting.figures import INK, PALETTE, grid

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Line = Mapping[str, Any]
_RATES = (("SR", PALETTE[2], "o"), ("FR", PALETTE[4], "s"), ("VR", PALETTE[1], "^"))
_MAPS = ("SR", "FR", "VR")


def draw_grid(lines: Sequence[Line], paper: Mapping[str, tuple[float, ...]], path: Path) -> Path:
    """Rates (%) over lambda with 95 % intervals; over lambda1 and lambda2 as numbers on colours. A dashed
    line or frame marks the paper's choice; a ring or a full frame marks what the paper's rule chooses here.
    """
    drivers = list(dict.fromkeys((line["driver"], line["constrained"]) for line in lines))
    size = (7.2, 0.5 + 2.0 * len(drivers))
    with grid(len(drivers), 4, size, path, width_ratios=[1.35, 1, 1, 1]) as (figure, panels):
        for i, driver in enumerate(drivers):
            own = [line for line in lines if (line["driver"], line["constrained"]) == driver]
            _lines(panels[i, 0], [m for m in own if m["rule"] == "ttcbf"], paper["ttcbf"][0])
            panels[i, 0].set_ylabel(f"{driver[0]}, {driver[1]}\nepisodes (%)", fontsize=8.5)
            for axes, rate in zip(panels[i, 1:], _MAPS, strict=True):
                _map(axes, [m for m in own if m["rule"] == "ecbf"], rate)
                if i == 0:
                    axes.set_title(f"ECBF: {rate} (%)", fontsize=8.5)
            panels[i, 1].set_ylabel("λ₂ (1/s)", fontsize=8.5)
        panels[0, 0].set_title("TTCBF", fontsize=8.5)
        panels[-1, 0].set_xlabel("λ, logarithmic", fontsize=8.5)
        for axes in panels[-1, 1:]:
            axes.set_xlabel("λ₁ (1/s)", fontsize=8.5)
        figure.legend(handles=_handles(), loc="outside lower center", ncols=5, fontsize=7.5)
    return path


def _lines(axes: Axes, members: Sequence[Line], paper: float) -> None:
    x = [m["rate1"] for m in members]
    for rate, colour, marker in _RATES:
        y = np.array([m[rate] for m in members])
        low, high = (np.array([m[f"{rate}_{end}"] for m in members]) for end in ("low", "high"))
        axes.fill_between(x, low, high, color=colour, alpha=0.15, lw=0)
        axes.plot(x, y, color=colour, marker=marker, markersize=3.5, lw=1.2)
        chosen = [(m["rate1"], m[rate]) for m in members if m["chosen"]]
        axes.plot([x for x, _ in chosen], [y for _, y in chosen], "o", mfc="none", mec=INK, markersize=8)
    axes.axvline(paper, color=INK, lw=0.9, ls="--")
    axes.set_xscale("log")
    axes.set_xticks([0.05, 0.1, 0.2, 0.5, 1.0], ["0.05", "0.1", "0.2", "0.5", "1"], fontsize=7.5)
    axes.minorticks_off()
    axes.set_ylim(-3.0, 103.0)
    axes.tick_params(labelsize=7.5)


def _map(axes: Axes, members: Sequence[Line], rate: str) -> None:
    from matplotlib.patches import Rectangle

    values = sorted({m["rate1"] for m in members} | {m["rate2"] for m in members})
    table = np.full((len(values), len(values)), np.nan)
    for m in members:
        table[values.index(m["rate2"]), values.index(m["rate1"])] = m[rate]
    colours = "Greens" if rate == "SR" else "Oranges"
    axes.imshow(
        np.ma.masked_invalid(table), cmap=colours, vmin=0.0, vmax=170.0, origin="lower", aspect="auto"
    )
    for m in members:
        k, i = values.index(m["rate1"]), values.index(m["rate2"])
        axes.text(
            k,
            i,
            MISSING if np.isnan(m[rate]) else f"{m[rate]:.0f}",
            ha="center",
            va="center",
            fontsize=7.0,
            color=INK,
        )
        for key, style in (("paper", "--"), ("chosen", "-")):
            if m[key]:
                inset = 0.44 if key == "chosen" else 0.34
                frame = (k - inset, i - inset), 2 * inset, 2 * inset
                axes.add_patch(Rectangle(*frame, fill=False, edgecolor=INK, lw=1.2, ls=style))
    names = [f"{value:g}" for value in values]
    axes.set_xticks(range(len(values)), names, fontsize=7.0)
    axes.set_yticks(range(len(values)), names, fontsize=7.0)
    axes.grid(False)
    axes.set_facecolor("white")


def _handles() -> list:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    found: list = [
        Line2D([], [], color=colour, marker=marker, markersize=3.5, lw=1.2, label=rate)
        for rate, colour, marker in _RATES
    ]
    found.append(Patch(facecolor="none", edgecolor=INK, ls="--", label="the paper's choice"))
    found.append(Patch(facecolor="none", edgecolor=INK, label="fewest violations here (ring, frame)"))
    return found
