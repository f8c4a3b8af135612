"""How fast an ego that has to give way comes to its waiting point.

While the gaps in the traffic that goes first do not suffice (rudc/agents/gaps.py), it comes no faster than it
can stop there, braking at PLANNED. Else it would stop beyond, in the way of somebody who slowed for a turn of
his own and then sped up. Gaps that are too short by less than CLOSE are the driver's affair.

A gap may not suffice for an ego that speeds up, and do so for one that comes later: the command is bounded by
the first of ACCELERATIONS with which all gaps suffice; if that is the first of all, not at all. Where even
HARDEST would not stop the ego at the waiting point, it is left to the driver.
"""

from __future__ import annotations

import numpy as np

from rudc.agents.gaps import ACCELERATION, crossing, suffices
from rudc.arrays import Array
from rudc.env.tracking import slowing, speeds_in_bends
from rudc.world.scene import Scene

PLANNED, HARDEST = 5.0, 6.0
"""m/s2, m/s2"""
ACCELERATIONS = (ACCELERATION, 0.0, -2.0)
"""m/s2"""
CLOSE = 1.0
"""s"""
AT_POINT = 0.3
"""m, kept before the waiting point"""


def ready_to_wait(scene: Scene, u: Array) -> Array:
    """(2,) what of the command u (2,), m/s2 and rad, leaves the ego able to stop at its waiting point."""
    v = scene.ego.v
    room = scene.route.waiting_s - scene.ego_s - 0.5 * scene.vehicle.length
    if room < v**2 / (2 * HARDEST):
        return u
    a = slowing(scene, room - AT_POINT, 0.0, PLANNED)
    if u[0] <= a:
        return u
    found = crossing(scene)
    if found is None or not found.yields.any():
        return u
    profile = speeds_in_bends(scene.route.path)
    for tried in ACCELERATIONS:
        if tried <= a:
            break
        going = suffices(scene, found, profile, margin=-CLOSE, acceleration=tried)
        if not (found.yields & ~going).any():
            return u if tried == ACCELERATION else _bounded(u, tried)
    return _bounded(u, a)


def _bounded(u: Array, a: float) -> Array:
    """(2,) the command with at most `a` m/s2."""
    return u if u[0] <= a else np.array([a, u[1]])
