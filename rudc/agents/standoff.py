"""Who goes first where everybody waits: the ego in the junction, and those whose ways meet its own.

At its waiting point in the junction, and past it, nobody waits for nothing: others stand because the ego
does. Where it has stood there for PATIENCE s, those whose ways meet its own stand too or come late enough,
and its way is clear as far beside its line as it is, it goes on at walking pace, for as long as that is so.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from rudc.agents.gaps import crossing, suffices
from rudc.arrays import Array
from rudc.env.tracking import acceleration_towards, speeds_in_bends, steering
from rudc.geometry import gaps_between, rectangle_gaps
from rudc.world.scene import STANDING, Scene

PATIENCE = 4.0
"""s"""
PACE, PUSH = 2.0, 1.0
"""m/s, m/s2"""
AT = 0.5
"""m before its waiting point, or beyond its stop line, from where the ego counts as being there"""
CLEAR, AHEAD = 0.2, 8.0
"""m beside the ego's way that must be free, and for how many m"""
NEAR = 10.0
"""m between centres, within which those ahead must stand"""


class Standoff:
    """Of one agent; `reset` begins an episode."""

    def reset(self) -> None:
        """Begin a new episode."""
        self._going = False

    def end(self, scene: Scene, u: Array) -> Array:
        """(2,) the command, m/s2 and rad, or that with which the ego goes first."""
        if not self._going and scene.waited_s < PATIENCE:
            return u
        self._going = _all_wait(scene)
        if not self._going:
            return u
        a = acceleration_towards(PACE, scene, PUSH)
        return u if u[0] >= a else np.array([a, steering(replace(scene, ego_offset=0.0))])


def _all_wait(scene: Scene) -> bool:
    """Whether the ego is where others wait for it, nobody who matters comes, and the way is clear."""
    front = scene.ego_s + 0.5 * scene.vehicle.length
    first = max(scene.route.waiting_s - AT, scene.route.stop_line_s + AT)
    if not first < front < scene.route.exit_s + scene.vehicle.length:
        return False
    found = crossing(scene)
    if found is None:
        return False
    moves = found.speed > STANDING
    if moves.all() or (moves & ~suffices(scene, found, speeds_in_bends(scene.route.path))).any():
        return False
    away = scene.position - scene.ego_position
    speed = np.hypot(scene.velocity[:, 0], scene.velocity[:, 1])
    ahead = away[:, 0] * math.cos(scene.ego.psi) + away[:, 1] * math.sin(scene.ego.psi)
    if ((speed > STANDING) & (ahead > 0.0) & (np.hypot(*away.T) < NEAR)).any():
        return False
    return _least_gap(scene) > CLEAR


def _least_gap(scene: Scene) -> float:
    """m to anybody from where the ego is, and on the next AHEAD m, as far beside the path as now."""
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
