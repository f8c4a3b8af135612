"""The gate: which others the filter constrains, namely those whose predicted path meets the ego's.

The barrier assumes that others keep their velocity, so that a vehicle which turns off before it reaches the
ego, or oncoming traffic on its own lane, looks like a threat. The gate therefore checks first whether the two
meet when each follows its own path (see prediction.py) at its present speed. A vehicle is let through, that
is, constrained, if at some instant within the horizon

    |r| < rho_e + rho_o + gate_distance

with the ellipses' support radii (see clearance.py) at the predicted poses.

Of those that are constrained, some are in conflict: their ellipses meet the ego's, with no distance added, if
the ego goes on at its present speed or if it accelerates along its route. Their rows come first where no
action satisfies all rows. A car that passes on the next lane is constrained, but not in conflict.

A body that stands needs no prediction. It is let through only if, besides, its rectangle comes closer than
PASSING to the ego's rectangle on the ego's way: by ellipse and distance alone, a gap of a metre and a half
would count as closed.

A vehicle that comes towards the ego on its own path is not let through if it drives past: if the rectangles
of the two stay the gate distance apart, both where the ego keeps its speed and where it accelerates. Without
this the ego would stop in a narrow road for each vehicle that comes on the lane beside.

A vehicle that drives behind the ego on the ego's own path is neither let through nor in conflict, since it is
that vehicle's task to keep its distance. The barrier would push the two apart: a vehicle that comes from
behind at constant speed would make a waiting ego drive into the one ahead.
"""

from __future__ import annotations

import cmath
import math

import numpy as np

from rudc.arrays import Array, Flags, Index
from rudc.safety.kernels import in_conflict, let_through
from rudc.safety.prediction import ALONG, GO_ACCELERATION, GO_SPEED, LANE, TAIL, bodies, lines
from rudc.world.scene import STILL, Scene

CONFLICT_TIMES: Array = np.linspace(0.0, 3.0, 16)
"""(T,) s, instants at which conflicts are looked for"""

PASSING = 0.15
"""m, gap between rectangles with which the ego may pass a body that stands, the same as in the last resort;
courses keep more"""
SLOWEST = 3.0
"""m/s, least speed that is assumed for the length of the ego's way past bodies that stand"""
_SHARES: Array = np.linspace(0.0, 1.0, 40)
"""shares of that way at which it is checked"""


class Gate:
    """Picks the others that the ego may meet."""

    def __init__(self, horizon: float, step: float, distance: float) -> None:
        """`horizon`: s, how far ahead the gate predicts; `step`: s, at most this much between the instants
        that it checks; `distance`: m, the gate distance between the ellipses.
        """
        self._times: Array = np.linspace(0.0, horizon, math.ceil(horizon / step - 1e-9) + 1)
        self._horizon = horizon
        self._gap = distance

    def meeting(self, scene: Scene, short: Array, stretch: Array) -> Index:
        """(n,) indices, nearest first, of the others that the gate lets through.

        `short`, `stretch`: (2, N) m2, for the ego (first row) and for the others, the squared half axis
        across plus eps0, and the squared half axis along minus that across.
        """
        ego, body = scene.ego, scene.vehicle
        way = self._horizon * max(ego.v, SLOWEST) * _SHARES
        return let_through(
            *bodies(scene), *lines(scene), scene.route.path.poses, scene.ego_s,
            complex(ego.x, ego.y), cmath.exp(1j * ego.psi), ego.v,
            min(GO_ACCELERATION, body.a_max), min(GO_SPEED, body.v_max),
            self._times, self._gap, short, stretch,
            TAIL, LANE, ALONG, STILL, PASSING, way, 0.5 * body.length, 0.5 * body.width,
        )  # fmt: skip

    def in_conflict(self, scene: Scene, who: Index, short: Array, stretch: Array) -> Flags:
        """(n,) whether each of the others `who` (n,) is in conflict with the ego; `short` and `stretch`
        (2, N) as for `meeting`.
        """
        ego, body = scene.ego, scene.vehicle
        return in_conflict(
            *bodies(scene), *lines(scene), scene.route.path.poses, scene.ego_s,
            complex(ego.x, ego.y), cmath.exp(1j * ego.psi), ego.v,
            min(GO_ACCELERATION, body.a_max), min(GO_SPEED, body.v_max),
            CONFLICT_TIMES, short, stretch, who, TAIL, LANE, ALONG,
        )  # fmt: skip
