"""Slows down before places from which somebody may run onto the ego's way.

Wherever a box hides something from the ego, a pedestrian may stand up to ASIDE m beside the ego's way, if
nothing bars the straight way from there. It may set off at any time with RUNS m/s, and reaches the ego's side
after

    t = (distance from there to the ego's side) / RUNS

The ego must either be past that place before it does, or be able to stop before it, braking at b:

    (way to the place) / v <= t      or      v^2 <= max(2 b (way to the place), CREEP^2)

The same holds for a pedestrian who stands beside the ego's way, up to ASIDE m from its side, and faces it, as
one who has stopped half-way over the road; there b is GENTLY, since the road may be poorer than it seems.

Who ran out may be followed by others. So where somebody crosses the ego's way and, TRAIL_S ago or less, was
where the ego does not see now, the ego must be past with its whole length before another one who comes from
there at the same speed is at its side, or stop before their way.
"""

from __future__ import annotations

import math

import numpy as np

from rudc.agents.following import PLANNED as GENTLY
from rudc.agents.hidden import BEFORE, CREEP, PLANNED, look_ahead
from rudc.agents.kernels import nearest_hidden
from rudc.arrays import Array
from rudc.env.tracking import at_most, planned, slowing
from rudc.world.perception import in_sight
from rudc.world.scene import STANDING, Kind, Scene

RUNS = 3.0
"""m/s, a jogger"""
AHEAD, EVERY = 20.0, 1.0
"""m, m: length of the ego's way ahead that is checked, or more where the ego needs more to stop, and distance
between the places checked"""
ASIDE: Array = np.arange(0.5, 3.25, 0.5)
"""m, distances from the ego's side that are checked"""
TRAIL_S = 3.0
"""s, how far back the way of those who cross is looked at"""
FINE = 0.5
"""m, distance between the places of the ego's way at which others may cross it"""
ACROSS = 0.5
"""sine of the least angle between the ego's way and the way of one who crosses it"""
_BACK_S: Array = np.arange(0.0, TRAIL_S + 0.1, 0.25)


def ready_for_runners(scene: Scene, u: Array) -> Array:
    """(2,) the command u (2,), m/s2 and rad, with an acceleration after which the ego is past whoever may
    run out from behind a box, or can still stop.
    """
    if scene.hidden_by is None or scene.ego.v <= CREEP:
        return u
    body, braking = scene.vehicle, PLANNED * -scene.vehicle.a_min
    way = np.arange(EVERY, look_ahead(scene, AHEAD, braking), EVERY)
    x, y, psi = scene.route.path.pose(scene.front_s + way)
    eye = scene.ego.x, scene.ego.y
    run = nearest_hidden(*eye, x, y, psi, 0.5 * body.width, ASIDE, scene.hidden_by)
    late = np.flatnonzero(way > scene.ego.v * run / RUNS)
    if not len(late):
        return u
    room = float(way[late[0]]) - BEFORE
    return at_most(u, slowing(scene, room, CREEP, braking))


def ready_for_setting_off(scene: Scene, u: Array) -> Array:
    """(2,) the command u (2,), m/s2 and rad, with an acceleration after which the ego is past each pedestrian
    who stands beside its way and faces it before they, setting off now, are at its side, or can still stop.
    """
    who = np.flatnonzero((scene.kind == Kind.PEDESTRIAN) & (scene.speed <= STANDING))
    if scene.ego.v <= CREEP or not len(who):
        return u
    body, braking = scene.vehicle, planned(scene, GENTLY)
    way = np.arange(FINE, look_ahead(scene, AHEAD, braking), FINE)
    x, y, psi = scene.route.path.pose(scene.front_s + way)
    for i in who.tolist():
        cos, sin = math.cos(scene.heading[i]), math.sin(scene.heading[i])
        east, north = x - scene.position[i, 0], y - scene.position[i, 1]
        run = east * cos + north * sin - 0.5 * (body.width + scene.size[i, 0])
        meets = np.abs(north * cos - east * sin) <= 0.5 * scene.size[i, 1] + FINE
        meets &= np.abs(np.cos(psi) * sin - np.sin(psi) * cos) > ACROSS
        late = meets & (run >= 0.0) & (run <= ASIDE[-1]) & (way > scene.ego.v * run / RUNS)
        if late.any():
            u = at_most(u, slowing(scene, float(way[late.argmax()]) - BEFORE, CREEP, braking))
    return u


def ready_for_next_runners(scene: Scene, u: Array) -> Array:
    """(2,) the command u (2,), m/s2 and rad, with an acceleration after which the ego is past whoever may
    follow one who came from behind a box, or stops before their way, if it still can.
    """
    if scene.hidden_by is None:
        return u
    speed = scene.speed
    who = np.flatnonzero((scene.path < 0) & (speed > STANDING))
    if not len(who):
        return u
    body, v = scene.vehicle, scene.ego.v
    braking = PLANNED * -body.a_min
    way = np.arange(FINE, look_ahead(scene, AHEAD, braking), FINE)
    x, y, psi = scene.route.path.pose(scene.front_s + way)
    for i in who:
        direction = scene.velocity[i] / speed[i]
        trail = scene.position[i] - speed[i] * _BACK_S[:, None] * direction
        hidden = np.flatnonzero(~in_sight((scene.ego.x, scene.ego.y), trail, scene.hidden_by))
        if not len(hidden):
            continue
        away = np.stack([x, y], axis=1) - trail[hidden[0]]
        along, beside = away @ direction, np.abs(away @ (-direction[1], direction[0]))
        crosses = np.abs(np.cos(psi) * direction[1] - np.sin(psi) * direction[0]) > ACROSS
        arrives = (along - 0.5 * body.width) / speed[i]
        late = crosses & (beside <= FINE) & (along > 0.0) & (way + body.length > v * arrives)
        first = float(way[late.argmax()]) if late.any() else -math.inf
        if first >= v**2 / (2 * -body.a_min):
            u = at_most(u, slowing(scene, first - BEFORE, 0.0, braking))
    return u
