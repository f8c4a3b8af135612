"""Whether the gaps in the traffic that crosses or joins the ego's way suffice.

For each surrounding vehicle whose path meets the ego's (`Network.conflict`), four times from now:
    the ego's front reaches the conflict, its tail leaves it (accelerating as it would, bends respected),
    the other's front reaches it at the earliest (accelerating), its tail leaves it (as fast as now).
The gap suffices if the ego is gone `margin` before the other comes, or comes after the other is gone. Where
both ways merge, gone means far enough in, and fast enough, not to be caught up with. The margin shrinks while
the ego waits: nobody waits for a perfect gap for ever.

Who crosses comes from another arm (`crossing`). In a roundabout the ego can meet the same vehicle at two
places: the ego gives way where it enters the ring, the other where that one enters (`Network.crossings`).

A course (rudc/network/course.py) also enters ground that the route it replaces never touches: the lane
beside, or the one against which the ego drives. There the ego gives way to everybody (`entering`), whatever
the junction's right of way says of the two arms.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rudc.arrays import Array, Flags, Index
from rudc.network.conflicts import MERGED
from rudc.network.paths import SPACING
from rudc.network.route import Route
from rudc.world.scene import Scene

CRUISE = 8.5
"""m/s, desired speed"""
ACCELERATION, DECELERATION = 2.0, 2.5
"""m/s2, m/s2: IDM's A and B"""
MARGIN, LEAST_MARGIN, PATIENCE = 1.2, 0.4, 12.0
"""s, s, s: margin at first and after having waited for PATIENCE"""
COURTESY = 3.0
"""s of waiting after which those who stand before the conflict are taken to let it pass"""
OTHERS_ACCELERATION = 1.5
"""m/s2, assumed of the others where it is the worse"""
SLOWEST = 1.0
"""m/s, below which a vehicle counts as stopping: twice STANDING, since when one that creeps will have passed
says nothing"""
LONGER = 5.0
"""m by which a conflict of the course begins before, or ends behind, that of the route with the same vehicle,
for the ego to give way there as on new ground"""


class Conflicts(NamedTuple):
    """The K surrounding vehicles that have yet to clear a conflict that the ego has yet to clear too."""

    ego_in: Array
    """(K,) m from the ego's front to the conflict, negative inside"""
    ego_out: Array
    """(K,) m the ego's front has to go until its tail is out"""
    other_in: Array
    """(K,) m from the other's front to the conflict, negative inside"""
    other_out: Array
    """(K,) m the other has to go until its tail is out"""
    speed: Array
    """(K,) m/s of the other"""
    limit: Array
    """(K,) m/s, what the other may come to drive"""
    yields: Flags
    """(K,) whether the ego gives way to it"""
    merges: Flags
    """(K,) whether both go on in one lane"""


def crossing(scene: Scene) -> Conflicts | None:
    """With those from other arms; None if there are none."""
    paths, own = scene.network.paths, scene.route.row
    known = np.flatnonzero((scene.path >= 0) & (paths.origin[scene.path] != paths.origin[own]))
    if not len(known):
        return None
    rows = scene.path[known]
    met = scene.network.crossings(scene.route, own)
    table, again = met.table[rows], met.again[rows]
    second = np.isfinite(again[:, 0]) & ~_uncleared(scene, known, table[:, 1], table[:, 3])
    table = np.where(second[:, None], again, table)
    merges = np.where(second, met.merges_again[rows], met.merges[rows])
    yields = scene.network.gives_way(scene.route, own)[rows] & ~second
    return _open(scene, known, table, merges, yields)


def entering(scene: Scene, route: Route) -> Conflicts | None:
    """With those on whose ground the ego's course comes where it has left its `route`, which does not come
    there; None if nobody is there.
    """
    driven = np.flatnonzero(scene.path >= 0)
    if not len(driven):
        return None
    paths = scene.network.paths
    table = scene.network.departure(scene.route, route)[scene.path[driven]]
    before = scene.network.conflict(route)[scene.path[driven]]
    shared = (before[:, 0] < table[:, 0] + LONGER) & (before[:, 1] > table[:, 1] - LONGER)
    own = np.isfinite(table[:, 0]) & ~shared  # no conflict of the route (nan) is not shared
    known, table = driven[own], table[own]
    if not len(known):
        return None
    _, _, theirs = paths.pose(scene.path[known], 0.5 * (table[:, 2] + table[:, 3]))
    _, _, ours = scene.route.path.pose(0.5 * (table[:, 0] + table[:, 1]))
    same_way = np.cos(theirs - ours) > 0.0
    return _open(scene, known, table, same_way, np.ones(len(known), dtype=np.bool_))


def _open(scene: Scene, known: Index, table: Array, merges: Flags, yields: Flags) -> Conflicts | None:
    """Of the conflicts `table` (K, 4) with others `known` (K,) those that neither has cleared."""
    paths, rows = scene.network.paths, scene.path[known]
    half, theirs = 0.5 * scene.vehicle.length, 0.5 * scene.size[known, 0]
    ego_end = np.where(merges, np.minimum(table[:, 1], table[:, 0] + MERGED), table[:, 1])
    other_end = np.where(merges, np.minimum(table[:, 3], table[:, 2] + MERGED), table[:, 3])
    s = scene.path_s[known]
    keep = np.flatnonzero(_uncleared(scene, known, ego_end, other_end))
    if not len(keep):
        return None
    speed = np.hypot(scene.velocity[known, 0], scene.velocity[known, 1])
    return Conflicts(
        ego_in=(table[:, 0] - scene.ego_s - half)[keep],
        ego_out=(ego_end - scene.ego_s + half)[keep],
        other_in=(table[:, 2] - s - theirs)[keep],
        other_out=(other_end - s + theirs)[keep],
        speed=speed[keep],
        limit=np.maximum(paths.speed_limit[rows], speed)[keep],
        yields=yields[keep],
        merges=merges[keep],
    )


def _uncleared(scene: Scene, known: Index, ego_end: Array, other_end: Array) -> Flags:
    """(K,) whether neither the ego nor the others `known` (K,) have cleared conflicts that end at (K,) m of
    its way and (K,) m of theirs; False where there is none (nan)."""
    theirs = scene.path_s[known] - 0.5 * scene.size[known, 0] < other_end
    return theirs & (scene.ego_s - 0.5 * scene.vehicle.length < ego_end)


def suffices(
    scene: Scene,
    found: Conflicts,
    profile: Array,
    *,
    margin: Array | float | None = None,
    acceleration: float = ACCELERATION,
) -> Flags:
    """(K,) whether the ego may go as far as each of the others is concerned.

    `profile`: m/s that it may drive at each station of its path; `margin`: s, for all or (K,), None: less the
    longer it waits; `acceleration`: the ego's, m/s2, which may be negative; on a poor road what that gives.
    """
    if margin is None:
        margin = max(MARGIN - (MARGIN - LEAST_MARGIN) * scene.waited_s / PATIENCE, LEAST_MARGIN)
    acceleration = min(acceleration, scene.vehicle.a_max)
    ego_in, ego_out, speed_then = _times(scene, found, profile, acceleration)
    other_in = _earliest(found.other_in, found.speed, found.limit)
    other_out = np.maximum(found.other_out, 0.0) / np.maximum(found.speed, SLOWEST)
    catching_up = np.where(found.merges, np.maximum(found.speed - speed_then, 0.0) / DECELERATION, 0.0)
    first = ego_out + margin + catching_up < other_in
    last = (other_out + 0.3 < ego_in) & (found.speed > SLOWEST)
    waits = ~found.yields & (found.other_in > found.speed**2 / (2 * DECELERATION))
    stands = (found.speed < SLOWEST) & (found.other_in > 0.0) & (scene.waited_s > COURTESY)
    return first | last | waits | stands


def _times(scene: Scene, found: Conflicts, profile: Array, acceleration: float) -> tuple[Array, Array, Array]:
    """(K,) s until the ego's front reaches each conflict and its tail leaves it, and (K,) m/s its speed
    then.
    """
    begin = min(max(int(scene.ego_s / SPACING), 0), len(profile) - 2)
    ahead = SPACING * np.arange(len(profile) - begin)
    cruise = max(min(CRUISE, scene.route.speed_limit), scene.ego.v)
    rising = np.sqrt(np.maximum(max(scene.ego.v, 0.5) ** 2 + 2 * acceleration * ahead, 0.25))
    speed = np.minimum(np.minimum(rising, cruise), profile[begin:])
    time = np.concatenate([[0.0], np.cumsum(2 * SPACING / (speed[1:] + speed[:-1]))])
    ego_in = np.interp(np.maximum(found.ego_in, 0.0), ahead, time)
    ego_out = np.interp(np.maximum(found.ego_out, 0.0), ahead, time)
    return ego_in, ego_out, np.interp(np.maximum(found.ego_out, 0.0), ahead, speed)


def _earliest(distance: Array, speed: Array, limit: Array) -> Array:
    """(K,) s in which the others cover (K,) m, accelerating from their speeds to their limits; 0 for what is
    behind.
    """
    distance = np.maximum(distance, 0.0)
    rising = (limit**2 - speed**2) / (2 * OTHERS_ACCELERATION)
    top = np.sqrt(speed**2 + 2 * OTHERS_ACCELERATION * np.minimum(distance, rising))
    return (top - speed) / OTHERS_ACCELERATION + np.maximum(distance - rising, 0.0) / limit
