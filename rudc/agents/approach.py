"""How fast an ego that has to give way may approach its waiting point.

While a gap in the traffic that has priority is too short (rudc/agents/gaps.py) by CLOSE or more, the ego
drives no faster than it can stop from at its waiting point, braking at PLANNED. Without this rule it would
stop beyond that point, in the way of a vehicle that slowed down for a turn and then sped up. A vehicle
that is fast already gains less speed: a gap before it counts only if it is too short by CLOSE_TO_FAST, unless
it speeds up by more than OTHERS_ACCELERATION now.

Where the right of way says nothing of the two (`Network.silent`), neither would give way, and they would
stand nose to nose. There every gap that is too short counts, and the ego stops before the place where they
meet.

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

from rudc.agents.gaps import ACCELERATION, OTHERS_ACCELERATION, Conflicts, crossing, suffices
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
    waiting point, and before those of whom the right of way says nothing, if it has to."""
    bound = _bound(scene, u)
    silent = scene.network.crossings(scene.route, scene.route.row).any_silent
    found = crossing(scene) if silent or bound is not None else None
    if found is None or not found.yields.any():
        return u
    profile = speeds_on_road(scene)
    if bound is not None:
        u = _held(scene, u, bound, found, profile)
    return _before_silent(scene, u, found, profile) if silent else u


def _bound(scene: Scene, u: Array) -> float | None:
    """m/s2, the acceleration after which the ego can still stop at its waiting point; None if that does not
    bound `u` (2,), m/s2 and rad, or if it cannot stop there any more."""
    room = scene.route.waiting_s - scene.front_s
    if room < scene.ego.v**2 / (2 * hardest(scene, HARDEST)):
        return None
    a = slowing(scene, room - AT_POINT, 0.0, planned(scene, PLANNED))
    return a if u[0] > a else None


def _held(scene: Scene, u: Array, bound: float, found: Conflicts, profile: Array) -> Array:
    """(2,) the command u (2,), bounded by `bound` m/s2 or the first of ACCELERATIONS with which all gaps are
    long enough; `profile` (M,) m/s."""
    slow = (found.speed < SLOW * found.limit) | (found.braking < -OTHERS_ACCELERATION)
    close = np.where(slow, CLOSE, CLOSE_TO_FAST) * hardest(scene, HARDEST) / HARDEST
    whom = found.yields & ~found.silent
    if not whom.any():
        return u
    for tried in ACCELERATIONS:
        if tried <= bound:
            break
        going = suffices(scene, found, profile, margin=-close, acceleration=tried)
        if not (whom & ~going).any():
            return u if tried == ACCELERATION else at_most(u, tried)
    return at_most(u, bound)


def _before_silent(scene: Scene, u: Array, found: Conflicts, profile: Array) -> Array:
    """(2,) the command u (2,) with an acceleration after which the ego can still stop before each of whom the
    right of way says nothing and the gap is too short; `profile` (M,) m/s."""
    can = found.ego_in > scene.ego.v**2 / (2 * hardest(scene, HARDEST))
    a = max(float(u[0]), 0.0)
    unsafe = found.silent & can & ~suffices(scene, found, profile, margin=0.0, acceleration=a)
    if not unsafe.any():
        return u
    room = float(found.ego_in[unsafe].min()) - AT_POINT
    return at_most(u, slowing(scene, room, 0.0, planned(scene, PLANNED)))
