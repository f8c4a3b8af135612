"""Whether the gaps in the traffic that crosses or joins the ego's way suffice.

For each surrounding vehicle whose path meets the ego's (`Network.conflict`), four times from now are
computed:
    when the ego's front reaches the conflict, and when its tail leaves it (it accelerates as it would, and
    slows down in bends),
    when the other's front reaches it at the earliest (it accelerates), and when its tail leaves it (at its
    present speed).
The gap suffices if the ego leaves the conflict at least `margin` before the other arrives, or arrives after
the other has left. Where both ways merge, the ego has left when it is far enough in, and fast enough, that
the other does not catch up with it. The margin shrinks while the ego waits, so that it does not wait for a
perfect gap for ever.

Vehicles that cross come from another arm (`crossing`). In a roundabout the ego can meet the same vehicle at
two places: the ego gives way where it enters the ring, the other where the other enters
(`Network.crossings`).

A course (rudc/network/course.py) also enters ground that the route it replaces never touches: the lane
beside, or the lane of oncoming traffic. There the ego gives way to everybody (`entering`), whatever the
junction's right of way says about the two arms.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rudc.agents.poor_roads import fastest
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
"""s, s, s: margin at first, and margin after the ego has waited for the third"""
COURTESY = 3.0
"""s of waiting after which vehicles that stand before the conflict are assumed to let the ego pass"""
OTHERS_ACCELERATION = 1.5
"""m/s2, assumed of the others for their earliest arrival"""
SLOWEST = 1.0
"""m/s, below which a vehicle counts as stopping: twice STANDING, since it cannot be known when a vehicle that
creeps will have passed"""
LONGER = 5.0
"""m: where a course's conflict with a vehicle begins this much before, or ends this much after, the route's
conflict with it, the ego gives way as on new ground"""
PULLS_OUT = 8.0
"""m by which an ego that leaves its lane stops earlier for each m by which another is wider than the ego:
lorries and buses need all of their lane, and swing out in bends"""


class Conflicts(NamedTuple):
    """Conflicts with K surrounding vehicles that neither the ego nor the other has left yet."""

    ego_in: Array
    """(K,) m from the ego's front to the conflict, negative inside"""
    ego_out: Array
    """(K,) m that the ego has to drive until its tail is out"""
    other_in: Array
    """(K,) m from the other's front to the conflict, negative inside"""
    other_out: Array
    """(K,) m that the other has to drive until its tail is out"""
    speed: Array
    """(K,) m/s, speed of the other"""
    limit: Array
    """(K,) m/s, highest speed that is assumed of the other: the highest speed limit on its way to the
    conflict, or its speed if that is higher
    """
    braking: Array
    """(K,) m/s2, how hard the other brakes; negative if it speeds up"""
    yields: Flags
    """(K,) whether the ego gives way to it"""
    merges: Flags
    """(K,) whether both go on in one lane"""
    silent: Flags
    """(K,) whether the right of way says nothing of the two (`Network.silent`)"""


def crossing(scene: Scene) -> Conflicts | None:
    """Conflicts with vehicles from other arms; None if there are none."""
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
    silent = np.isfinite(scene.network.silent(scene.route, own)[rows, 0])
    return _open(scene, known, table, merges, yields, silent)


def entering(scene: Scene, route: Route) -> Conflicts | None:
    """Conflicts with vehicles on ground that the ego's course enters and its `route` does not; None if there
    are none.
    """
    driven = np.flatnonzero(scene.path >= 0)
    if not len(driven):
        return None
    paths = scene.network.paths
    table = scene.network.departure(scene.route)[scene.path[driven]]
    before = scene.network.conflict(route)[scene.path[driven]]
    shared = (before[:, 0] < table[:, 0] + LONGER) & (before[:, 1] > table[:, 1] - LONGER)
    own = np.isfinite(table[:, 0]) & ~shared  # no conflict of the route (nan) is not shared
    known, table = driven[own], table[own]
    if not len(known):
        return None
    _, _, theirs = paths.pose(scene.path[known], 0.5 * (table[:, 2] + table[:, 3]))
    _, _, ours = scene.route.path.pose(0.5 * (table[:, 0] + table[:, 1]))
    same_way = np.cos(theirs - ours) > 0.0
    always = np.ones(len(known), dtype=np.bool_)
    earlier = PULLS_OUT * np.maximum(scene.size[known, 1] - scene.vehicle.width, 0.0)
    return _open(scene, known, table, same_way, always, ~always, earlier)


def _open(
    scene: Scene,
    known: Index,
    table: Array,
    merges: Flags,
    yields: Flags,
    silent: Flags,
    earlier: Array | float = 0.0,
) -> Conflicts | None:
    """Those of the conflicts `table` (K, 4), with the others `known` (K,), that neither side has left. The
    ego comes to each `earlier` m (K,) before the table says.
    """
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
        ego_in=(table[:, 0] - earlier - scene.ego_s - half)[keep],
        ego_out=(ego_end - scene.ego_s + half)[keep],
        other_in=(table[:, 2] - s - theirs)[keep],
        other_out=(other_end - s + theirs)[keep],
        speed=speed[keep],
        limit=np.maximum(paths.highest_limit(rows, s, table[:, 2]), speed)[keep],
        braking=-scene.acceleration[known][keep],
        yields=yields[keep],
        merges=merges[keep],
        silent=silent[keep],
    )


def _uncleared(scene: Scene, known: Index, ego_end: Array, other_end: Array) -> Flags:
    """(K,) whether neither the ego nor the others `known` (K,) have left conflicts that end at `ego_end` (K,)
    m of its path and `other_end` (K,) m of theirs; False where there is none (nan)."""
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
    """(K,) whether the ego may go, judged by its conflict with each of the others.

    `profile`: (M,) m/s that the ego may drive at each station of its path; `margin`: s, one for all or (K,);
    None: it shrinks while the ego waits; `acceleration`: m/s2 of the ego, may be negative, and is limited to
    what a poor road gives.
    """
    if margin is None:
        margin = max(MARGIN - (MARGIN - LEAST_MARGIN) * scene.waited_s / PATIENCE, LEAST_MARGIN)
    acceleration = min(acceleration, scene.vehicle.a_max)
    ego_in, ego_out, speed_then = _times(scene, found, profile, acceleration)
    other_in = _earliest(found.other_in, found.speed, found.limit, -found.braking)
    other_out = np.maximum(found.other_out, 0.0) / np.maximum(found.speed, SLOWEST)
    catching_up = np.where(found.merges, np.maximum(found.speed - speed_then, 0.0) / DECELERATION, 0.0)
    first = ego_out + margin + catching_up < other_in
    last = (other_out + 0.3 < ego_in) & (found.speed > SLOWEST)
    waits = ~found.yields & (found.other_in > found.speed**2 / (2 * DECELERATION))
    stands = (found.speed < SLOWEST) & (found.other_in > 0.0) & (scene.waited_s > COURTESY)
    return first | last | waits | stands


def _times(scene: Scene, found: Conflicts, profile: Array, acceleration: float) -> tuple[Array, Array, Array]:
    """(K,) s until the ego's front reaches each conflict, (K,) s until its tail leaves it, and (K,) m/s its
    speed when it leaves.
    """
    ahead, time, speed = driving_on(scene, profile, acceleration)
    ego_in = np.interp(np.maximum(found.ego_in, 0.0), ahead, time)
    ego_out = np.interp(np.maximum(found.ego_out, 0.0), ahead, time)
    return ego_in, ego_out, np.interp(np.maximum(found.ego_out, 0.0), ahead, speed)


def driving_on(scene: Scene, profile: Array, acceleration: float) -> tuple[Array, Array, Array]:
    """(n,) m of the ego's path ahead, (n,) s after which it is there, and (n,) m/s with which. It accelerates
    at `acceleration` m/s2, up to `profile` (M,) m/s at each station of its path.
    """
    begin = min(max(int(scene.ego_s / SPACING), 0), len(profile) - 2)
    ahead: Array = SPACING * np.arange(len(profile) - begin, dtype=np.float64)
    cruise = _cruise(scene, SPACING * begin + ahead)
    now = max(scene.ego.v, 0.5)
    after = np.maximum(ahead - now * _idle(scene, acceleration), 0.0)
    rising = np.sqrt(np.maximum(now**2 + 2 * acceleration * after, 0.25))
    speed = np.minimum(np.minimum(rising, cruise), profile[begin:])
    time = np.concatenate([[0.0], np.cumsum(2 * SPACING / (speed[1:] + speed[:-1]))])
    return ahead, time, speed


def _idle(scene: Scene, acceleration: float) -> float:
    """s for which the ego keeps its speed before it accelerates at `acceleration` m/s2: the lag of its
    drive, for as much of the acceleration as it does not have yet."""
    if scene.lag_s <= 0.0 or acceleration <= 0.0:
        return 0.0
    return scene.lag_s * min(max(1.0 - scene.ego.acceleration / acceleration, 0.0), 1.0)


def _cruise(scene: Scene, s: Array) -> Array | float:
    """(M,) m/s, or one for all: the speed that the ego does not exceed at s (M,) m."""
    route, most = scene.route, min(CRUISE, scene.vehicle.v_max, fastest(scene))
    begins, limits = zip(*route.limits, strict=True)
    speeds = [max(min(most, limit), scene.ego.v) for limit in limits]
    if min(speeds) == max(speeds):
        return speeds[0]
    return np.array(speeds)[np.searchsorted(begins[1:], s, side="right")]


def _earliest(distance: Array, speed: Array, limit: Array, acceleration: Array) -> Array:
    """(K,) s in which the others drive `distance` (K,) m, accelerating from their speeds to their limits at
    OTHERS_ACCELERATION or, if that is more, as now (`acceleration`, m/s2); 0 for distances below 0.
    """
    distance, a = np.maximum(distance, 0.0), np.maximum(acceleration, OTHERS_ACCELERATION)
    rising = (limit**2 - speed**2) / (2 * a)
    top = np.sqrt(speed**2 + 2 * a * np.minimum(distance, rising))
    return (top - speed) / a + np.maximum(distance - rising, 0.0) / limit
