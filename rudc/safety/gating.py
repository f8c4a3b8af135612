"""Which others the filter constrains: those whose predicted path meets the ego's.

The barrier assumes that others keep their velocity, so that a vehicle which turns off before the ego, or
oncoming traffic on its own lane, looks like a threat. The gate asks first whether the two meet when each
follows its own path (see `prediction`) at its present speed. A vehicle is let through to the rows if at some
instant within the horizon

    |r| < rho_e + rho_o + gate_distance

with the ellipses' support radii (see `barrier`) at the predicted poses.

Of those that are constrained, the ones in conflict come first where no action satisfies all rows: their
ellipses meet the ego's, without any distance added, if it goes on at its present speed or if it accelerates
along its route. A car that passes on the next lane is constrained, but not in conflict.

Who stands is let through only if the rectangles on the ego's way say so, since nothing is to be predicted of
it: an ellipse and a distance around it would close a gap of a metre and a half.

Not let through, and in no conflict, is who drives behind the ego on the ego's own path: that distance is
theirs to keep. The barrier has the two push each other apart, so that a vehicle coming up from behind at
constant speed makes a waiting ego drive into the one ahead.
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
"""(T,) s, when conflicts are looked for"""

PASSING = 0.2
"""m beside the ego's rectangle on its way, with which somebody who stands is passed; courses keep more"""
SLOWEST = 3.0
"""m/s, at least, of an ego that is taken to pass"""
_SHARES: Array = np.linspace(0.0, 1.0, 40)
"""of that way, where it is looked at"""


class Gate:
    """Picks the others that the ego may meet."""

    def __init__(self, horizon: float, step: float, distance: float) -> None:
        """`horizon` s, looked at every `step` s at most; `distance` m between the ellipses."""
        self._times: Array = np.linspace(0.0, horizon, math.ceil(horizon / step - 1e-9) + 1)
        self._horizon = horizon
        self._gap = distance

    def meeting(self, scene: Scene, short: Array, stretch: Array) -> Index:
        """Indices, nearest first, of those whose ellipse comes closer to the ego's than the gate distance.

        `short` and `stretch` (2, N) m2: squares of the half axes across, and along minus across, of ego and
        others.
        """
        ego, body = scene.ego, scene.vehicle
        way = self._horizon * max(ego.v, SLOWEST) * _SHARES
        return let_through(
            *bodies(scene), *lines(scene), scene.route.path.poses, scene.ego_s,
            complex(ego.x, ego.y), cmath.exp(1j * ego.psi), ego.v, self._times, self._gap, short, stretch,
            TAIL, LANE, ALONG, STILL, PASSING, way, 0.5 * body.length, 0.5 * body.width,
        )  # fmt: skip

    def in_conflict(self, scene: Scene, who: Index, short: Array, stretch: Array) -> Flags:
        """(n,) which of the others `who` (n,) are in conflict with the ego; `short` and `stretch` (2, N) as
        for `meeting`.
        """
        ego = scene.ego
        return in_conflict(
            *bodies(scene), *lines(scene), scene.route.path.poses, scene.ego_s,
            complex(ego.x, ego.y), cmath.exp(1j * ego.psi), ego.v, GO_ACCELERATION, GO_SPEED,
            CONFLICT_TIMES, short, stretch, who, TAIL, LANE, ALONG,
        )  # fmt: skip
