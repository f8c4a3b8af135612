"""How fast an ego comes up behind its leader: it can stop behind it on a poor road, too.

The road may turn poor, or the leader brake, when it is late to learn of it. So at v m/s the ego keeps

    v^2 / (2 PLANNED) <= gap - STANDSTILL + v_leader^2 / (2 LEADER)

of a leader that may brake at LEADER until it stands (as the safe distance of Shalev-Shwartz et al., "On a
formal model of safe and scalable self-driving cars", 2017, where the follower brakes less hard). The leader
is whoever moves the ego's way and is first in the band that it is about to sweep. Round those who stand there
may be a course (courses.py), which says how near one comes.
"""

from __future__ import annotations

import math

from rudc.agents.kernels import who_leads
from rudc.arrays import Array
from rudc.env.tracking import at_most, slowing
from rudc.network.paths import SPACING
from rudc.world.scene import STANDING, Scene

REACH = 50.0
"""m ahead in which a leader is looked for"""
PLANNED, LEADER = 3.0, 4.5
"""m/s2, m/s2: how hard the ego plans to brake, about what ice gives, and how hard its leader may"""
STANDSTILL = 1.0
"""m"""
SAME_WAY = 0.7
"""cosine of the angle to the path up to which one heads the ego's way"""


def ready_to_follow(scene: Scene, u: Array) -> Array:
    """(2,) what of the command u (2,), m/s2 and rad, leaves the ego able to stop behind its leader."""
    line, body = scene.route.path, scene.vehicle
    gap, along = who_leads(
        line.xy, line.heading, SPACING, scene.position, scene.heading, scene.velocity, scene.size,
        scene.ego_s, body.length, body.width, STANDING, SAME_WAY, REACH,
    )  # fmt: skip
    if not 0.0 < gap < math.inf:
        return u
    return at_most(u, slowing(scene, gap - STANDSTILL + along**2 / (2 * LEADER), 0.0, PLANNED))
