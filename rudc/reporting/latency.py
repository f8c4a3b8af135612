"""Where the processor's time goes: a bar of parts for each agent; mean, 99th percentile and peak."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rudc.reporting.figures import FAINT, INK, PALETTE, grid

if TYPE_CHECKING:
    from matplotlib.axes import Axes

WHOLE = "all"
"""the part that is the whole decision"""
PERIOD_MS = 100.0
"""ms between decisions"""
_HATCHES = ("", "////", "....")


class Cost(NamedTuple):
    """What a part of an agent's decision takes, ms."""

    agent: str
    scenario: str
    """or what stands for all of them"""
    part: str
    mean: float
    p99: float
    peak: float


def draw_latency(costs: Sequence[Cost], whole: str, path: Path) -> Path:
    """Parts of the mean in each scenario on the left, spread in all of them (`whole`) on the right."""
    agents = list(dict.fromkeys(c.agent for c in costs))
    parts = list(dict.fromkeys(c.part for c in costs if c.part != WHOLE))
    scenarios = [name for name in dict.fromkeys(c.scenario for c in costs) if name != whole]
    size = (7.2, 1.7 + 0.34 * len(agents))
    with grid(1, 1 + len(scenarios), size, path, sharey=True) as (figure, panels):
        handles: list = []
        for axes, scenario in zip(panels[0], scenarios, strict=False):
            handles = _bars(axes, [c for c in costs if c.scenario == scenario], agents, parts)
            axes.set_title(scenario)
            axes.set_xlabel("mean of a decision (ms)")
        widest = max(axes.get_xlim()[1] for axes in panels[0, :-1])
        for axes in panels[0, :-1]:
            axes.set_xlim(0.0, widest)
        handles += _spread(
            panels[0, -1], [c for c in costs if (c.part, c.scenario) == (WHOLE, whole)], agents
        )
        panels[0, 0].set_yticks(range(len(agents)), agents)
        panels[0, 0].set_ylim(len(agents) - 0.4, -0.6)
        figure.legend(handles=handles, loc="outside lower center", ncols=6, fontsize=8.0)
    return path


def _bars(axes: Axes, costs: Sequence[Cost], agents: Sequence[str], parts: Sequence[str]) -> list:
    left = np.zeros(len(agents))
    handles = []
    for k, part in enumerate(parts):
        known = {c.agent: c.mean for c in costs if c.part == part}
        mean = np.array([known.get(agent, 0.0) for agent in agents])
        handles.append(
            axes.barh(
                range(len(agents)), mean, 0.68, left=left, color=PALETTE[k % len(PALETTE)],
                hatch=_HATCHES[k // len(PALETTE)], edgecolor="white", linewidth=0.5, label=part,
            )
        )  # fmt: skip
        left += mean
    axes.grid(axis="y", visible=False)
    return handles


def _spread(axes: Axes, wholes: Sequence[Cost], agents: Sequence[str]) -> list:
    y = [agents.index(c.agent) for c in wholes]
    axes.hlines(y, [c.mean for c in wholes], [c.peak for c in wholes], color=FAINT, lw=1.4, zorder=2)
    found = []
    for name, marker in (("mean", "o"), ("p99", "D"), ("peak", ">")):
        x = [getattr(c, name) for c in wholes]
        found += axes.plot(x, y, marker, color=INK, markersize=4.5, ls="none", zorder=3, label=name)
    found.append(axes.axvline(PERIOD_MS, color=PALETTE[1], lw=1.2, ls="--", label=f"{PERIOD_MS:g} ms"))
    axes.set_xscale("log")
    axes.set_title("all decisions")
    axes.set_xlabel("ms, logarithmic")
    axes.grid(axis="y", visible=False)
    return found
