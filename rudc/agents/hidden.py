"""How fast the ego may drive where it does not see everything.

An ego whose sensors may have failed brakes, unless it is in the junction.

On its own path the ego drives no faster than it can stop from within what it sees, braking at PLANNED; CREEP
is always allowed.

At a junction, a vehicle may come at its road's speed limit from behind every box that hides something, and
from beyond the sensors' reach: one to which the ego gives way and, where grip is poor, any other too. For
each such row of `network.paths` from another arm that meets the ego's path, the hidden place nearest to the
conflict, upstream of it, is looked for. A vehicle there reaches the conflict after

    t = (way from there to the conflict) / (the highest speed limit on that way)

and the ego must either have passed the conflict before that, or be able to stop before it, braking at b:

    (time until the ego has passed) + SPARE < t      or      v^2 <= max(2 b (way to the conflict), CREEP^2)

Where both go on in one lane, the ego has passed MERGED m in, which is room enough without SPARE. There the
other, if it is faster, must be able to slow down behind it with FOR_OTHERS.
"""

from __future__ import annotations

import math

import numpy as np

from rudc.agents.gaps import ACCELERATION, driving_on
from rudc.arrays import Array, Flags, Index
from rudc.env.tracking import at_most, slowing, speeds_on_road, stopping
from rudc.network.conflicts import MERGED
from rudc.network.paths import SPACING
from rudc.world.perception import in_sight
from rudc.world.scene import Scene

UPSTREAM, UPSTREAM_S, EVERY = 60.0, 6.0, 2.0
"""m, s, m: length of each row before the conflict that is checked, which is as far as a vehicle at the limit
comes in UPSTREAM_S if that is more, and distance between the places checked
"""
AHEAD = 40.0
"""m of the ego's path ahead, or more where the ego needs more to stop; conflicts and hidden places beyond do
not count yet"""
MORE, WEAKEST = 4.0, 0.01
"""m, what is looked at beyond the way that the ego needs to stop; m/s2, braking that this way is reckoned
with at least"""
SPARE = 0.5
"""s, by which the ego must have passed before the other arrives"""
CREEP = 2.0
"""m/s, always allowed: an ego that creeps can stop within a step"""
BEFORE = 0.5
"""m, distance before a conflict, or before the end of what it sees, at which the ego can stop"""
BLIND = 3.0
"""m/s2, with which the ego brakes while it sees nobody though somebody must be there"""
LATE = 0.2
"""m: an ego that even full braking brings down to CREEP farther than this beyond the place where it should be
so slow does not slow down for a conflict any more"""
FOR_OTHERS = 4.5
"""m/s2, with which the other slows down behind an ego that went on in its lane, as ordinary drivers can"""
PLANNED = 0.8
"""share of its hardest braking that the ego plans with"""


def ready_for_unseen(scene: Scene, u: Array) -> Array:
    """(2,) the command u (2,), m/s2 and rad, with an acceleration after which the ego can still stop within
    what it sees of its path.
    """
    front, braking = scene.front_s, PLANNED * -scene.vehicle.a_min
    look = look_ahead(scene, AHEAD, braking)
    if scene.hidden_by is None and scene.sight_m > look + scene.vehicle.length:
        return u
    first, last = math.ceil(front / SPACING), int((front + look) / SPACING)
    hidden = np.flatnonzero(~sees(scene, scene.route.path.xy[first:last]))
    if not len(hidden):
        return u
    room = (first + float(hidden[0])) * SPACING - front - BEFORE
    return at_most(u, slowing(scene, room, CREEP, braking))


def ready_to_wait_for_unseen(scene: Scene, u: Array) -> Array:
    """(2,) the command u (2,), m/s2 and rad, with an acceleration after which the ego can still stop before
    those to whom it gives way and who may come from where it does not see; `u` where full braking would bring
    it down to CREEP more than LATE m too late.
    """
    braking = PLANNED * -scene.vehicle.a_min
    room = _room(scene, braking, scene.network.gives_way(scene.route, scene.route.row))
    late = (scene.ego.v**2 - CREEP**2) / (2 * -scene.vehicle.a_min) > room + LATE
    return u if math.isinf(room) or late else at_most(u, slowing(scene, room, CREEP, braking))


def look_ahead(scene: Scene, least: float, braking: float) -> float:
    """m of the ego's path ahead to look at: `least`, or MORE than it needs to stop, braking at `braking`
    m/s2, if that is more and its path is that long.
    """
    needed = BEFORE + stopping(scene, max(braking, WEAKEST)) + MORE
    return max(least, min(needed, scene.route.path.length - scene.front_s))


def ready_while_blind(scene: Scene, u: Array) -> Array:
    """(2,) the command u (2,), m/s2 and rad, of an ego whose sensors may have failed (`Memory.blind`): it
    brakes with BLIND, unless it is in the junction.
    """
    rear, front = scene.ego_s - 0.5 * scene.vehicle.length, scene.front_s
    inside = front > scene.route.stop_line_s and rear < scene.route.exit_s
    return u if inside else at_most(u, -BLIND)


def speed_by_sight(scene: Scene, braking: float) -> float:
    """m/s, highest speed from which the ego, braking at `braking` m/s2, can stop before every conflict with a
    vehicle that may come from a hidden place before the ego has passed; inf if there is none.
    """
    origin = scene.network.paths.origin
    room = _room(scene, braking, origin != origin[scene.route.row])
    return max(math.sqrt(2.0 * braking * room), CREEP)


def _room(scene: Scene, braking: float, whom: Flags) -> float:
    """m to the nearest conflict with a vehicle that may come from a hidden place, on one of the rows `whom`
    (P,), before the ego has passed; inf if there is none. `braking`: m/s2, with which the ego would stop.
    """
    if scene.hidden_by is None and math.isinf(scene.sight_m):
        return math.inf
    paths, body = scene.network.paths, scene.vehicle
    silent = scene.network.silent(scene.route, scene.route.row)
    table = np.where(np.isfinite(silent), silent, scene.network.conflict(scene.route))
    front, look = scene.front_s, look_ahead(scene, AHEAD, braking)
    near = (table[:, 0] > front) & (table[:, 0] < front + look) & (table[:, 2] > paths.stop_s)
    rows = np.flatnonzero(near & whom)
    if not len(rows):
        return math.inf
    end, merges = _passed(scene, rows, table[rows])
    ours_in, ours_out = table[rows, 0] - front, end - front + body.length
    theirs_in = table[rows, 2]
    fastest = float(paths.highest_limit(rows, np.zeros(len(rows)), theirs_in).max())
    way = _hidden_way(scene, rows, theirs_in, max(UPSTREAM, UPSTREAM_S * fastest))
    limit = paths.highest_limit(rows, theirs_in - way, theirs_in)
    ahead, time, speed = driving_on(scene, speeds_on_road(scene), min(ACCELERATION, body.a_max))
    through, then = np.interp(ours_out, ahead, time), np.interp(ours_out, ahead, speed)
    between = np.where(merges, np.maximum(limit - then, 0.0) / FOR_OTHERS, SPARE)
    threat = through + between >= way / limit
    if not threat.any():
        return math.inf
    return max(float(ours_in[threat].min()) - BEFORE, 0.0)


def _passed(scene: Scene, rows: Index, table: Array) -> tuple[Array, Flags]:
    """(n,) m of the ego's path at which it has passed its conflicts `table` (n, 4) with `rows` (n,), and (n,)
    whether both go on in one lane from there: then that is MERGED m in. Rows that it meets once more later
    end where they did.
    """
    met = scene.network.crossings(scene.route, scene.route.row)
    merges = (met.merges & np.isnan(met.again[:, 0]))[rows]
    return np.where(merges, np.minimum(table[:, 1], table[:, 0] + MERGED), table[:, 1]), merges


def _hidden_way(scene: Scene, rows: Index, conflict: Array, upstream: float) -> Array:
    """(n,) m from the nearest hidden place on each row to where its conflict begins, at `conflict` (n,)
    m; inf if all places on the `upstream` m before it are in sight.
    """
    back = np.arange(0.0, upstream, EVERY)
    x, y, _ = scene.network.paths.pose(rows[:, None], np.maximum(conflict[:, None] - back, 0.0))
    seen = sees(scene, np.stack([x, y], axis=-1))
    return np.where(seen.all(axis=1), np.inf, back[seen.argmin(axis=1)])


def sees(scene: Scene, points: Array) -> Flags:
    """(...) whether the ego's sensors see what is at each of the points (..., 2) m."""
    eye = scene.ego.x, scene.ego.y
    seen = np.hypot(points[..., 0] - eye[0], points[..., 1] - eye[1]) < scene.sight_m
    return seen if scene.hidden_by is None else seen & in_sight(eye, points, scene.hidden_by)
