"""A driver that follows its path behind its leader (IDM) and enters when the gap in the traffic suffices.

Leader. Whoever's rectangle lies across the band the ego is about to sweep: those who head its way, stand, or
have no lane (pedestrians also where they will be within 2 s); once the ego has entered, whoever is there.

    a = A (1 - (v / v0)^4 - (g* / g)^2),    g* = G + v T + v (v - v_leader) / (2 sqrt(A B)).

Gaps. For each surrounding vehicle whose path meets the ego's (`Network.conflict`), four times from now:
    the ego's front reaches the conflict, its tail leaves it (accelerating as it would, bends respected),
    the other's front reaches it at the earliest (accelerating), its tail leaves it (as fast as now).
The gap suffices if the ego is gone `margin` before the other comes, or comes after the other is gone. Where
both ways merge, gone means far enough in, and fast enough, not to be caught up with. The margin shrinks while
the ego waits: nobody waits for a perfect gap for ever.

Where it holds. Before the waiting point (the last place clear of those it must yield to; the stop line, if
there is none inside the junction) it waits there for those it must yield to. Past it, and for those who
should yield but are already there, it stops before the conflict itself, if it still can.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from rudc.agents.base import Decision, EgoDriver, unfiltered
from rudc.arrays import Array, Flags
from rudc.env.tracking import acceleration_towards, speed_allowed, speeds_in_bends, steering
from rudc.network.paths import SPACING
from rudc.world.scene import Kind, Scene

CRUISE = 8.5
"""m/s, desired speed"""
ACCELERATION, DECELERATION, HEADWAY, STANDSTILL = 2.0, 2.5, 1.0, 2.0
"""m/s2, m/s2, s, m: IDM's A, B, T and G"""
HARDEST = 5.0
"""m/s2, braking with which it still tries to stop before a conflict"""
LOOK_AHEAD = 50.0
"""m of the path searched for a leader"""
BAND = 0.25
"""m to each side of the ego kept clear"""
PEDESTRIAN_S = (0.0, 1.0, 2.0)
"""s ahead at which pedestrians are looked for on the path"""
MARGIN, LEAST_MARGIN, PATIENCE = 1.2, 0.4, 12.0
"""s, s, s: margin at first and after having waited for PATIENCE"""
COURTESY = 3.0
"""s of waiting after which those who stand before the conflict are taken to let it pass"""
OTHERS_ACCELERATION = 1.5
"""m/s2, assumed of the others where it is the worse"""
MERGED = 6.0
"""m beyond the start of a merge after which its vehicles follow one another"""
SLOWEST = 1.0
"""m/s, below which a vehicle counts as stopping: twice STANDING, since when one that creeps will have passed
says nothing"""


class _Conflicts(NamedTuple):
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
    """(K,) whether the ego must yield to it"""
    merges: Flags
    """(K,) whether both leave by the same lane"""


class GapAcceptance:
    """Path follower with IDM and gap acceptance: the yardstick for sensible driving by rules."""

    name = "gap-acceptance"
    ego_driver: EgoDriver = "agent"

    def reset(self, scene: Scene, seed: int) -> None:
        """Nothing is kept from one decision to the next."""

    def act(self, scene: Scene) -> Decision:
        """Steer along the path; of following, holding and the bends, the slowest decides."""
        self._profile = speeds_in_bends(scene.route.path)
        speed = speed_allowed(scene, self._profile, min(CRUISE, scene.route.speed_limit))
        acceleration = acceleration_towards(speed, scene, ACCELERATION)
        gap, leader_speed = self._leader(scene)
        acceleration = min(acceleration, _idm(scene.ego.v, speed, gap, leader_speed))
        room = self._hold(scene)
        if math.isfinite(room):
            speed = math.sqrt(2 * DECELERATION * max(room - 0.3, 0.0))
            acceleration = min(acceleration, acceleration_towards(speed, scene, ACCELERATION))
        return unfiltered(max(acceleration, scene.vehicle.a_min), steering(scene))

    # ---- leader

    def _leader(self, scene: Scene) -> tuple[float, float]:
        """Gap (m) to who is ahead on the path, and its speed along it (m/s); (inf, 0) for nobody."""
        if scene.count == 0:
            return math.inf, 0.0
        front = scene.ego_s + 0.5 * scene.vehicle.length
        radius = 0.5 * scene.vehicle.width + BAND
        s = front + np.arange(-radius, LOOK_AHEAD, 1.0)
        x, y, psi = scene.route.path.pose(s)
        along = np.cos(scene.heading), np.sin(scene.heading)
        speed = np.hypot(scene.velocity[:, 0], scene.velocity[:, 1])
        reach = 0.5 * scene.size + radius
        covered = np.zeros((scene.count, len(s)), dtype=bool)
        moving = (scene.kind == Kind.PEDESTRIAN).any()
        for later in PEDESTRIAN_S if moving else PEDESTRIAN_S[:1]:
            shift = later * scene.velocity * (scene.kind == Kind.PEDESTRIAN)[:, None]
            dx = x - (scene.position + shift)[:, :1]
            dy = y - (scene.position + shift)[:, 1:]
            ahead = np.abs(dx * along[0][:, None] + dy * along[1][:, None]) < reach[:, :1]
            covered |= ahead & (np.abs(dy * along[0][:, None] - dx * along[1][:, None]) < reach[:, 1:])
        if front < scene.route.zone_start_s - 0.5 * scene.vehicle.length:
            crossing = (np.cos(scene.heading[:, None] - psi) < 0.7) & (speed > SLOWEST)[:, None]
            covered &= ~crossing | (scene.path < 0)[:, None]
        first = np.flatnonzero(covered.any(axis=0))
        if not len(first):
            return math.inf, 0.0
        who = np.flatnonzero(covered[:, first[0]])
        towards = speed[who] * np.cos(scene.heading[who] - psi[first[0]])
        gap = float(s[first[0]]) - front + radius - BAND
        return max(gap, 0.1), float(np.maximum(towards, 0.0).min())

    # ---- gaps

    def _hold(self, scene: Scene) -> float:
        """m from the front bumper to where the ego has to stop; inf if it may go."""
        found = _conflicts(scene)
        if found is None:
            return math.inf
        unsafe = ~self._suffices(scene, found)
        if not unsafe.any():
            return math.inf
        front = scene.ego_s + 0.5 * scene.vehicle.length
        stopping = scene.ego.v**2 / (2 * HARDEST)
        to_waiting = scene.route.waiting_s - front
        room = math.inf
        if (unsafe & found.yields).any() and to_waiting > stopping - 0.5:
            room = max(to_waiting, 0.0)
        there = unsafe & ((found.other_in < found.speed**2 / (2 * DECELERATION)) | found.yields)
        before = found.ego_in[there & (found.ego_in > stopping)] - BAND
        return min(room, float(before.min())) if len(before) else room

    def _suffices(self, scene: Scene, found: _Conflicts) -> Flags:
        """(K,) whether the ego may go as far as each of the others is concerned."""
        margin = max(MARGIN - (MARGIN - LEAST_MARGIN) * scene.waited_s / PATIENCE, LEAST_MARGIN)
        ego_in, ego_out, speed_then = self._times(scene, found)
        other_in = _earliest(found.other_in, found.speed, found.limit)
        other_out = np.maximum(found.other_out, 0.0) / np.maximum(found.speed, SLOWEST)
        catching_up = np.where(found.merges, np.maximum(found.speed - speed_then, 0.0) / DECELERATION, 0.0)
        first = ego_out + margin + catching_up < other_in
        last = (other_out + 0.3 < ego_in) & (found.speed > SLOWEST)
        waits = ~found.yields & (found.other_in > found.speed**2 / (2 * DECELERATION))
        stands = (found.speed < SLOWEST) & (found.other_in > 0.0) & (scene.waited_s > COURTESY)
        return first | last | waits | stands

    def _times(self, scene: Scene, found: _Conflicts) -> tuple[Array, Array, Array]:
        """(K,) s until the ego's front reaches each conflict and its tail leaves it, and (K,) m/s its speed
        then.
        """
        begin = min(max(int(scene.ego_s / SPACING), 0), len(self._profile) - 2)
        ahead = SPACING * np.arange(len(self._profile) - begin)
        cruise = min(CRUISE, scene.route.speed_limit)
        rising = np.sqrt(max(scene.ego.v, 0.5) ** 2 + 2 * ACCELERATION * ahead)
        speed = np.minimum(np.minimum(rising, cruise), self._profile[begin:])
        time = np.concatenate([[0.0], np.cumsum(2 * SPACING / (speed[1:] + speed[:-1]))])
        ego_in = np.interp(np.maximum(found.ego_in, 0.0), ahead, time)
        ego_out = np.interp(np.maximum(found.ego_out, 0.0), ahead, time)
        return ego_in, ego_out, np.interp(np.maximum(found.ego_out, 0.0), ahead, speed)


class Planner(GapAcceptance):
    """Gap acceptance on courses round what blocks the way: the yardstick where something does."""

    name = "planner"


def _conflicts(scene: Scene) -> _Conflicts | None:
    paths, own = scene.network.paths, scene.route.row
    known = np.flatnonzero((scene.path >= 0) & (paths.origin[scene.path] != paths.origin[own]))
    if not len(known):
        return None
    rows = scene.path[known]
    table = scene.network.conflict(scene.route)[rows]
    half, theirs = 0.5 * scene.vehicle.length, 0.5 * scene.size[known, 0]
    merges = table[:, 3] > paths.exit_s[rows] + MERGED
    ego_end = np.where(merges, np.minimum(table[:, 1], table[:, 0] + MERGED), table[:, 1])
    other_end = np.where(merges, np.minimum(table[:, 3], table[:, 2] + MERGED), table[:, 3])
    s = scene.path_s[known]
    open_still = (s - theirs < other_end) & (
        scene.ego_s - half < ego_end
    )  # false where there is no conflict (nan)
    keep = np.flatnonzero(open_still)
    if not len(keep):
        return None
    speed = np.hypot(scene.velocity[known, 0], scene.velocity[known, 1])
    return _Conflicts(
        ego_in=(table[:, 0] - scene.ego_s - half)[keep],
        ego_out=(ego_end - scene.ego_s + half)[keep],
        other_in=(table[:, 2] - s - theirs)[keep],
        other_out=(other_end - s + theirs)[keep],
        speed=speed[keep],
        limit=np.maximum(paths.speed_limit[rows], speed)[keep],
        yields=paths.yields[own, rows][keep],
        merges=merges[keep],
    )


def _earliest(distance: Array, speed: Array, limit: Array) -> Array:
    """(K,) s in which the others cover (K,) m, accelerating from their speeds to their limits; 0 for what is
    behind.
    """
    distance = np.maximum(distance, 0.0)
    rising = (limit**2 - speed**2) / (2 * OTHERS_ACCELERATION)
    top = np.sqrt(speed**2 + 2 * OTHERS_ACCELERATION * np.minimum(distance, rising))
    return (top - speed) / OTHERS_ACCELERATION + np.maximum(distance - rising, 0.0) / limit


def _idm(v: float, v0: float, gap: float, leader_speed: float) -> float:
    """m/s2, IDM's acceleration; free road for an infinite gap."""
    if math.isinf(gap):
        return ACCELERATION
    wanted = STANDSTILL + max(
        v * HEADWAY + v * (v - leader_speed) / (2 * math.sqrt(ACCELERATION * DECELERATION)), 0.0
    )
    return ACCELERATION * (1.0 - (v / max(v0, 0.1)) ** 4 - (wanted / gap) ** 2)
