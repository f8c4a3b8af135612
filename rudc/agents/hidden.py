"""How fast to come to a junction of which the ego does not see all.

Behind every box and beyond the sensors' reach a vehicle may come at its road's limit, whoever has priority.
For each row of `network.paths` from another arm that meets the ego's path, the nearest hidden place upstream
of the conflict is looked for. A vehicle there reaches the conflict after

    t = (way from there to the conflict) / (the row's limit)

and the ego either is through before that, or can stop before the conflict:

    through + SPARE < t      or      v^2 <= 2 b (way to the conflict),  at least CREEP^2.
"""

from __future__ import annotations

import math

import numpy as np

from rudc.arrays import Array, Index
from rudc.world.perception import in_sight
from rudc.world.scene import Scene

UPSTREAM, EVERY = 60.0, 2.0
"""m of each row before the conflict that are looked at, m between the places"""
AHEAD = 40.0
"""m of the ego's path, conflicts beyond which do not count yet"""
SPARE = 0.5
"""s"""
CREEP = 2.0
"""m/s, always allowed: who creeps stops within a step of where it sees"""
BEFORE = 0.5
"""m before a conflict where the ego stops"""
GOING = 2.0
"""m/s2, with which the ego goes through"""


def speed_by_sight(scene: Scene, braking: float) -> float:
    """m/s from which the ego, braking with so many m/s2, gets on with whoever may come out of hiding; inf if
    nobody can.
    """
    if scene.hidden_by is None and math.isinf(scene.sight_m):
        return math.inf
    paths, body = scene.network.paths, scene.vehicle
    table = scene.network.conflict(scene.route)
    front = scene.ego_s + 0.5 * body.length
    ahead = (table[:, 0] > front) & (table[:, 0] < front + AHEAD) & (table[:, 2] > paths.stop_s)
    rows = np.flatnonzero(ahead & (paths.origin != paths.origin[scene.route.row]))
    if not len(rows):
        return math.inf
    ours_in, ours_out, theirs_in = (
        table[rows, 0] - front,
        table[rows, 1] - front + body.length,
        table[rows, 2],
    )
    way = _hidden_way(scene, rows, theirs_in)
    through = _time(scene.ego.v, ours_out, min(GOING, body.a_max))
    threat = through + SPARE >= way / paths.speed_limit[rows]
    if not threat.any():
        return math.inf
    room = max(float(ours_in[threat].min()) - BEFORE, 0.0)
    return max(math.sqrt(2.0 * braking * room), CREEP)


def _hidden_way(scene: Scene, rows: Index, conflict: Array) -> Array:
    """(n,) m from the nearest hidden place on each row to where its conflict (n,) m begins; inf if it is all
    in sight.
    """
    back = np.arange(0.0, UPSTREAM, EVERY)
    x, y, _ = scene.network.paths.pose(rows[:, None], np.maximum(conflict[:, None] - back, 0.0))
    eye = scene.ego.x, scene.ego.y
    points = np.stack([x, y], axis=-1)
    seen = np.hypot(x - eye[0], y - eye[1]) < scene.sight_m
    if scene.hidden_by is not None:
        seen &= in_sight(eye, points, scene.hidden_by)
    return np.where(seen.all(axis=1), np.inf, back[seen.argmin(axis=1)])


def _time(v: float, way: Array, a: float) -> Array:
    """(n,) s for (n,) m from v m/s at a m/s2."""
    return (np.sqrt(v * v + 2.0 * a * np.maximum(way, 0.0)) - v) / a
