"""Whether the ego has left the road, or drives against a lane's direction."""

from __future__ import annotations

import cmath
import math
from dataclasses import replace

from rudc.arrays import Complex
from rudc.network.surface import Surface
from rudc.vehicle import EgoVehicle
from rudc.world.scene import EgoState, Scene

OFF_ROAD_M = 0.3
"""m by which a corner of the ego's rectangle may reach over the road's edge"""


class Borders:
    """Tests, in one episode, whether the ego has left the road or drives the wrong way."""

    def __init__(
        self, surface: Surface, vehicle: EgoVehicle, may_cross_centre: bool, over_m: float = OFF_ROAD_M
    ) -> None:
        """`may_cross_centre`: the ego may drive against a lane's direction, so that no direction is wrong.

        `over_m`: m by which a corner may reach over the road's edge.
        """
        self._over_m = over_m
        self._surface, self._vehicle, self._one_way = surface, vehicle, not may_cross_centre
        self._on_road = (0.0, 0.0, 0.0, -math.inf)
        """x, y (m) and psi (rad) for which the corners were tested last, and a distance (m): while no corner
        has moved farther than this, the ego cannot be off the road
        """

    def left(self, state: EgoState) -> tuple[bool, bool]:
        """Whether the ego is off the road, and whether its heading is against the lane at its centre."""
        direction = self._surface.direction(state.x, state.y)
        wrong_way = self._one_way and not math.isnan(direction) and math.cos(state.psi - direction) < 0
        return self._off_road(state), wrong_way

    def _off_road(self, state: EgoState) -> bool:
        """Whether a corner reaches too far over the edge. Tested anew only if one may have moved so far."""
        x, y, psi, room = self._on_road
        body = self._vehicle
        radius = 0.5 * math.hypot(body.length, body.width)
        if math.hypot(state.x - x, state.y - y) + radius * abs(state.psi - psi) < room:
            return False
        forward = 0.5 * body.length * math.cos(state.psi), 0.5 * body.length * math.sin(state.psi)
        left = -0.5 * body.width * math.sin(state.psi), 0.5 * body.width * math.cos(state.psi)
        depth = min(
            self._surface.depth(
                state.x + i * forward[0] + j * left[0], state.y + i * forward[1] + j * left[1]
            )
            for i, j in ((1, 1), (1, -1), (-1, 1), (-1, -1))
        )
        self._on_road = state.x, state.y, state.psi, depth + self._over_m
        return depth < -self._over_m


def leaves_road(scene: Scene, place: Complex, facing: Complex) -> bool:
    """Whether the scene's ego is off the road at one of the places (T,) m, facing as `facing` (T,)."""
    borders = Borders(scene.network.surface, scene.vehicle, may_cross_centre=True)
    return any(
        borders.left(replace(scene.ego, x=at.real, y=at.imag, psi=cmath.phase(ahead)))[0]
        for at, ahead in zip(place.tolist(), facing.tolist(), strict=True)
    )
