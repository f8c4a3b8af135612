"""Draws a network and routes over it with matplotlib (object interface, Agg: no window, no global state)."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from rudc.arrays import Array
from rudc.network.polyline import offset_polyline, resample, strip
from rudc.network.road import Arm, Lane

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from rudc.network.network import Network
    from rudc.network.route import Route

GRASS, ASPHALT, PAINT, DIVIDER = "#dfe6d5", "#5c6066", "#f4f4f0", "#e8c547"
LABEL = "#2b2f36"
ROUTE_COLOURS = {"left": "#ff7f50", "straight": "#58c4f6", "right": "#7be07b", "u_turn": "#c792ea"}


def new_axes(inches: float = 8.0, dpi: int = 120) -> Axes:
    """Axes that fill a new figure of their own."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(inches, inches), dpi=dpi)
    FigureCanvasAgg(figure)
    return figure.add_axes((0.0, 0.0, 1.0, 1.0))


def save(axes: Axes, path: str | Path) -> Path:
    """Writes the figure of `axes` to an image file."""
    target = Path(path)
    target.parent.mkdir(parents=True, exist_ok=True)
    figure = axes.get_figure(root=True)
    if figure is not None:
        figure.savefig(target)
    return target


def draw_network(
    network: Network,
    axes: Axes | None = None,
    *,
    extent: float | None = None,
    labels: bool = True,
    arrows: bool = True,
) -> Axes:
    """The road: asphalt, edges, lane markings, stop lines, arm names. `extent`: m shown each way from the
    centre."""
    axes = new_axes() if axes is None else axes
    reach = network.half_extent if extent is None else extent
    axes.set_facecolor(GRASS)
    _draw_asphalt(axes, network)
    for arm in network.arms:
        _draw_markings(axes, network, arm)
        if arrows:
            _draw_arrows(axes, network, arm)
    axes.set_aspect("equal")
    axes.set_xlim(network.center[0] - reach, network.center[0] + reach)
    axes.set_ylim(network.center[1] - reach, network.center[1] + reach)
    axes.set_xticks([])
    axes.set_yticks([])
    axes.spines[:].set_visible(False)
    if labels:
        _draw_labels(axes, network, reach)
    return axes


def draw_route(
    axes: Axes, route: Route, *, edges: bool = True, points: bool = True, colour: str | None = None
) -> None:
    """A route's path, its carriageway's edges, and where it stops (bar), waits (dot) and meets others
    (thick)."""
    colour = colour or ROUTE_COLOURS[route.turn]
    path = route.path
    for other in route.alternatives:
        axes.plot(*other.xy.T, color=colour, lw=1.0, ls=":", zorder=6)
    axes.plot(*path.xy.T, color=colour, lw=1.8, zorder=7)
    zone = (path.s >= route.zone_start_s) & (path.s <= route.zone_end_s)
    axes.plot(*path.xy[zone].T, color=colour, lw=4.5, alpha=0.45, zorder=6)
    if edges:
        axes.plot(*route.left_edge.T, color="#ff5d8f", lw=0.9, zorder=5)
        axes.plot(*route.right_edge.T, color="#ffb3c6", lw=0.9, zorder=5)
    if points:
        _bar(axes, route, route.stop_line_s, colour)
        _bar(axes, route, route.exit_s, colour)
        x, y, _ = path.pose(route.waiting_s)
        axes.plot([float(x)], [float(y)], "o", color=colour, mec="black", mew=0.6, ms=5, zorder=8)


def draw_ways(axes: Axes, network: Network) -> None:
    """All lane-to-lane ways of `network.paths` as thin lines, coloured by turn."""
    for movement in network.movements:
        for row in movement.rows:
            stations = int(network.paths.length[row] / network.paths.ds) + 1
            axes.plot(
                *network.paths.xy[row, :stations].T, color=ROUTE_COLOURS[movement.turn], lw=0.8, alpha=0.8
            )


def _bar(axes: Axes, route: Route, s: float, colour: str) -> None:
    x, y, psi = (float(v) for v in route.path.pose(s))
    dx, dy = -np.sin(psi), np.cos(psi)
    axes.plot([x - dx, x + dx], [y - dy, y + dy], color=colour, lw=2.0, zorder=7)


def _draw_asphalt(axes: Axes, network: Network) -> None:
    from matplotlib.collections import LineCollection, PolyCollection

    patches = PolyCollection(
        list(network.surface.polygons), facecolors=ASPHALT, edgecolors=ASPHALT, lw=0.6, zorder=1
    )
    axes.add_collection(patches)
    edge = LineCollection(list(network.surface.boundary), colors=PAINT, lw=1.0, zorder=2, capstyle="round")
    axes.add_collection(edge)


def _draw_markings(axes: Axes, network: Network, arm: Arm) -> None:
    """Dashes between lanes of one direction, the divider to oncoming ones, and the stop or give-way line."""
    inbound, outbound = (_lanes(network, ids) for ids in (arm.in_lanes, arm.out_lanes))
    for lane in (*inbound[:-1], *outbound[:-1]):
        axes.plot(*_beside(lane, 0.5).T, color=PAINT, lw=0.9, dashes=(6, 7), zorder=3)
    if inbound and outbound:
        axes.plot(*_beside(inbound[-1], 0.5).T, color=DIVIDER, lw=1.3, zorder=3)
    if inbound:
        line = np.array([_beside(inbound[-1], 0.5)[-1], _beside(inbound[0], -0.5)[-1]])
        must_stop = not any(other.major for other in network.arms) and not network.is_roundabout
        width, style = (1.2, (0, (1.2, 1.2))) if arm.major else (3.0, "-" if must_stop else (0, (1.4, 0.7)))
        axes.plot(
            *line.T, color=PAINT, lw=width, ls=style, zorder=4, solid_capstyle="butt", dash_capstyle="butt"
        )


def _beside(lane: Lane, share: float) -> Array:
    """(K, 2) m, the lane's centre line moved to the left by a share of its width."""
    return offset_polyline(lane.xy, share * lane.width)


def _lanes(network: Network, ids: Sequence[str]) -> list[Lane]:
    return [network.lanes[lane_id] for lane_id in ids]


def _draw_arrows(axes: Axes, network: Network, arm: Arm) -> None:
    """Painted arrows before the stop line: where each inbound lane leads."""
    from matplotlib.collections import PolyCollection

    angles: dict[str, set[float]] = {}
    for movement in network.movements:
        if movement.origin == arm.name and movement.turn != "u_turn":
            for row in movement.rows:
                angles.setdefault(network.inbound_lane(row).id, set()).add(movement.angle)
    pieces = []
    for lane_id, turns in angles.items():
        back = network.lanes[lane_id].xy[::-1]
        knee, tail = resample(back, np.array([6.5, 9.5]))
        psi = float(np.arctan2(*(knee - tail)[::-1]))
        pieces.append(strip(np.array([tail, knee]), 0.16))
        for turn in turns:
            bend = psi + float(np.clip(turn, -1.2, 1.2))
            u, v = np.array([np.cos(bend), np.sin(bend)]), np.array([-np.sin(bend), np.cos(bend)])
            neck = knee + (1.1 if abs(turn) > 0.3 else 1.8) * u
            pieces.append(strip(np.array([knee - 0.08 * u, neck]), 0.16))
            pieces.append(np.array([neck + 0.38 * v, neck + 1.0 * u, neck - 0.38 * v]))
    axes.add_collection(PolyCollection(pieces, facecolors=PAINT, lw=0, zorder=3))


def _draw_labels(axes: Axes, network: Network, reach: float) -> None:
    for arm in network.arms:
        out = np.array([np.cos(arm.bearing), np.sin(arm.bearing)])
        away = min(0.8 * reach, 0.8 * arm.length + 20.0)
        x, y = network.center + away * out + _label_side(network, arm, away, reach)
        text = arm.name.replace("_", " ") + (" (major)" if arm.major else "")
        axes.text(float(x), float(y), text, color=LABEL, fontsize=10, ha="center", va="center", zorder=9)


def _label_side(network: Network, arm: Arm, away: float, reach: float) -> Array:
    """(2,) m from a point `away` m out on the arm's axis, to its left, to where its name clears the road."""
    out = np.array([np.cos(arm.bearing), np.sin(arm.bearing)])
    side = np.array([-out[1], out[0]])
    half_text = reach * (0.035 + 0.11 * abs(side[0]))
    for offset in np.arange(0.0, reach, reach / 50):
        if network.surface.signed_distance(network.center + away * out + offset * side) < -half_text:
            return offset * side
    return 0.2 * reach * side


def polygon_of(x: float, y: float, psi: float, length: float, width: float) -> Array:
    """(4, 2) m, corners of a rectangle about (x, y), counter-clockwise: for drawing vehicles and boxes."""
    u, v = np.array([np.cos(psi), np.sin(psi)]), np.array([-np.sin(psi), np.cos(psi)])
    half = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * 0.5
    return np.array([x, y]) + half[:, :1] * length * u + half[:, 1:] * width * v


def draw_rectangles(axes: Axes, rectangles: Iterable[Array], colour: str, *, zorder: float = 10.0) -> None:
    """Filled polygons, such as vehicles by `polygon_of`."""
    from matplotlib.collections import PolyCollection

    patches = PolyCollection(list(rectangles), facecolors=colour, edgecolors="black", lw=0.6, zorder=zorder)
    axes.add_collection(patches)
