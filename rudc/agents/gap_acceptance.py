"""A driver that follows its path behind its leader (IDM) and enters when the gap in the traffic suffices.

Leader. The first vehicle whose rectangle overlaps the band of road that the ego is about to drive over.
Before the conflict zone only those count that head in the ego's direction, stand, or have no lane; in it
and beyond, everybody counts. Pedestrians also count where they will be within 2 s.

    a = A (1 - (v / v0)^4 - (g* / g)^2),    g* = G + v T + v (v - v_leader) / (2 sqrt(A B)).

Limits. It meets a lower speed limit ahead by braking at DECELERATION, not only where the limit begins.

Gaps. Whether the gaps in the crossing traffic suffice, rudc/agents/gaps.py decides.

Where it stops. Before the waiting point (the last place that is clear of those to whom it must yield, or the
stop line if there is no such place in the junction) it waits there for those to whom it must yield. Past the
waiting point, and for those who should yield but cannot any more, it stops before the conflict itself, if it
still can.
"""

from __future__ import annotations

import math

import numpy as np

from rudc.agents.base import Decision, unfiltered
from rudc.agents.gaps import ACCELERATION, CRUISE, DECELERATION, SLOWEST, crossing, suffices
from rudc.arrays import Array, Flags
from rudc.env.tracking import (
    CALM_S,
    acceleration_towards,
    hardest,
    planned,
    slowing_for_limits,
    speed_allowed,
    speeds_on_road,
    steering,
)
from rudc.world.config import EgoDriver
from rudc.world.scene import STILL, Kind, Scene

HEADWAY, STANDSTILL = 1.0, 2.0
"""s, m: IDM's T and G"""
HARDEST = 5.0
"""m/s2, the ego stops before a conflict only if it can with this braking or less"""
LOOK_AHEAD = 50.0
"""m of the path that are searched for a leader"""
BAND, BESIDE = 0.25, 0.1
"""m to each side of the ego that belong to the band; towards things that stand, if courses lead round them"""
ALONG: Array = np.array([-0.5, -0.25, 0.0, 0.25])
"""m before and beyond a station of the path, where things that stand are looked for, too"""
PEDESTRIAN_S = (0.0, 1.0, 2.0)
"""s ahead at which pedestrians are looked for on the path"""


class GapAcceptance:
    """Path follower with IDM and gap acceptance: the reference for sensible driving by rules."""

    name = "gap-acceptance"
    ego_driver: EgoDriver = "agent"
    beside = BAND
    """m to each side of the ego that belong to the band, towards things that stand"""

    def reset(self, scene: Scene, seed: int) -> None:
        """Nothing is kept from one decision to the next."""

    def act(self, scene: Scene) -> Decision:
        """Steer along the path; accelerate as the strictest of bends, speed limits, leader and stopping place
        allows.
        """
        self._profile = speeds_on_road(scene)
        route = scene.route
        speed = speed_allowed(scene, self._profile, min(CRUISE, route.limit_at(scene.ego_s)))
        acceleration = acceleration_towards(speed, scene, ACCELERATION)
        acceleration = min(acceleration, slowing_for_limits(scene, 1.0, planned(scene, DECELERATION)))
        gap, leader_speed = self.leader(scene)
        acceleration = min(acceleration, _idm(scene.ego.v, speed, gap, leader_speed))
        room = self._hold(scene)
        if math.isfinite(room):
            speed = math.sqrt(2 * planned(scene, DECELERATION) * max(room - 0.3, 0.0))
            acceleration = min(acceleration, acceleration_towards(speed, scene, ACCELERATION))
        return unfiltered(max(acceleration, scene.vehicle.a_min), steering(scene, CALM_S))

    # ---- leader

    def leader(self, scene: Scene) -> tuple[float, float]:
        """Gap (m) to the leader, and its speed along the path (m/s); (inf, 0) if there is none."""
        if scene.count == 0:
            return math.inf, 0.0
        front = scene.front_s
        radius = 0.5 * scene.vehicle.width + BAND
        s = front + np.arange(-radius, LOOK_AHEAD, 1.0)
        x, y, psi = scene.route.path.pose(s)
        along = np.cos(scene.heading), np.sin(scene.heading)
        speed = scene.speed
        walks = scene.kind == Kind.PEDESTRIAN
        stands = (scene.path < 0) & (speed < STILL) & ~walks
        reach = 0.5 * scene.size + np.where(stands, radius - BAND + self.beside, radius)[:, None]
        covered = np.zeros((scene.count, len(s)), dtype=bool)
        for later in PEDESTRIAN_S if walks.any() else PEDESTRIAN_S[:1]:
            shift = later * scene.velocity * walks[:, None]
            dx = x - (scene.position + shift)[:, :1]
            dy = y - (scene.position + shift)[:, 1:]
            ahead = np.abs(dx * along[0][:, None] + dy * along[1][:, None]) < reach[:, :1]
            covered |= ahead & (np.abs(dy * along[0][:, None] - dx * along[1][:, None]) < reach[:, 1:])
        if covered[stands].any():
            covered[stands] &= _near(scene, stands, s, radius - BAND + self.beside)
        if front < scene.route.zone_start_s - 0.5 * scene.vehicle.length:
            across = (np.cos(scene.heading[:, None] - psi) < 0.7) & (speed > SLOWEST)[:, None]
            covered &= ~across | (scene.path < 0)[:, None]
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
        found = crossing(scene)
        if found is None:
            return math.inf
        unsafe = ~suffices(scene, found, self._profile)
        if not unsafe.any():
            return math.inf
        front = scene.front_s
        stopping = scene.ego.v**2 / (2 * hardest(scene, HARDEST))
        to_waiting = scene.route.waiting_s - front
        room = math.inf
        if (unsafe & found.yields).any() and to_waiting > stopping - 0.5:
            room = max(to_waiting, 0.0)
        there = unsafe & ((found.other_in < found.speed**2 / (2 * DECELERATION)) | found.yields)
        before = found.ego_in[there & (found.ego_in > stopping)] - BAND
        return min(room, float(before.min())) if len(before) else room


class Planner(GapAcceptance):
    """Gap acceptance on courses round what blocks the way: the reference where something blocks it."""

    name = "planner"
    beside = BESIDE


def _near(scene: Scene, who: Flags, s: Array, room: float) -> Flags:
    """(k, S) whether the rectangles of the k others `who` (N,) come nearer than `room` m to the path's line
    within half a metre of each of its stations s (S,) m.
    """
    x, y, _ = scene.route.path.pose((s[:, None] + ALONG).ravel())
    psi, half = scene.heading[who, None], 0.5 * scene.size[who]
    dx, dy = x - scene.position[who, :1], y - scene.position[who, 1:]
    before = np.abs(dx * np.cos(psi) + dy * np.sin(psi)) - half[:, :1]
    aside = np.abs(dy * np.cos(psi) - dx * np.sin(psi)) - half[:, 1:]
    apart = np.hypot(np.maximum(before, 0.0), np.maximum(aside, 0.0))
    return np.any((apart < room).reshape(len(half), len(s), len(ALONG)), axis=2)


def _idm(v: float, v0: float, gap: float, leader_speed: float) -> float:
    """m/s2, IDM's acceleration at v m/s, desired speed v0 m/s, `gap` m behind a leader at `leader_speed` m/s;
    A for an infinite gap.
    """
    if math.isinf(gap):
        return ACCELERATION
    wanted = STANDSTILL + max(
        v * HEADWAY + v * (v - leader_speed) / (2 * math.sqrt(ACCELERATION * DECELERATION)), 0.0
    )
    return ACCELERATION * (1.0 - (v / max(v0, 0.1)) ** 4 - (wanted / gap) ** 2)
