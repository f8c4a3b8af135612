"""How fast an ego that has to give way comes to its waiting point.

While a gap in the traffic that has priority is too short (rudc/agents/gaps.py) by CLOSE or more, the ego
comes no faster than it can stop at its waiting point, braking at PLANNED. Without that it would stop beyond,
in the way of somebody who slowed down for a turn of his own and then sped up. Somebody fast has less speed
to gain: a gap before him counts only if it is too short by CLOSE_TO_FAST.

A gap that is too short for an ego that speeds up may be long enough for one that comes later. So the command
is bounded by the first of ACCELERATIONS with which all gaps are long enough. If the first of them will do,
the command stays as it is; also where even HARDEST would not stop the ego at its waiting point.

On a poor road (rudc/agents/adaptation.py) the braking, and the speed in bends, are what that road gives. An
ego that brakes a third as hard must begin to three times as early, so CLOSE and CLOSE_TO_FAST shrink as its
grip does: a gap that is only just too short holds it back there.
"""

from __future__ import annotations

import math

import numpy as np

from rudc.agents.gaps import ACCELERATION, crossing, suffices
from rudc.arrays import Array
from rudc.env.tracking import LATERAL, at_most, hardest, planned, slowing, speeds_in_bends
from rudc.world.scene import Scene

PLANNED, HARDEST = 5.0, 6.0
"""m/s2, m/s2: how hard it brakes for the waiting point, and how hard it could, on a dry road"""
ACCELERATIONS = (ACCELERATION, 0.0, -2.0)
"""m/s2, tried in this order"""
CLOSE, CLOSE_TO_FAST = 1.0, 2.0
"""s, s: a gap counts here if it is too short by so much, before somebody slow and before somebody fast"""
SLOW = 0.5
"""who drives at less than this share of what he may is slow"""
AT_POINT = 0.3
"""m, kept before the waiting point"""


def ready_to_wait(scene: Scene, u: Array) -> Array:
    """(2,) what of the command u (2,), m/s2 and rad, leaves the ego able to stop at its waiting point."""
    v, grip, braking = scene.ego.v, hardest(scene, HARDEST), planned(scene, PLANNED)
    room = scene.route.waiting_s - scene.ego_s - 0.5 * scene.vehicle.length
    if room < v**2 / (2 * grip):
        return u
    a = slowing(scene, room - AT_POINT, 0.0, braking)
    if u[0] <= a:
        return u
    found = crossing(scene)
    if found is None or not found.yields.any():
        return u
    profile = speeds_in_bends(scene.route.path) * math.sqrt(min(braking / LATERAL, 1.0))
    close = np.where(found.speed < SLOW * found.limit, CLOSE, CLOSE_TO_FAST) * grip / HARDEST
    for tried in ACCELERATIONS:
        if tried <= a:
            break
        going = suffices(scene, found, profile, margin=-close, acceleration=tried)
        if not (found.yields & ~going).any():
            return u if tried == ACCELERATION else at_most(u, tried)
    return at_most(u, a)
