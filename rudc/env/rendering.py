"""Frames of an episode, seen from above: road, traffic, the ego and its path, what the safety filter acts on.

    frame = Renderer(network).frame(scene)          # (600, 600, 3) uint8

Drawn with Pillow at twice the size and halved, which smooths edges; some ms a frame, no display needed.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from rudc.arrays import Array
from rudc.env.canvas import BODY, HALO, SHAPES, Canvas, Colour, cut, placed
from rudc.env.distances import destination_s
from rudc.env.remembered import Remembered
from rudc.env.road_picture import RoadPicture, draw_road
from rudc.geometry import rectangle_corners
from rudc.network.network import Network
from rudc.network.paths import SPACING
from rudc.network.polyline import strip
from rudc.world.scene import Kind, Scene

Frame = NDArray[np.uint8]

EGO: Colour = (24, 158, 116)
ROUTE: Colour = (64, 196, 150, 150)
GOAL: Colour = (24, 158, 116, 230)
SHADOW: Colour = (20, 24, 30, 70)
ALARM: Colour = (235, 64, 52)
ALARM_FAINT: Colour = (235, 64, 52, 110)
PANEL: Colour = (24, 28, 34, 190)
OCCLUDER: Colour = (70, 62, 54, 170)
TEXT: Colour = (240, 242, 245)
KINDS: dict[Kind, Colour] = {
    Kind.CAR: (130, 170, 222),
    Kind.TRUCK: (196, 166, 120),
    Kind.BUS: (222, 178, 84),
    Kind.MOTORCYCLE: (178, 140, 214),
    Kind.BICYCLE: (178, 140, 214),
    Kind.PEDESTRIAN: (250, 150, 90),
    Kind.OBSTACLE: (206, 96, 40),
}
BANNERS: dict[str, tuple[str, Colour]] = {
    "success": ("arrived", (24, 158, 116)),
    "frozen": ("time limit", (196, 150, 40)),
    "collision": ("collision", (214, 52, 44)),
    "off_road": ("off the road", (214, 52, 44)),
    "wrong_way": ("wrong way", (214, 52, 44)),
}
FINE = 2
"""drawn pixels for one of the frame, along each axis"""
MARGIN_M = 12.0
"""m of view kept around the ego"""

_pictures: Remembered[Network, dict[float, RoadPicture]] = Remembered(4)


class Renderer:
    """Draws scenes of one network."""

    def __init__(self, network: Network, size: int = 600, view_m: float = 110.0) -> None:
        """`size`: pixels along each side of a frame; `view_m`: m along each side."""
        self._network = network
        self._size = size
        self._view = view_m
        scale = FINE * size / view_m
        known = _pictures.get(network, dict)
        if scale not in known:
            known[scale] = draw_road(network, scale)
        self._road = known[scale]
        self._font = ImageFont.load_default(size / 40)
        self._large = ImageFont.load_default(size / 20)
        self._empty: tuple[tuple[float, float], Canvas] | None = None

    def frame(
        self,
        scene: Scene,
        *,
        active: Sequence[str] = (),
        seen: Collection[str] | None = None,
        occluders: Array | None = None,
        outcome: str | None = None,
        notes: Sequence[str] = (),
    ) -> Frame:
        """(size, size, 3) picture of a scene.

        `active`: names of the safety filter's active constraints (`veh:ID`, `road:left:PLACE`), to be marked.
        `seen`: names of those whom the ego's sensors show, None for all; the others are drawn faintly.
        `occluders`: (K, 5) opaque boxes, x, y (m), heading (rad), length, width (m).
        `outcome`: how the episode ended, as a banner. `notes`: further lines of text.
        """
        canvas = self._view_of_road(scene).copy()
        _draw_route(canvas, scene)
        _draw_road_alarm(canvas, scene, active)
        threats = {name.removeprefix("veh:") for name in active if name.startswith("veh:")}
        _draw_road_users(canvas, scene, threats, seen)
        if occluders is not None and len(occluders):
            for corners in rectangle_corners(occluders[:, :2], occluders[:, 2], occluders[:, 3:]):
                canvas.area(corners, OCCLUDER)
                canvas.outline(corners, OCCLUDER, 0.3)
        picture = canvas.image.reduce(FINE)
        self._write(picture, scene, active, notes)
        if outcome:
            self._announce(picture, outcome)
        return np.asarray(picture)

    def _view_of_road(self, scene: Scene) -> Canvas:
        """The part of the road in view: about the junction's centre, moved so that the ego is in it."""
        half, centre = 0.5 * self._view, self._network.center
        slack = half - MARGIN_M
        x = min(max(float(centre[0]), scene.ego.x - slack), scene.ego.x + slack)
        y = min(max(float(centre[1]), scene.ego.y - slack), scene.ego.y + slack)
        corner = (x - half, y + half)
        if self._empty is None or self._empty[0] != corner:
            self._empty = (corner, cut(self._road, corner, FINE * self._size))
        return self._empty[1]

    def _write(self, picture: Image.Image, scene: Scene, active: Sequence[str], notes: Sequence[str]) -> None:
        ego = scene.ego
        lines = [
            f"time {scene.time_s:.1f} s",
            f"speed {ego.v:.1f} m/s",
            f"accel {ego.acceleration:+.1f} m/s/s",
            f"steer {math.degrees(ego.steering):+.1f} deg",
            *notes,
        ]
        if active:
            lines.append(f"filter: {len(active)} active")
        draw, pad = ImageDraw.Draw(picture, "RGBA"), self._size // 75
        height = self._size / 32
        width = max(len(line) for line in lines) * self._size / 75
        draw.rounded_rectangle((pad, pad, width + 3 * pad, 2.4 * pad + height * len(lines)), pad, fill=PANEL)
        for k, line in enumerate(lines):
            colour = ALARM if line.startswith("filter") else TEXT
            draw.text((2 * pad, 1.6 * pad + k * height), line, fill=colour, font=self._font)

    def _announce(self, picture: Image.Image, outcome: str) -> None:
        text, colour = BANNERS.get(outcome, (outcome, ALARM))
        draw, side = ImageDraw.Draw(picture, "RGBA"), self._size
        half = 0.5 * draw.textlength(text, font=self._large) + side / 30
        box = (side / 2 - half, side * 0.03, side / 2 + half, side * 0.115)
        draw.rounded_rectangle(box, side / 60, fill=colour)
        draw.text((side / 2, side * 0.0725), text, fill=TEXT, font=self._large, anchor="mm")


def _draw_route(canvas: Canvas, scene: Scene) -> None:
    path, goal = scene.route.path, destination_s(scene)
    ahead = path.xy[max(int(scene.ego_s / SPACING), 0) : int(goal / SPACING) + 1 : 2]
    if len(ahead) > 1:
        canvas.area(strip(ahead, 0.9), ROUTE)
    x, y, _ = (float(v) for v in path.pose(goal))
    canvas.ring(x, y, 1.7, GOAL)
    canvas.dot(x, y, 0.8, GOAL)


def _draw_road_alarm(canvas: Canvas, scene: Scene, active: Sequence[str]) -> None:
    """Mark the road's edges that constrain the ego."""
    first, last = max(int((scene.ego_s - 6.0) / SPACING), 0), int((scene.ego_s + 10.0) / SPACING)
    for side, edge in (("left", scene.route.left_edge), ("right", scene.route.right_edge)):
        if any(name.startswith(f"road:{side}") for name in active) and len(edge[first:last]) > 1:
            canvas.line(edge[first:last], ALARM, 0.5)


def _draw_road_users(
    canvas: Canvas, scene: Scene, threats: Collection[str], seen: Collection[str] | None
) -> None:
    ego, body = scene.ego, scene.vehicle
    position = np.vstack([scene.position, (ego.x, ego.y)])
    heading = np.append(scene.heading, ego.psi)
    size = np.vstack([scene.size, (body.length, body.width)])
    braking = np.append(scene.acceleration, ego.acceleration) < -0.7
    braking |= np.append(np.hypot(*scene.velocity.T), ego.v) < 0.3
    shapes = canvas.pixels(placed(SHAPES, position, heading, size))
    shadows = (shapes[:, BODY] + np.array([0.35, 0.35]) * canvas.scale).reshape(len(shapes), -1).tolist()
    flat = shapes.reshape(len(shapes), -1).tolist()
    for k, name in enumerate(scene.ids):
        kind = Kind(int(scene.kind[k]))
        if name in threats:
            canvas.line(np.array([(ego.x, ego.y), scene.position[k]]), ALARM_FAINT, 0.3)
            canvas.outline(
                placed(HALO, position[k : k + 1], heading[k : k + 1], size[k : k + 1] + 1.4)[0], ALARM, 0.35
            )
        colour = (*KINDS[kind][:3], 80) if seen is not None and name not in seen else KINDS[kind]
        if kind is Kind.PEDESTRIAN:
            canvas.dot(float(position[k, 0]), float(position[k, 1]), 0.55, colour)
        else:
            canvas.draw.polygon(shadows[k], fill=SHADOW)
            canvas.vehicle(
                flat[k], colour, windows=kind is not Kind.OBSTACLE and size[k, 1] > 1.2, braking=braking[k]
            )
    canvas.draw.polygon(shadows[-1], fill=SHADOW)
    canvas.vehicle(flat[-1], EGO, windows=True, braking=bool(braking[-1]))
    canvas.outline(placed(HALO, position[-1:], heading[-1:], size[-1:])[0], TEXT, 0.18)
