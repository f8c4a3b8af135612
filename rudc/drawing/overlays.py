"""What lies over the road: the ego's path, what its sensors do not reach, what its safety filter acts on."""

from __future__ import annotations

import math

import numpy as np
from PIL import Image, ImageDraw

from rudc.arrays import Array
from rudc.drawing.canvas import Canvas
from rudc.drawing.palette import (
    ACTIVE,
    CONSTRAINED,
    EGO,
    EVENT,
    INK,
    OCCLUDER,
    PATH,
    SENSED,
    faint,
)
from rudc.drawing.view import Driving, View
from rudc.geometry import rectangle_corners
from rudc.network.polyline import strip
from rudc.world.scene import Scene

KEPT_M = 0.6
"""m by which the ellipse drawn about somebody is larger than half their length and width: about what the
filter's barrier adds (see `rudc/safety/config.py`)"""
BEHIND_M, AHEAD_M = 6.0, 10.0
"""m of the road's edge, behind and ahead of the ego, that is marked when the filter acts on it"""
FAR_M = 500.0
"""m, beyond all that is ever in view"""
_CIRCLE = np.column_stack([np.cos(np.linspace(0, 2 * np.pi, 29)), np.sin(np.linspace(0, 2 * np.pi, 29))])


def draw_path(canvas: Canvas, scene: Scene) -> None:
    """The ego's path from where it is, and the ring where it has arrived."""
    path, goal = scene.route.path, scene.goal_s
    ahead = path.xy[(path.s >= scene.ego_s) & (path.s <= goal)][::2]
    if len(ahead) > 1:
        canvas.area(strip(ahead, 0.9), PATH)
    x, y, _ = (float(v) for v in path.pose(goal))
    canvas.ring(x, y, 1.7, EGO)
    canvas.dot(x, y, 0.8, EGO)


def draw_way(canvas: Canvas, way: Array) -> None:
    """A broken line with a head along a way (K, 2) m: somebody will move there."""
    canvas.dashes(way, faint(EVENT, 200), 0.3, 1.0, 0.8)
    u = (way[-1] - way[-2]) / np.hypot(*(way[-1] - way[-2]))
    v = np.array([-u[1], u[0]])
    canvas.area(np.array([way[-1] + 1.2 * u, way[-1] + 0.7 * v, way[-1] - 0.7 * v]), faint(EVENT, 220))


def draw_patch(canvas: Canvas, patch: tuple[Array, ...]) -> None:
    """What is slippery."""
    for corners in patch:
        canvas.area(corners, faint(EVENT, 110))


def draw_sensor_reach(canvas: Canvas, view: View) -> None:
    """Shade what the ego cannot see: beyond its sensors' range, and behind opaque boxes. To be drawn first,
    on a canvas that was copied `shaded`.
    """
    if not view.sensors_limited:
        return
    ego, limited = view.truth.ego, math.isfinite(view.range_m)
    mask = Image.new("1", canvas.image.size, 1 if limited else 0)
    draw = ImageDraw.Draw(mask)
    eye = np.array([ego.x, ego.y])
    (px, py), r = canvas.pixels(eye).tolist(), view.range_m * canvas.scale
    if limited:
        draw.ellipse((px - r, py - r, px + r, py + r), fill=0)
    boxes = _corners(view.occluders)
    for corners in boxes:
        draw.polygon(canvas.pixels(shadow(eye, corners)).ravel().tolist(), fill=1)
    if canvas.shaded is not None:
        canvas.image.paste(canvas.shaded, (0, 0), mask)
    if limited:
        canvas.ring(ego.x, ego.y, view.range_m, faint(SENSED, 150), 0.2)
    for corners in boxes:
        canvas.area(corners, OCCLUDER)
        canvas.outline(corners, INK, 0.3)


def shadow(eye: Array, corners: Array) -> Array:
    """(5, 2) m, what a box with corners (4, 2) m hides from `eye` (2,) m, the box itself left out."""
    away = corners - eye
    middle = away.mean(axis=0)
    angle = np.arctan2(
        middle[0] * away[:, 1] - middle[1] * away[:, 0], middle[0] * away[:, 0] + middle[1] * away[:, 1]
    )
    right, left = away[int(angle.argmin())], away[int(angle.argmax())]
    ends = [side * FAR_M / max(float(np.hypot(*side)), 1e-6) for side in (left, middle, right)]
    return eye + np.array([right, left, *ends])


def draw_constraints(canvas: Canvas, scene: Scene, driving: Driving) -> None:
    """An ellipse about everybody whom the filter constrains; bold, and with a line from the ego's own, about
    those it acts on; and the edges of the road that it acts on.
    """
    active = {name.removeprefix("veh:") for name in driving.active if name.startswith("veh:")}
    constrained = {name.removeprefix("veh:") for name in driving.constrained if name.startswith("veh:")}
    for i, name in enumerate(scene.ids):
        if name not in active and name not in constrained:
            continue
        bold = name in active
        ellipse = _ellipse(scene.position[i], float(scene.heading[i]), scene.size[i])
        canvas.line(ellipse, ACTIVE if bold else CONSTRAINED, 0.4 if bold else 0.18)
        if bold:
            canvas.line(np.array([(scene.ego.x, scene.ego.y), scene.position[i]]), faint(ACTIVE, 150), 0.25)
    if active:
        ego, body = scene.ego, scene.vehicle
        size = np.array([body.length, body.width])
        canvas.line(_ellipse(np.array([ego.x, ego.y]), ego.psi, size), ACTIVE, 0.3)
    path = scene.route.path
    near = (path.s >= scene.ego_s - BEHIND_M) & (path.s <= scene.ego_s + AHEAD_M)
    for side, edge in (("left", scene.route.left_edge), ("right", scene.route.right_edge)):
        if any(name.startswith(f"road:{side}") for name in driving.active) and near.sum() > 1:
            canvas.line(edge[near], ACTIVE, 0.5)


def _ellipse(position: Array, heading: float, size: Array) -> Array:
    """(29, 2) m, the ellipse drawn about a body."""
    axes = _CIRCLE * (0.5 * size + KEPT_M)
    cos, sin = math.cos(heading), math.sin(heading)
    return position + axes @ np.array([[cos, sin], [-sin, cos]])


def _corners(boxes: Array) -> Array:
    """(K, 4, 2) m, corners of boxes (K, 5)."""
    return rectangle_corners(boxes[:, :2], boxes[:, 2], boxes[:, 3:])
