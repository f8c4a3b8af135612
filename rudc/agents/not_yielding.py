"""How an ego that has right of way meets a vehicle that should give way to it, but does not look like it.

Such a vehicle needs NEEDED or more to stop before the place where the two ways meet, and brakes with less
than SHARE of it. In ordinary traffic that is rare: drivers who give way begin to brake earlier. On a slippery
road they begin earlier still: where the road leaves the ego less than HARDEST and less than its brakes can
give, NEEDED shrinks in proportion. If it and the ego would come to that place at nearly the same time
(rudc/agents/gaps.py), the ego drives no faster than it can stop from before it, braking at PLANNED. Where it
cannot stop there any more, the command stays as it is.

Without this rule only the filter and the last resort would slow the ego down, and only when a collision is
near: on a wet road it then stops in the way of the other.
"""

from __future__ import annotations

import numpy as np

from rudc.agents.approach import AT_POINT, HARDEST, PLANNED
from rudc.agents.gaps import crossing, suffices
from rudc.agents.kernels import any_unbraked
from rudc.arrays import Array
from rudc.env.tracking import at_most, hardest, planned, slowing, speeds_on_road
from rudc.world.scene import Scene

NEEDED = 1.5
"""m/s2, least braking to stop before the ego's way from which on a vehicle that gives way brakes already, on
a dry road"""
SHARE = 0.5
"""share of the braking that it needs; a vehicle that brakes with less does not look like giving way"""
MARGIN = 0.5
"""s between the ego and the other, below which they come at nearly the same time"""
LEAST_ROOM = 0.5
"""m, distance to the ego's way that is assumed of a vehicle that is there already: one that creeps, at up to
1.2 m/s, may be about to stop"""


def ready_for_not_yielding(scene: Scene, u: Array) -> Array:
    """(2,) the command u (2,), m/s2 and rad, with its acceleration bounded so that the ego can still stop
    before the way of each vehicle that should give way to it and does not look like it."""
    grip = hardest(scene, HARDEST)
    on_dry = min(HARDEST, -scene.network.vehicle.a_min)
    least, enough = scene.ego.v**2 / (2 * grip), NEEDED * grip / on_dry
    found = crossing(scene) if _may_heed(scene, least, enough) else None
    if found is None:
        return u
    needed = found.speed**2 / (2 * np.maximum(found.other_in, LEAST_ROOM))
    heeded = ~found.yields & (needed > enough) & (found.braking < SHARE * needed) & (found.ego_in > least)
    if not heeded.any():
        return u
    if_ego_yields = found._replace(yields=np.ones_like(found.yields))
    profile, a = speeds_on_road(scene), max(float(u[0]), 0.0)
    heeded &= ~suffices(scene, if_ego_yields, profile, margin=MARGIN, acceleration=a)
    if not heeded.any():
        return u
    room = float(found.ego_in[heeded].min()) - AT_POINT
    return at_most(u, slowing(scene, room, 0.0, planned(scene, PLANNED)))


def _may_heed(scene: Scene, least: float, enough: float) -> bool:
    """Whether there may be somebody to heed. The ego needs `least` m to stop; whoever needs less than
    `enough` m/s2 is not heeded. Usually there is nobody, and this check is much cheaper than the full one."""
    route, paths = scene.route, scene.network.paths
    met = scene.network.crossings(route, route.row)
    return any_unbraked(
        scene.path, scene.path_s, scene.size, scene.velocity, scene.acceleration, paths.origin,
        int(paths.origin[route.row]), scene.network.gives_way(route, route.row), met.table, met.again,
        scene.front_s, least, enough, SHARE, LEAST_ROOM,
    )  # fmt: skip
