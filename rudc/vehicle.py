"""The ego vehicle (EV): its body and limits, and what stands between a command and its wheels."""

import math
from dataclasses import dataclass

TURNING = 0.5
"""rad, front-wheel angle of the tightest bend that is planned; what is left serves to stay on it"""


@dataclass(frozen=True, slots=True)
class EgoVehicle:
    """The ego vehicle's body and limits."""

    length: float = 5.0
    """m"""
    width: float = 1.8
    """m"""
    wheelbase: float = 2.8
    """m"""
    cg_to_rear: float = 1.4
    """m, centre of gravity to rear axle"""
    a_min: float = -6.0
    """m/s2, hardest braking"""
    a_max: float = 3.0
    """m/s2"""
    delta_max: float = 0.6
    """rad, largest front-wheel angle to either side"""
    v_max: float = 15.0
    """m/s"""

    @property
    def tightest(self) -> float:
        """1/m, curvature of the tightest bend that is planned."""
        return math.tan(TURNING) / self.wheelbase

    def scaled(self, a: float, delta: float) -> float:
        """Size of a change of an action by a (m/s2) and delta (rad), after both are scaled as an action in
        [-1, 1] is.
        """
        return math.hypot(a / (0.5 * (self.a_max - self.a_min)), delta / self.delta_max)


@dataclass(frozen=True, slots=True)
class Actuation:
    """What stands between a command and the wheels."""

    delay_s: float = 0.0
    """s, dead time of both commands"""
    lag_s: float = 0.0
    """s, first-order time constant of both"""
    friction: float | None = None
    """coefficient mu, None for no limit"""
