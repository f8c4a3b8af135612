"""How an ego meets those who cross its way where no path leads: pedestrians, riders from between houses,
drivers on the wrong side.

They are taken to go straight on at the speed that they have, and the ego to drive as commanded. If one of
them and the ego would then come to the place where their ways meet at nearly the same time
(rudc/agents/gaps.py, with a margin of MARGIN), the ego drives only so fast that it can stop before that
place, braking at GENTLY, since the road may be poorer there. Where it cannot stop there any more, the
command stays as it is.

Without this rule only the filter and the last resort would slow the ego down, and only once a collision is
near. An ego that is just ahead of somebody, and then brakes for something else, would stop in their way.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rudc.agents.following import PLANNED as GENTLY
from rudc.agents.gaps import Conflicts, suffices
from rudc.agents.hidden import BEFORE, look_ahead
from rudc.agents.runners import ACROSS, AHEAD
from rudc.arrays import Array, Index
from rudc.env.tracking import at_most, planned, slowing, speeds_on_road
from rudc.world.scene import STANDING, Scene

MARGIN = 0.5
"""s between the ego and the other, below which they come at nearly the same time"""
BESIDE = 0.3
"""m beside somebody's way that belong to it"""
FINE = 0.1
"""m between the places of the ego's way at which others may cross it"""


def ready_for_crossers(scene: Scene, u: Array) -> Array:
    """(2,) the command u (2,), m/s2 and rad, with an acceleration after which the ego can still stop before
    the way of each who crosses its own, is on no path, and would come at nearly the same time."""
    who = np.flatnonzero(scene.path < 0)
    who = who[scene.speed[who] > STANDING] if len(who) else who
    if not len(who):
        return u
    found = _crossing(scene, who)
    can = (found.ego_in >= scene.ego.v**2 / (2 * -scene.vehicle.a_min)) | (scene.ego.v < STANDING)
    if not can.any():
        return u
    just_come = replace(scene, waited_s=0.0)  # one that has waited is taken to be let through
    late = can & ~suffices(just_come, found, speeds_on_road(scene), margin=MARGIN, acceleration=float(u[0]))
    if not late.any():
        return u
    room = float(found.ego_in[late].min()) - BEFORE
    return at_most(u, slowing(scene, room, 0.0, planned(scene, GENTLY)))


def _crossing(scene: Scene, who: Index) -> Conflicts:
    """Where those of the others `who` (n,) who go straight across the ego's way meet it."""
    body = scene.vehicle
    way = np.arange(FINE, look_ahead(scene, AHEAD, planned(scene, GENTLY)), FINE)
    x, y, psi = scene.route.path.pose(scene.front_s + way)
    speed = scene.speed[who]
    direction = scene.velocity[who] / speed[:, None]
    cos, sin = direction[:, :1], direction[:, 1:]
    east, north = x - scene.position[who, :1], y - scene.position[who, 1:]
    along, beside = east * cos + north * sin, np.abs(north * cos - east * sin)
    across = np.minimum(np.abs(np.cos(psi) * sin - np.sin(psi) * cos), 1.0)
    length, width = scene.size[who].T
    strip = 0.5 * width[:, None] + BESIDE + 0.5 * body.width * np.sqrt(1.0 - across**2)
    meets = (across > ACROSS) & (beside < strip)
    half = 0.5 * (body.width + length) + BESIDE
    meets &= along > -half[:, None]
    some = meets.any(axis=1)
    meets, speed, along, half = meets[some], speed[some], along[some], half[some]
    rows, first = np.arange(len(meets)), meets.argmax(axis=1)
    last = meets.shape[1] - 1 - meets[:, ::-1].argmax(axis=1)
    always = np.ones(len(meets), dtype=np.bool_)
    return Conflicts(
        ego_in=way[first] - FINE,
        ego_out=way[last] + FINE + body.length,
        other_in=np.minimum(along[rows, first], along[rows, last]) - half,
        other_out=np.maximum(along[rows, first], along[rows, last]) + half,
        speed=speed,
        limit=speed,
        braking=np.zeros(len(meets)),
        yields=always,
        merges=~always,
        silent=~always,
    )
