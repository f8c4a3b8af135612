"""Road-edge points: the places on the road's edges that are nearest to the ego's reference points.

The paper (Fig. "Spatial safety constraints" b) projects the centre of gravity and the points at 1/3 and
2/3 of the wheelbase on the edges. Each point is constrained against its own projection; against that of
another, |r| would not be a distance to the edge.

A projection slides along the edge as the ego drives. In the paper it stands still (v_o = 0). Then driving
along the edge counts as driving away from it: h'' grows by 2 v^2, which at 10 m/s is 1 m2 per step, more than
any drift towards the edge takes away. Measured on the four-way junction with a driver that drifts sideways,
such rows change nothing. For projections that slide, v_o is the reference point's velocity without its part
along r, so that r stays at a right angle to the edge. This is exact for a straight edge, and on the safe side
where the edge bends away from the road.

|r| has no sign: a reference point beyond the edge is pushed farther outwards. But d contains half the
vehicle's width, so h is negative long before a point is there.
"""

from __future__ import annotations

import numpy as np

from rudc.arrays import Array, Complex
from rudc.network.paths import SPACING
from rudc.network.route import Route
from rudc.safety.barrier_kernels import to_edges
from rudc.vehicle import EgoVehicle

REACH = 8.0
"""m of path before and after the ego within which projections are looked for"""
POINTS = ("cg", "third", "two_thirds")
NAMES = tuple(f"road:{side}:{point}" for side in ("left", "right") for point in POINTS)
"""names of the six constraints, left edge first"""


class RoadPoints:
    """Both edges of one route, and the reference points of one vehicle that are to be kept off them."""

    def __init__(self, route: Route, vehicle: EgoVehicle) -> None:
        edges = np.stack([route.left_edge, route.right_edge])
        self._edges: Complex = edges[..., 0] + 1j * edges[..., 1]
        self.route = route
        self.vehicle = vehicle
        third = vehicle.wheelbase / 3
        self._ahead: Array = np.array([0.0, third, 2 * third]) - [0.0, vehicle.cg_to_rear, vehicle.cg_to_rear]
        self.offset: Array = np.concatenate([self._ahead, self._ahead])
        """(6,) m, reference points ahead of the centre of gravity, once for each edge"""

    def away(self, position: complex, heading: complex, s: float) -> Complex:
        """(6,) m, vector r from each reference point's projection on its edge to the point itself.

        `position` m and `heading` e^(i psi) of the centre of gravity, `s` m its arc length on the route.
        """
        return to_edges(self._edges, SPACING, REACH, position, heading, self._ahead, s)
