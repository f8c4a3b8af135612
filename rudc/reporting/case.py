"""An episode, driven by several agents side by side: map, way over time, controls, sigma, time.

One legend serves all panels: yellow would not stand out on paper, so the ego is drawn in the colour of h, its
outline in ink, surrounding vehicles (SVs) blue, what events put on the road vermilion.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from rudc.arrays import Array
from rudc.drawing.bodies import BODY, placed
from rudc.reporting.figures import FAINT, INK, PALETTE, bare, grid

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

HALF_M = 26.0
"""m, half the side of the map"""
BESIDE_M = 2.5
"""m beside the ego's route, within which somebody stands in the picture of ways over time"""
EVERY_S = 2.0
"""s between two outlines of the ego"""
HIGHEST_H = 25.0
"""m2, h from which on colours do not change"""
SV, EVENT, CORRECTED = PALETTE[0], PALETTE[1], PALETTE[3]
ROAD = "#eceef1"
OUTCOMES = {"success": "arrives", "frozen": "frozen", "collision": "collides", "off_road": "leaves the road",
            "wrong_way": "wrong way"}  # fmt: skip


class Track(NamedTuple):
    """Somebody else's way."""

    name: str
    is_event: bool
    """whether an event put it on the road or took hold of it"""
    size: Array
    """(2,) m, length and width"""
    way: Array
    """(n, 6) time s, x m, y m, heading rad, arc length along the ego's route m, offset from it m"""


class Case(NamedTuple):
    """An episode."""

    label: str
    """name of the agent in figures"""
    outcome: str
    duration_s: float
    ego: Mapping[str, Array]
    """column -> (n,) of the scenes in which it decided, see rudc/studies/case.py"""
    least_h_m2: float
    """the smallest h of these scenes and of the last one"""
    tracks: tuple[Track, ...]
    size: Array
    """(2,) m, the ego's length and width"""
    road: tuple[Array, ...]
    """(K, 2) m each, drivable area about the junction's centre"""
    center: Array
    """(2,) m, of the junction"""
    path: Array
    """(M, 2) m, the ego's route about the centre"""


Panel = Callable[["Axes", Case], None]


def draw_cases(
    cases: Sequence[Case],
    path: Path,
    rows: Sequence[str],
    extra: Mapping[str, Panel] | None = None,
) -> Path:
    """A column for each case; `rows`: names of `PANELS`, from the top, or of `extra` ones."""
    panels_of = {**PANELS, **(extra or {})}
    heights = [1.0 if name in ("map", "density") else 0.62 for name in rows]
    wide = 7.2 / len(cases)
    size = (7.2, 0.7 + wide * 0.86 * sum(heights))
    with grid(len(rows), len(cases), size, path, height_ratios=heights) as (figure, panels):
        for i, name in enumerate(rows):
            for axes, case in zip(panels[i], cases, strict=True):
                axes.tick_params(labelsize=7.5)
                panels_of[name](axes, case)
                _label(axes, name, first=axes is panels[i, 0])
            _same_height(panels[i], name)
        for axes, case in zip(panels[0], cases, strict=True):
            axes.set_title(f"{case.label}\n{OUTCOMES.get(case.outcome, case.outcome)}", fontsize=8.5)
        timed = [i for i, name in enumerate(rows) if name in TIMED]
        for k, case in enumerate(cases):
            for i in timed:
                panels[i, k].set_xlim(0.0, float(case.ego["time_s"][-1]) + 0.1)
                panels[i, k].tick_params(labelbottom=i == timed[-1])
            panels[timed[-1], k].set_xlabel("time (s)", fontsize=8.5)
        _colour_bar(figure, panels[: max(1, rows.index("way") + 1 if "way" in rows else 1)])
        figure.legend(handles=_handles(rows), loc="outside lower center", ncols=5, fontsize=7.5)
    return path


def _label(axes: Axes, name: str, *, first: bool) -> None:
    if first:
        axes.set_ylabel(LABELS.get(name, name), fontsize=8.5)
    else:
        axes.tick_params(labelleft=False)


def _same_height(row: Array, name: str) -> None:
    """The same limits in all panels of a row."""
    if name == "map":
        return
    lows, highs = zip(*(axes.get_ylim() for axes in row), strict=True)
    for axes in row:
        axes.set_ylim(min(lows), max(highs))


def draw_map(axes: Axes, case: Case) -> None:
    """The junction from above: where all went, and where they were every EVERY_S while the ego was there."""
    from matplotlib.collections import PolyCollection

    axes.add_collection(PolyCollection(list(case.road), facecolor=ROAD, edgecolor=ROAD, lw=0.4, zorder=0))
    axes.plot(*case.path.T, color=FAINT, lw=0.8, ls=":", zorder=1)
    begin, end = _window(case)
    for track in case.tracks:
        way = track.way[(track.way[:, 0] >= begin) & (track.way[:, 0] <= end)]
        if not len(way):
            continue
        colour = EVENT if track.is_event else SV
        axes.plot(*(way[:, 1:3] - case.center).T, color=colour, lw=0.6, alpha=0.5, zorder=2)
        outlines = placed(BODY, way[-1:, 1:3] - case.center, way[-1:, 3], track.size[None])
        axes.add_collection(
            PolyCollection(list(outlines), facecolor="white", edgecolor=colour, lw=0.9, zorder=3)
        )
    place = np.column_stack([case.ego["x_m"], case.ego["y_m"]]) - case.center
    _coloured(axes, place, case.ego["h_m2"])
    shown = _outlined(case, place, np.arange(begin, end + 1e-6, EVERY_S))
    size = np.repeat(case.size[None], len(shown), axis=0)
    outlines = placed(BODY, place[shown], case.ego["heading_rad"][shown], size)
    axes.add_collection(PolyCollection(list(outlines), facecolor="none", edgecolor=INK, lw=0.6, zorder=5))
    axes.set_xlim(-HALF_M, HALF_M)
    axes.set_ylim(-HALF_M, HALF_M)
    axes.set_xlabel("x (m)", fontsize=8.5)
    axes.set_aspect("equal")
    axes.grid(False)


def _outlined(case: Case, place: Array, times: Array) -> list[int]:
    """Decisions at those times (s), but for those at which the ego stands where it was drawn already; and the
    last.
    """
    shown: list[int] = []
    for k in [*(int(np.argmin(np.abs(case.ego["time_s"] - t))) for t in times), len(place) - 1]:
        if not shown or np.hypot(*(place[k] - place[shown[-1]])) > 1.0:
            shown.append(k)
    return shown


def _window(case: Case) -> tuple[float, float]:
    """s, from when until when the ego is on the map; the whole episode if it never is."""
    away = np.maximum(np.abs(case.ego["x_m"] - case.center[0]), np.abs(case.ego["y_m"] - case.center[1]))
    there = case.ego["time_s"][away <= HALF_M]
    return (float(there[0]), float(there[-1])) if len(there) else (0.0, float(case.ego["time_s"][-1]))


def _coloured(axes: Axes, points: Array, h: Array) -> Any:
    """A line along points (n, 2) in the colours of h (n,)."""
    from matplotlib.collections import LineCollection

    pieces = np.stack([points[:-1], points[1:]], axis=1)
    line = LineCollection(list(pieces), cmap="viridis", lw=2.4, zorder=4, capstyle="round")
    line.set_array(np.minimum(h[:-1], 1e6))
    line.set_clim(0.0, HIGHEST_H)
    return axes.add_collection(line)


def draw_way(axes: Axes, case: Case) -> None:
    """Arc length along the route over time: the ego in the colours of h, and who is in its way."""
    for track in case.tracks:
        near = track.way[np.abs(track.way[:, 5]) <= BESIDE_M]
        colour = EVENT if track.is_event else SV
        axes.plot(near[:, 0], near[:, 4], ".", color=colour, markersize=1.6, zorder=2)
    _coloured(axes, np.column_stack([case.ego["time_s"], case.ego["route_s_m"]]), case.ego["h_m2"])
    s = case.ego["route_s_m"]
    axes.set_ylim(float(s.min()) - 3.0, float(s.max()) + 8.0)
    _shade(axes, case)


def _shade(axes: Axes, case: Case) -> None:
    axes.axvspan(*_window(case), color="#f1f1ee", lw=0, zorder=0)


def _control(proposed: str, applied: str) -> Panel:
    def draw(axes: Axes, case: Case) -> None:
        _shade(axes, case)
        t, before, after = case.ego["time_s"], case.ego[proposed], case.ego[applied]
        axes.fill_between(t, before, after, color=CORRECTED, alpha=0.5, lw=0, zorder=2)
        axes.plot(t, before, color=SV, lw=0.8, zorder=3)
        axes.plot(t, after, color=INK, lw=1.0, zorder=4)

    return draw


def draw_correction(axes: Axes, case: Case) -> None:
    """Size of the correction over time."""
    _shade(axes, case)
    axes.fill_between(case.ego["time_s"], case.ego["correction"], color=CORRECTED, lw=0.8, zorder=2)
    axes.set_ylim(0.0, max(0.05, 1.05 * float(case.ego["correction"].max())))


def draw_sigma(axes: Axes, case: Case) -> None:
    """Uncertainty over time."""
    if not np.isfinite(case.ego["sigma_total"]).any():
        bare(axes, "states none")
        return
    _shade(axes, case)
    for name, colour in (("sigma_ale", PALETTE[5]), ("sigma_epi", PALETTE[4]), ("sigma_total", INK)):
        axes.plot(case.ego["time_s"], case.ego[name], color=colour, lw=1.0, zorder=3)
    axes.set_ylim(0.0, axes.get_ylim()[1])


def draw_time(axes: Axes, case: Case) -> None:
    """Time of the processor, part on part."""
    _shade(axes, case)
    parts = [case.ego[f"{part}_ms"] for part in ("HOCBF", "critics", "policy", "rest")]
    axes.stackplot(case.ego["time_s"], *parts, colors=_TIMES.values(), lw=0, zorder=2)
    axes.set_ylim(0.0, 1.1 * float(np.percentile(np.sum(parts, axis=0), 97)))


_TIMES = {"HOCBF": PALETTE[3], "critics": PALETTE[2], "policy": PALETTE[1], "rest": FAINT}
PANELS: dict[str, Panel] = {
    "map": draw_map,
    "way": draw_way,
    "acceleration": _control("proposed_acceleration_mps2", "acceleration_mps2"),
    "steering": _control("proposed_steering_rad", "steering_rad"),
    "correction": draw_correction,
    "sigma": draw_sigma,
    "time": draw_time,
}
TIMED = ("way", "acceleration", "steering", "correction", "sigma", "time")
"""panels over time"""
LABELS = {
    "map": "y (m)",
    "way": "along the\nroute (m)",
    "acceleration": "acceleration\n(m/s²)",
    "steering": "steering\n(rad)",
    "correction": "correction",
    "density": "correction\n(half ranges)",
    "sigma": r"$\sigma$ (reward)",
    "time": "decision\n(ms)",
}


def _colour_bar(figure: Figure, panels: np.ndarray[Any, Any]) -> None:
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    shown = ScalarMappable(Normalize(0.0, HIGHEST_H), "viridis")
    bar = figure.colorbar(shown, ax=panels.ravel().tolist(), extend="both", aspect=30, pad=0.01)
    bar.set_label("h towards vehicles (m²)", fontsize=8.5)
    bar.ax.tick_params(labelsize=7.5)


def _handles(rows: Sequence[str]) -> list:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    found: list = [
        Line2D([], [], color=SV, marker=".", lw=0.8, label="SVs"),
        Line2D([], [], color=EVENT, marker=".", lw=0.8, label="of an event"),
        Patch(facecolor="none", edgecolor=INK, lw=0.6, label=f"EV every {EVERY_S:g} s"),
        Patch(color="#f1f1ee", label="EV on the map"),
    ]
    if "acceleration" in rows:
        found += [
            Line2D([], [], color=SV, lw=0.8, label="proposed"),
            Line2D([], [], color=INK, lw=1.0, label="applied"),
            Patch(color=CORRECTED, label="changed by filter, outlook"),
        ]
    if "density" in rows:
        found += [
            Patch(color="#9ecae1", label="decisions (log)"),
            Line2D([], [], color=INK, lw=1.3, label="median"),
            Line2D([], [], color=PALETTE[1], lw=1.3, label="90th percentile"),
            Line2D([], [], color=INK, lw=0.9, ls="--", label="turning point"),
        ]
    if "sigma" in rows:
        names = ((INK, "total"), (PALETTE[4], "epi"), (PALETTE[5], "ale"))
        found += [Line2D([], [], color=c, lw=1.0, label=rf"$\sigma_{{{name}}}$") for c, name in names]
    if "time" in rows:
        found += [Patch(color=colour, label=f"{part} (ms)") for part, colour in _TIMES.items()]
    return found
