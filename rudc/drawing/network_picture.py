"""A picture of a network: its road, its arms, and every route through the junction that scenarios may use.

A route, one for each lane that it may begin on, is coloured by its turn: its path (thick where it meets
traffic of other arms), lines to other lanes of the same arm (thin), a bar where it stops, and if it yields
a dot where it waits inside the junction.
"""

from __future__ import annotations

import numpy as np
from PIL import Image

from rudc.drawing.canvas import Canvas
from rudc.drawing.caption import GAP
from rudc.drawing.map import finished, name_arms, new_map
from rudc.drawing.palette import FAINT_TEXT, INK, TEXT, TURNS, faint
from rudc.drawing.text import Line
from rudc.network.network import Network
from rudc.network.polyline import offset_polyline, strip
from rudc.network.route import Route

LEAST_M = 70.0
"""m shown at least each way from the junction's centre, if the arms are that long"""
BESIDE_M = 45.0
"""m shown at least around the junction itself"""
LEGEND = (
    "thick: meets traffic of other arms;  thin: to other lanes;  bar: stop line;  dot: where it waits inside"
)
ASIDE_M: dict[str, float] = {"left": 0.35, "straight": 0.0, "right": -0.35}
"""m by which a route is drawn to the left of its path, so that routes do not hide each other"""


def draw_network(network: Network) -> Image.Image:
    """The picture of a network."""
    size = max(float(np.abs(polygon - network.center).max()) for polygon in network.node_polygons)
    reach = min(network.half_extent, max(LEAST_M, size + BESIDE_M))
    canvas = new_map(network, reach)
    for movement in network.onward:
        for lane in sorted({network.inbound_lane(row).index for row in movement.rows}):
            route = network.route(movement.origin, movement.destination, lane)
            draw_route(canvas, route, yields=not movement.major)
    name_arms(canvas, network, reach)
    turns = sorted({movement.turn for movement in network.onward}, key=list(TURNS).index)
    names = tuple((f"{turn}{GAP}", TURNS[turn]) for turn in turns)
    lines: list[Line] = [((network.name, TEXT),), names, ((LEGEND, FAINT_TEXT),)]
    return finished(canvas, reach, lines)


def draw_route(canvas: Canvas, route: Route, *, yields: bool) -> None:
    """One route, and if it `yields` where it waits."""
    colour, path = TURNS[route.turn], route.path
    line = offset_polyline(path.xy, ASIDE_M[route.turn])
    for other in route.alternatives:
        canvas.line(other.xy, colour, 0.1)
    zone = (path.s >= route.zone_start_s) & (path.s <= route.zone_end_s)
    if zone.sum() > 1:
        canvas.area(strip(line[zone], 0.9), faint(colour, 120))
    canvas.line(line, colour, 0.25)
    x, y, psi = (float(v) for v in path.pose(route.stop_line_s))
    across = np.array([-np.sin(psi), np.cos(psi)])
    canvas.line(np.array([x, y]) + np.array([-across, across]), colour, 0.5)
    if yields:
        x, y, _ = (float(v) for v in path.pose(route.waiting_s))
        canvas.dot(x, y, 0.65, INK)
        canvas.dot(x, y, 0.5, colour)
