"""How fast an ego may drive behind its leader, so that it can stop behind it on a poor road too.

An ego learns that the road has become poor only when it brakes. So at v m/s it keeps

    v^2 / (2 PLANNED) <= gap - PULL_OUT + v_leader^2 / (2 LEADER)

Then it can stop behind a leader that brakes at LEADER until it stands, by braking at PLANNED; on a road that
is known to be poor, what that road gives replaces PLANNED. This is the safe distance of Shalev-Shwartz et
al., "On a formal model of safe and scalable self-driving cars", 2017, with a follower that brakes less hard.
The leader is the first vehicle that moves in the ego's direction, however slowly, in the band of road that
the ego is about to drive over, on the next REACH m or, if that is more, as far as it needs to stop; only what
its body covers of the band counts, and who is in it beside the ego is left to the filter. Vehicles that stand
still there are left to courses.py: a course may lead round them, and needs PULL_OUT m for that.

Somebody may step out between the two, and a patch of ice is seen only once the ego is on it. So the ego also
keeps HEADWAY_S behind its leader, the two seconds that driving schools teach, by

    a <= max(-EASES, (gap - HEADWAY_S v) / SETTLES_S^2 + (v_leader - v) / SETTLES_S)
"""

from __future__ import annotations

import math

from rudc.agents.kernels import who_leads
from rudc.arrays import Array
from rudc.env.conflict import REACH
from rudc.env.tracking import at_most, planned, slowing, stopping
from rudc.network.paths import SPACING
from rudc.safety.prediction import ALONG
from rudc.world.scene import STILL, Scene

PLANNED, LEADER = 3.0, 4.5
"""m/s2, m/s2: how hard the ego plans to brake, about what ice gives, and how hard its leader may brake"""
HEADWAY_S = 2.0
"""s of its way that the ego keeps free behind its leader"""
SETTLES_S = 1.5
"""s, in about which it comes to that distance"""
EASES = 1.5
"""m/s2, how hard it brakes for that distance alone"""
PULL_OUT = 3.0
"""m, distance kept behind vehicles that stand: nearer, the ego could not pull out"""


def ready_to_follow(scene: Scene, u: Array) -> Array:
    """(2,) the command u (2,), m/s2 and rad, with an acceleration after which the ego can still stop
    behind its leader, and comes to its distance from it."""
    line, body = scene.route.path, scene.vehicle
    braking = planned(scene, PLANNED)
    gap, along = who_leads(
        line.xy, line.heading, SPACING, scene.position, scene.heading, scene.velocity, scene.size,
        scene.ego_s, body.length, body.width, STILL, ALONG,
        max(REACH, PULL_OUT + stopping(scene, braking)),
    )  # fmt: skip
    if math.isinf(gap):
        return u
    room, v = gap - PULL_OUT + along**2 / (2 * LEADER), scene.ego.v
    keeps = (gap - HEADWAY_S * v) / SETTLES_S**2 + (along - v) / SETTLES_S
    return at_most(u, min(slowing(scene, room, 0.0, braking), max(keeps, -EASES)))
