"""How fast an ego that has to give way may approach its waiting point.

While a gap in the traffic that has priority is too short (rudc/agents/gaps.py) by CLOSE or more, the ego
drives no faster than it can stop from at its waiting point, braking at PLANNED. Without this rule it would
stop beyond that point, in the way of a vehicle that slowed down for a turn and then sped up. A vehicle
that is fast already gains less speed, and need not speed up at all: a gap before it counts only if it is too
short by CLOSE_TO_FAST, unless it does speed up. Where the right of way says nothing of the two, every gap
that is too short counts: neither would give way, and they would stand nose to nose.

A gap that is too short for an ego that speeds up may be long enough for one that arrives later. So the
command is bounded by the first of ACCELERATIONS with which all gaps are long enough. The command stays as
it is if that is the first one, and also where even HARDEST could not stop the ego at its waiting point
any more.

On a poor road (rudc/agents/adaptation.py) braking and the speed in bends are limited to what that road gives.
An ego that can brake only a third as hard must begin three times as early. So CLOSE and CLOSE_TO_FAST shrink
in proportion to its grip: there, a gap that is only a little too short holds the ego back already.
"""

from __future__ import annotations

import numpy as np

from rudc.agents.gaps import ACCELERATION, OTHERS_ACCELERATION, crossing, suffices
from rudc.arrays import Array
from rudc.env.tracking import at_most, hardest, planned, slowing, speeds_on_road
from rudc.world.scene import Scene

PLANNED, HARDEST = 5.0, 6.0
"""m/s2, m/s2: how hard the ego plans to brake for the waiting point, and how hard it could, on a dry road"""
ACCELERATIONS = (ACCELERATION, 0.0, -2.0)
"""m/s2, tried in this order"""
CLOSE, CLOSE_TO_FAST = 1.0, 2.0
"""s, s: a gap counts here if it is too short by this much, before a slow and before a fast vehicle"""
SLOW = 0.5
"""a vehicle is slow if it drives at less than this share of the speed that it may drive"""
AT_POINT = 0.3
"""m, distance that is kept before the waiting point"""


def ready_to_wait(scene: Scene, u: Array) -> Array:
    """(2,) the command u (2,), m/s2 and rad, with an acceleration after which the ego can still stop at its
    waiting point, if it has to."""
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
    profile = speeds_on_road(scene)
    slow = (found.speed < SLOW * found.limit) | (found.braking < -OTHERS_ACCELERATION)
    close = np.where(found.unsaid, 0.0, np.where(slow, CLOSE, CLOSE_TO_FAST) * grip / HARDEST)
    for tried in ACCELERATIONS:
        if tried <= a:
            break
        going = suffices(scene, found, profile, margin=-close, acceleration=tried)
        if not (found.yields & ~going).any():
            return u if tried == ACCELERATION else at_most(u, tried)
    return at_most(u, a)
