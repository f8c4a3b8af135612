"""Uncertainty against correction: how many decisions where, and from what sigma on there are corrections."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from rudc.arrays import Array
from rudc.reporting.case import Case, Panel
from rudc.reporting.figures import INK, PALETTE, bare

if TYPE_CHECKING:
    from matplotlib.axes import Axes


class Cloud(NamedTuple):
    """Decisions of an agent."""

    sigma: Array
    """(n,) reward units"""
    correction: Array
    """(n,) |u - u_rl|, both numbers scaled to [-1, 1]"""
    bins: tuple[Any, ...] = ()
    """see rudc/studies/turning.py"""
    turning: float = math.nan
    """sigma from which on the median is above zero; nan if it never is"""
    turning_p90: float = math.nan
    """the same of the 90th percentile"""


def density(clouds: Mapping[str, Cloud]) -> Panel:
    """A panel that shows the cloud of the case's agent; all have the same axes."""
    known = [cloud for cloud in clouds.values() if len(cloud.sigma)]
    right = max((float(np.percentile(c.sigma, 99.5)) for c in known), default=1.0)
    top = max((float(np.percentile(c.correction, 99.8)) for c in known), default=1.0)

    def draw(axes: Axes, case: Case) -> None:
        _draw(axes, clouds[case.label], right, max(top, 0.1))

    return draw


def _draw(axes: Axes, cloud: Cloud, right: float, top: float) -> None:
    axes.set_xlabel(r"$\sigma_{total}$ (reward)", fontsize=8.5)
    axes.set_xlim(0.0, right)
    axes.set_ylim(0.0, 1.4 * top)
    if not len(cloud.sigma):
        bare(axes, "states no sigma")
        return
    if not cloud.bins:
        bare(axes, "corrects nothing")
        return
    axes.hexbin(
        cloud.sigma, cloud.correction, gridsize=(28, 16), extent=(0.0, right, 0.0, top), bins="log",
        cmap="Blues", mincnt=1, linewidths=0.1, zorder=1,
    )  # fmt: skip
    at = [b.sigma for b in cloud.bins]
    for name, colour, turning in (("median", INK, cloud.turning), ("p90", PALETTE[1], cloud.turning_p90)):
        low, high = ([getattr(b, f"{name}_{end}") for b in cloud.bins] for end in ("low", "high"))
        axes.fill_between(at, low, high, color=colour, alpha=0.2, lw=0, zorder=2)
        axes.plot(at, [getattr(b, name) for b in cloud.bins], color=colour, lw=1.3, zorder=3)
        if not math.isnan(turning):
            axes.axvline(turning, color=colour, lw=0.9, ls="--", zorder=3)
    both = (("median", cloud.turning), ("p90", cloud.turning_p90))
    told = "\n".join(f"{name} {'never' if math.isnan(at) else f'at {at:.2f}'}" for name, at in both)
    axes.text(0.97, 0.97, told, transform=axes.transAxes, ha="right", va="top", fontsize=7.0)
