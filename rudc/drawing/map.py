"""Still pictures of a whole junction: a grid of metres about its centre, arms by name, a caption above.

A grid's numbers are those that scenario files give as `position: [x, y]`.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from PIL import Image, ImageDraw

from rudc.arrays import Array
from rudc.drawing.canvas import FINE, Canvas, cut
from rudc.drawing.palette import FAINT_TEXT, GRID, INK, PANEL, PAPER
from rudc.drawing.road_picture import draw_road
from rudc.drawing.text import Line, font, panel, wrapped
from rudc.network.network import Network
from rudc.network.road import Arm

SIDE_PX = 940
"""pixels, each side of the map"""
TEXT_PX = 15.0
LEFT_PX, BELOW_PX = 54, 46
"""pixels for the grid's numbers"""
STEPS_M = (10.0, 20.0, 50.0, 100.0, 200.0, 500.0)
MOST_LINES = 16
"""of the grid, along each axis"""


def new_map(network: Network, reach_m: float) -> Canvas:
    """The road with a grid over it, `reach_m` each way from the junction's centre."""
    scale = FINE * SIDE_PX / (2 * reach_m)
    x, y = (float(v) for v in network.center)
    canvas = cut(
        draw_road(network, scale, reach_m), (x - reach_m, y + reach_m), FINE * SIDE_PX, FINE * SIDE_PX
    )
    for metre in ticks(reach_m):
        canvas.line(np.array([[x + metre, y - reach_m], [x + metre, y + reach_m]]), GRID, 1.0 / scale)
        canvas.line(np.array([[x - reach_m, y + metre], [x + reach_m, y + metre]]), GRID, 1.0 / scale)
    return canvas


def ticks(reach_m: float) -> list[float]:
    """m from the centre, places of the grid's lines."""
    step = next((s for s in STEPS_M if 2 * reach_m / s <= MOST_LINES), STEPS_M[-1])
    count = int(reach_m / step)
    return [step * k for k in range(-count, count + 1)]


def name_arms(canvas: Canvas, network: Network, reach_m: float) -> None:
    """Write each arm's name beside its road."""
    height, differ = TEXT_PX * FINE, len({arm.major for arm in network.arms}) > 1
    for arm in network.arms:
        text = arm.name.replace("_", " ") + (" (major)" if arm.major and differ else "")
        known = font(height)
        half = np.array([0.5 * known.getlength(text) + 8, 0.5 * height + 8]) / canvas.scale
        x, y = canvas.pixels(_beside(network, arm, reach_m, half)).tolist()
        canvas.draw.text(
            (x, y), text, fill=INK, font=known, anchor="mm", stroke_width=FINE * 2, stroke_fill=PAPER
        )


def finished(canvas: Canvas, reach_m: float, lines: Sequence[Line]) -> Image.Image:
    """The map with its caption above and the grid's numbers beside it."""
    width = LEFT_PX + SIDE_PX
    fitting = [part for line in lines for part in wrapped(line, width - 1.5 * TEXT_PX, TEXT_PX)]
    above = panel(fitting, width, TEXT_PX)
    picture = Image.new("RGB", (width, above.height + SIDE_PX + BELOW_PX), PANEL)
    picture.paste(above, (0, 0))
    picture.paste(canvas.image.reduce(FINE), (LEFT_PX, above.height))
    draw, small = ImageDraw.Draw(picture), font(TEXT_PX - 2)
    bottom = above.height + SIDE_PX
    for metre in ticks(reach_m):
        along = 0.5 * SIDE_PX * (1.0 + metre / reach_m)
        text = f"{metre:.0f}"
        if 8 < along < SIDE_PX - 8:
            draw.text((LEFT_PX + along, bottom + 5), text, fill=FAINT_TEXT, font=small, anchor="ma")
            draw.text((LEFT_PX - 6, bottom - along), text, fill=FAINT_TEXT, font=small, anchor="rm")
    words = "m east (across) and north (up) of the junction's centre, as `position: [x, y]` in scenario files"
    draw.text((LEFT_PX + 0.5 * SIDE_PX, bottom + 24), words, fill=FAINT_TEXT, font=small, anchor="ma")
    return picture


def _beside(network: Network, arm: Arm, reach_m: float, half: Array) -> Array:
    """(2,) m, where an arm's name of half size (2,) m lies clear of the road, near the arm's end in view."""
    out = np.array([np.cos(arm.bearing), np.sin(arm.bearing)])
    side = np.array([-out[1], out[0]])
    corners = np.array([(i, j) for i in np.linspace(-1, 1, 7) for j in (-1, 1)]) * half
    limit = reach_m - half - 1.0
    for away in np.arange(0.82, 0.3, -0.08) * min(reach_m, arm.length):
        for offset in np.arange(0.0, 0.5 * reach_m, 0.5):
            for sign in (1.0, -1.0):
                place = network.center + away * out + sign * offset * side
                place = np.clip(place, network.center - limit, network.center + limit)
                if network.surface.signed_distance(place + corners).max() < -1.0:
                    return place
    return network.center + 0.8 * reach_m * out
