"""The ego vehicle (EV): its body and limits, and how its car carries out a command."""

import math
from dataclasses import asdict, dataclass
from numbers import Real

from rudc.errors import InputError

TURNING, SHARE = 0.5, 5.0 / 6.0
"""rad, and share of `delta_max`: the front-wheel angle of the tightest bend that is planned is the smaller of
the two; the rest, up to `delta_max`, is kept for corrections that keep the EV on the planned line"""


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
        return math.tan(min(TURNING, SHARE * self.delta_max)) / self.wheelbase

    def check(self) -> None:
        """Raise InputError if a value is no finite number, or if no car can have these. Not done whenever
        one is made: where the road is known to give nothing, `a_min` and `a_max` of a scene's are 0.
        """
        for name, value in asdict(self).items():
            if not isinstance(value, Real) or not math.isfinite(value):
                raise InputError(f"ego vehicle: {name}={value!r} is no finite number")
        needed = {
            "length > 0, width > 0, v_max > 0": min(self.length, self.width, self.v_max) > 0,
            "0 < cg_to_rear < wheelbase": 0 < self.cg_to_rear < self.wheelbase,
            "a_min < 0 < a_max": self.a_min < 0 < self.a_max,
            "0 < delta_max < pi/2": 0 < self.delta_max < math.pi / 2,
        }
        for condition, holds in needed.items():
            if not holds:
                raise InputError(f"ego vehicle: it must be that {condition}, unlike in {self}")

    def scaled(self, a: float, delta: float) -> float:
        """Size (a norm, without unit) of a change of the action by `a` m/s2 and `delta` rad, each in units in
        which the vehicle's range is [-1, 1].
        """
        return math.hypot(a / (0.5 * (self.a_max - self.a_min)), delta / self.delta_max)


@dataclass(frozen=True, slots=True)
class Actuation:
    """How the car carries out a command: dead time, lag, and the friction of the road."""

    delay_s: float = 0.0
    """s, dead time of both commands"""
    lag_s: float = 0.0
    """s, first-order time constant of both"""
    friction: float | None = None
    """coefficient mu; None for that of a dry road (`DRY` of rudc/world/ego.py)"""
