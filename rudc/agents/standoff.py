"""Ends a standoff: the ego goes first where the ego in the junction and those whose ways meet its own all
wait.

When the ego stands at its waiting point in the junction, or past it, others may stand just because the ego is
there. If it has stood there for PATIENCE s, those whose ways meet its own stand too or come late enough, and
its way is clear at its present offset from the line, it goes on slowly (PACE), as long as all this is so.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from rudc.agents.gaps import crossing, suffices
from rudc.arrays import Array
from rudc.env.tracking import acceleration_towards, speeds_on_road, steering
from rudc.geometry import gaps_between, rectangle_gaps
from rudc.world.scene import STANDING, Scene

PATIENCE = 4.0
"""s, how long the ego must have stood"""
PACE, PUSH = 2.0, 1.0
"""m/s, m/s2: speed and acceleration with which it goes first"""
AT = 0.5
"""m: the ego counts as being at its waiting point from this much before it, but only this much beyond its
stop line"""
CLEAR, AHEAD = 0.2, 8.0
"""m, m: gap that must be free beside the ego's way, and length of that way"""
NEAR = 10.0
"""m between centres within which everybody ahead must stand"""


class Standoff:
    """Ends the standoffs of one agent in one episode."""

    def __init__(self) -> None:
        self._going = False

    def end(self, scene: Scene, u: Array) -> Array:
        """(2,) m/s2 and rad, the command `u` (2,), or the one with which the ego goes first."""
        if not self._going and scene.waited_s < PATIENCE:
            return u
        self._going = _all_wait(scene)
        if not self._going:
            return u
        a = acceleration_towards(PACE, scene, PUSH)
        return u if u[0] >= a else np.array([a, steering(replace(scene, ego_offset=0.0))])


def _all_wait(scene: Scene) -> bool:
    """Whether the ego is where others wait for it, nobody comes whom it would hinder, and its way is
    clear.
    """
    front = scene.front_s
    first = max(scene.route.waiting_s - AT, scene.route.stop_line_s + AT)
    if not first < front < scene.route.exit_s + scene.vehicle.length:
        return False
    found = crossing(scene)
    if found is None:
        return False
    moves = found.speed > STANDING
    if moves.all() or (moves & ~suffices(scene, found, speeds_on_road(scene))).any():
        return False
    away = scene.position - scene.ego_position
    speed = scene.speed
    ahead = away[:, 0] * math.cos(scene.ego.psi) + away[:, 1] * math.sin(scene.ego.psi)
    if ((speed > STANDING) & (ahead > 0.0) & (np.hypot(*away.T) < NEAR)).any():
        return False
    return _least_gap(scene) > CLEAR


def _least_gap(scene: Scene) -> float:
    """m, least gap to anybody, now and on the next AHEAD m at the ego's present offset from its path."""
    ego, body = scene.ego, scene.vehicle
    now = rectangle_gaps(
        ego.x, ego.y, ego.psi, body.length, body.width, scene.position, scene.heading, scene.size
    )
    s = scene.ego_s + np.arange(0.0, AHEAD, 0.5)
    x, y, psi = scene.route.path.pose(s)
    place = np.column_stack([x - scene.ego_offset * np.sin(psi), y + scene.ego_offset * np.cos(psi)])
    who = np.flatnonzero(np.hypot(*(scene.position - scene.ego_position).T) < AHEAD + NEAR)
    here, there = np.repeat(np.arange(len(s)), len(who)), np.tile(who, len(s))
    gaps = gaps_between(
        place[here], psi[here], np.array([body.length, body.width]),
        scene.position[there], scene.heading[there], scene.size[there],
    )  # fmt: skip
    return min(float(now.min(initial=math.inf)), float(gaps.min(initial=math.inf)))
