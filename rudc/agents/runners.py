"""Slows down before places from which somebody may run onto the ego's way.

Wherever a box hides something from the ego, a pedestrian may stand up to ASIDE m beside the ego's way, if
nothing bars the straight way from there. It may set off at any time with RUNS m/s, and reaches the ego's side
after

    t = (distance from there to the ego's side) / RUNS

The ego must either be past that place before it does, or be able to stop before it, braking at b:

    (way to the place) / v <= t      or      v^2 <= max(2 b (way to the place), CREEP^2)
"""

from __future__ import annotations

import numpy as np

from rudc.agents.hidden import BEFORE, CREEP, PLANNED
from rudc.agents.kernels import nearest_hidden
from rudc.arrays import Array
from rudc.env.tracking import at_most, slowing
from rudc.world.scene import Scene

RUNS = 3.0
"""m/s, a jogger"""
AHEAD, EVERY = 20.0, 1.0
"""m, m: length of the ego's way ahead that is checked, and distance between the places checked"""
ASIDE: Array = np.arange(0.5, 3.25, 0.5)
"""m, distances from the ego's side that are checked"""


def ready_for_runners(scene: Scene, u: Array) -> Array:
    """(2,) the command u (2,), m/s2 and rad, with an acceleration after which the ego is past whoever may
    run out from behind a box, or can still stop.
    """
    if scene.hidden_by is None or scene.ego.v <= CREEP:
        return u
    body, way = scene.vehicle, np.arange(EVERY, AHEAD, EVERY)
    x, y, psi = scene.route.path.pose(scene.ego_s + 0.5 * body.length + way)
    eye = scene.ego.x, scene.ego.y
    run = nearest_hidden(*eye, x, y, psi, 0.5 * body.width, ASIDE, scene.hidden_by)
    late = np.flatnonzero(way > scene.ego.v * run / RUNS)
    if not len(late):
        return u
    room = float(way[late[0]]) - BEFORE
    return at_most(u, slowing(scene, room, CREEP, PLANNED * -body.a_min))
