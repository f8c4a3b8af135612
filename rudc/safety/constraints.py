"""From a `Scene` to the `Constraints` of the filter: who and what the ego has to keep clear of.

Vehicles, pedestrians and obstacles (m = 1) are ellipses with half their length and half their width plus a
margin as half axes, at their present velocity. Of those that qualify (`all`, or let through by the gate,
see `gating`), the nearest twelve count. Road-edge points (m = 0) are those of `road_points`.
"""

from __future__ import annotations

import cmath

import numpy as np

from rudc.arrays import Array, Complex, Index
from rudc.safety.barrier import EPSILON, Constraints
from rudc.safety.config import FilterConfig
from rudc.safety.gating import Gate
from rudc.safety.prediction import Predictor
from rudc.safety.road_points import NAMES, RoadPoints, sliding
from rudc.world.scene import Scene


class ConstraintBuilder:
    """Builds the constraints of one instant; remembers the road's edges of the route it saw last."""

    def __init__(self, config: FilterConfig, predictor: Predictor | None = None) -> None:
        """`predictor`: one that somebody else uses, too."""
        self._config = config
        self._gate = Gate(config, predictor or Predictor())
        self._road_points: RoadPoints | None = None

    def build(self, scene: Scene) -> Constraints:
        """The constraints of this scene."""
        short, stretch = self._ellipses(scene)
        chosen = self._chosen(scene, short, stretch)
        n, points = len(chosen), self._points(scene)
        k = n + (0 if points is None else len(NAMES))
        position: Complex = np.empty(k, dtype=np.complex128)
        velocity: Complex = np.empty(k, dtype=np.complex128)
        direction: Complex = np.empty(k, dtype=np.complex128)
        both_short, both_stretch = np.empty((2, k)), np.empty((2, k))
        position[:n], velocity[:n] = _complex(scene.position)[chosen], _complex(scene.velocity)[chosen]
        heading = scene.heading[chosen]
        direction.real[:n], direction.imag[:n] = np.cos(heading), np.sin(heading)
        both_short[:, :n], both_stretch[:, :n] = short[:, chosen], stretch[:, chosen]
        offset, mode, margin = np.zeros(k), np.ones(k), np.full(k, self._config.d_safe)
        if points is not None:
            position[n:], velocity[n:] = self._road(scene, points)
            direction[n:], both_short[:, n:], both_stretch[:, n:] = 1.0, 1.0, 0.0
            offset[n:], mode[n:] = points.offset, 0.0
            margin[n:] = 0.5 * scene.vehicle.width + self._config.road_d_safe
        return Constraints(
            names=tuple(["veh:" + scene.ids[i] for i in chosen.tolist()]) + (NAMES if k > n else ()),
            others=chosen,
            position=position,
            velocity=velocity,
            direction=direction,
            offset=offset,
            mode=mode,
            margin=margin,
            short=both_short,
            stretch=both_stretch,
            road=points,
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

    def _chosen(self, scene: Scene, short: Array, stretch: Array) -> Index:
        """Indices of the others to be constrained, nearest first."""
        if not scene.count:
            return np.empty(0, dtype=np.int64)
        if self._config.constrained == "all":
            return np.arange(scene.count)[: self._config.max_vehicles]
        return self._gate.meeting(scene, short, stretch)[: self._config.max_vehicles]

    def _points(self, scene: Scene) -> RoadPoints | None:
        """The reference points; None if the road is not constrained."""
        if not self._config.road:
            return None
        points = self._road_points
        if points is None or points.route is not scene.route or points.vehicle != scene.vehicle:
            points = self._road_points = RoadPoints(scene.route, scene.vehicle)
        return points

    def _road(self, scene: Scene, points: RoadPoints) -> tuple[Complex, Complex | float]:
        """The reference points' projections (6,) m and the projections' velocities (6,) m/s."""
        ego = scene.ego
        position, heading = complex(ego.x, ego.y), cmath.exp(1j * ego.psi)
        away = points.away(position, heading, scene.ego_s)
        feet = position + points.offset * heading - away
        fixed = self._config.road_points == "fixed"
        return feet, 0.0 if fixed else sliding(away, ego.v * heading)


def _complex(xy: Array) -> Complex:
    """(N,) of (N, 2)."""
    return np.ascontiguousarray(xy).view(np.complex128)[:, 0]
