"""How columns are distributed: Gaussian kernel densities of each scenario and agent, Scott's bandwidth
s n^(-1/5), as scipy.stats.gaussian_kde has them, but at least the distance of a curve's points, between which
a narrower one would be lost; written out, since scipy's is far slower for hundreds of them.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from rudc.arrays import Array, Index
from rudc.evaluation.columns import COLUMNS
from rudc.reporting.report.episodes import Episodes

SHOWN = (
    "min_dtc_m", "mean_speed_mps", "duration_s", "episode_reward", "mean_correction", "mean_sigma",
    "max_sigma", "decision_ms_mean", "density", "first_event_s",
)  # fmt: skip
POINTS = 72
"""points of a curve"""
MOST = 300
"""scenarios x agents up to which each scenario has curves of its own"""
LEAST = 5
"""values that a curve needs"""
_TOP = 999


def densities(episodes: Episodes) -> list[dict[str, Any]]:
    """Of each column of `SHOWN` that says anything: `low`, `high` (ends of the curves) and `places`: for each
    scenario, or -1 for all, `top` (the density that 999 stands for) and for each agent [n, mean, 5 %, median,
    95 %, curve]; a curve is None where there are few values, or equal ones.
    """
    pairs = len(episodes.scenarios) * len(episodes.agents)
    places = range(len(episodes.scenarios)) if pairs <= MOST and len(episodes.scenarios) > 1 else range(0)
    where = [(-1, np.flatnonzero(episodes.done)), *((k, _of(episodes, k)) for k in places)]
    found = []
    for name in SHOWN:
        values = episodes.number(name)
        known = values[episodes.done & ~np.isnan(values)]
        if len(known) < LEAST or known.min() == known.max():
            continue
        low, high = np.quantile(known, [0.002, 0.998])
        if low == high:
            low, high = known.min(), known.max()
        grid = np.linspace(low, high, POINTS)
        found.append({
            "name": name, "unit": COLUMNS[name].unit, "text": COLUMNS[name].text,
            "low": float(f"{low:.9g}"), "high": float(f"{high:.9g}"),
            "places": [_place(episodes, k, values, at, grid) for k, at in where],
        })  # fmt: skip
    return found


def _of(episodes: Episodes, scenario: int) -> Index:
    return np.flatnonzero(episodes.done & (episodes.scenario == scenario))


def _place(episodes: Episodes, place: int, values: Array, at: Index, grid: Array) -> dict[str, Any]:
    samples = [values[at[episodes.agent[at] == j]] for j in range(len(episodes.agents))]
    samples = [sample[~np.isnan(sample)] for sample in samples]
    curves = [_curve(sample, grid) for sample in samples]
    top = max((float(curve.max()) for curve in curves if curve is not None), default=0.0)
    lines = []
    for sample, curve in zip(samples, curves, strict=True):
        if len(sample) == 0:
            lines.append([0, None, None, None, None, None])
            continue
        told = (sample.mean(), *np.quantile(sample, [0.05, 0.5, 0.95]))
        scaled = None if curve is None or top == 0.0 else np.rint(_TOP * curve / top).astype(int).tolist()
        lines.append([len(sample), *(float(f"{v:.5g}") for v in told), scaled])
    return {"place": place, "top": float(f"{top:.3g}") if math.isfinite(top) else 0.0, "agents": lines}


def _curve(sample: Array, grid: Array) -> Array | None:
    """Density at the grid's points; None where it has none."""
    if len(sample) < LEAST or np.ptp(sample) < 1e-9 * max(float(np.abs(sample).max()), 1.0):
        return None
    n = len(sample)
    width = max(float(sample.std(ddof=1)) * n**-0.2, float(grid[1] - grid[0]))
    away = (grid[:, None] - sample) / width
    return np.exp(-0.5 * away**2).sum(axis=1) / (n * width * math.sqrt(2.0 * math.pi))
