"""Actions in [-1, 1], as the environment and learning agents use them, and in the world's physical units.

The map is affine on each axis: -1 and 1 are the vehicle's limits, [a_min, a_max] m/s2 and +-delta_max rad. As
braking is harder than acceleration, 0 on the first axis is a light braking of (a_min + a_max) / 2.
"""

from __future__ import annotations

import numpy as np

from rudc.arrays import Array
from rudc.vehicle import EgoVehicle


def to_physical(action: Array, vehicle: EgoVehicle) -> Array:
    """(2,) acceleration m/s2 and front-wheel angle rad, of an action (2,), which is cut to [-1, 1]."""
    a, delta = (min(max(float(value), -1.0), 1.0) for value in action)
    middle, half = 0.5 * (vehicle.a_max + vehicle.a_min), 0.5 * (vehicle.a_max - vehicle.a_min)
    return np.array([middle + half * a, vehicle.delta_max * delta])


def to_normalised(u: Array, vehicle: EgoVehicle) -> Array:
    """(2,) the action in [-1, 1] that `to_physical` turns into u (2,), which is cut to the limits."""
    middle, half = 0.5 * (vehicle.a_max + vehicle.a_min), 0.5 * (vehicle.a_max - vehicle.a_min)
    a, delta = (float(u[0]) - middle) / half, float(u[1]) / vehicle.delta_max
    return np.array([min(max(a, -1.0), 1.0), min(max(delta, -1.0), 1.0)])
