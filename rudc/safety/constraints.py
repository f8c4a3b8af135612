"""From a `Scene` to the `Constraints` of the filter: who and what the ego has to keep clear of.

Vehicles, pedestrians and obstacles (m = 1) are ellipses with half their length and half their width plus a
margin as half axes, at their present velocity. Of those that qualify (`all`, or let through by the gate,
see `gating`), the nearest twelve count. Road-edge points (m = 0) are those of `road_points`.
"""

from __future__ import annotations

import cmath

import numpy as np
from numpy.typing import NDArray

from rudc.safety.barrier import EPSILON, Array, Complex, Constraints
from rudc.safety.config import FilterConfig
from rudc.safety.gating import Gate
from rudc.safety.road_points import NAMES, RoadPoints, sliding
from rudc.world.scene import Scene


class ConstraintBuilder:
    """Builds the constraints of one instant; remembers the road's edges of the route it saw last."""

    def __init__(self, config: FilterConfig) -> None:
        self._config = config
        self._gate = Gate(config)
        self._road_points: RoadPoints | None = None

    def build(self, scene: Scene) -> Constraints:
        """The constraints of this scene."""
        config = self._config
        short, stretch = self._ellipses(scene)
        chosen = self._chosen(scene, short, stretch)
        n = len(chosen)
        k = n + (len(NAMES) if config.road else 0)
        position: Complex = np.empty(k, dtype=np.complex128)
        velocity: Complex = np.zeros(k, dtype=np.complex128)
        direction: Complex = np.ones(k, dtype=np.complex128)
        offset, mode, margin = np.zeros(k), np.zeros(k), np.full(k, config.d_safe)
        both_short, both_stretch = np.ones((2, k)), np.zeros((2, k))
        if n:
            position[:n], velocity[:n] = _complex(scene.position[chosen]), _complex(scene.velocity[chosen])
            direction[:n] = np.exp(1j * scene.heading[chosen])
            mode[:n] = 1.0
            both_short[:, :n], both_stretch[:, :n] = short[:, chosen], stretch[:, chosen]
        if config.road:
            points, position[n:], velocity[n:] = self._road(scene)
            offset[n:] = points.offset
            margin[n:] = 0.5 * scene.vehicle.width + config.road_d_safe
        return Constraints(
            names=tuple(["veh:" + scene.ids[i] for i in chosen.tolist()]) + (NAMES if config.road else ()),
            others=chosen,
            position=position,
            velocity=velocity,
            direction=direction,
            offset=offset,
            mode=mode,
            margin=margin,
            short=both_short,
            stretch=both_stretch,
            road=self._road_points,
        )

    def _ellipses(self, scene: Scene) -> tuple[Array, Array]:
        """B^2 + eps0 and A^2 - B^2, (2, N) m2 each: ego in the first row, the others in the second."""
        config, n = self._config, scene.count
        half = 0.5 * scene.size
        across = (half[:, 1] + config.width_margin) ** 2
        short, stretch = np.empty((2, n)), np.empty((2, n))
        short[0] = config.half_width**2 + EPSILON
        stretch[0] = config.half_length**2 - config.half_width**2
        short[1] = across + EPSILON
        stretch[1] = half[:, 0] ** 2 - across
        return short, stretch

    def _chosen(self, scene: Scene, short: Array, stretch: Array) -> NDArray[np.int64]:
        """Indices of the others to be constrained, nearest first."""
        if not scene.count:
            return np.empty(0, dtype=np.int64)
        if self._config.constrained == "all":
            return np.arange(min(scene.count, self._config.max_vehicles))
        return self._gate.meeting(scene, short, stretch)[: self._config.max_vehicles]

    def _road(self, scene: Scene) -> tuple[RoadPoints, Complex, Complex]:
        """The reference points, their projections (6,) m and the projections' velocities (6,) m/s."""
        points, ego = self._road_points, scene.ego
        if points is None or points.route is not scene.route or points.vehicle != scene.vehicle:
            points = self._road_points = RoadPoints(scene.route, scene.vehicle)
        position, heading = complex(ego.x, ego.y), cmath.exp(1j * ego.psi)
        away = points.away(position, heading, scene.ego_s)
        feet = position + points.offset * heading - away
        if self._config.road_points == "fixed":
            return points, feet, np.zeros_like(feet)
        return points, feet, sliding(away, ego.v * heading)


def _complex(xy: Array) -> Complex:
    return xy[:, 0] + 1j * xy[:, 1]
