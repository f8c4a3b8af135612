"""Road-edge points: the places on the road's edges that are nearest to the ego's reference points.

The paper (Fig. "Spatial safety constraints" b) projects the centre of gravity and the points at 1/3 and
2/3 of the wheelbase on the edges. Each is constrained against its own projection; against another's, |r|
would not be a distance to the edge.

A projection slides along the edge as the ego drives. The paper lets it stand (v_o = 0), and then driving
along the edge counts as driving away from it: h'' gains 2 v^2, at 10 m/s 1 m2 a step, more than any drift
towards the edge takes. Measured on the four-way junction, with a driver that drifts sideways: such rows
change nothing. Where they slide, v_o is the reference point's velocity without its part along r, so that r
keeps square to the edge: exact for a straight edge, on the safe side where it bends away from the road.

|r| has no sign: a reference point beyond the edge is pushed away from it, outwards. With half the
vehicle's width inside d, h is negative long before.
"""

from __future__ import annotations

import numpy as np

from rudc.arrays import Array, Complex
from rudc.network.route import Route
from rudc.safety.barrier_kernels import to_edges
from rudc.vehicle import EgoVehicle

REACH = 8.0
"""m of path before and after the ego within which projections are looked for"""
POINTS = ("cg", "third", "two_thirds")
NAMES = tuple(f"road:{side}:{point}" for side in ("left", "right") for point in POINTS)
"""of the six constraints, left edge first"""


class RoadPoints:
    """Both edges of one route, and the reference points of one vehicle to be kept off them."""

    def __init__(self, route: Route, vehicle: EgoVehicle) -> None:
        edges = np.stack([route.left_edge, route.right_edge])
        self._edges: Complex = edges[..., 0] + 1j * edges[..., 1]
        self.route = route
        self.vehicle = vehicle
        third = vehicle.wheelbase / 3
        self._ahead: Array = np.array([0.0, third, 2 * third]) - [0.0, vehicle.cg_to_rear, vehicle.cg_to_rear]
        self.offset: Array = np.concatenate([self._ahead, self._ahead])
        """(6,) m, reference points ahead of the centre of gravity, once for each edge"""
        self._spacing = float(route.path.s[1] - route.path.s[0])

    def away(self, position: complex, heading: complex, s: float) -> Complex:
        """(6,) m from each reference point's projection on its edge to the point itself (r).

        `position` m and `heading` e^(i psi) of the centre of gravity, `s` m its arc length on the route.
        """
        return to_edges(self._edges, self._spacing, REACH, position, heading, self._ahead, s)
