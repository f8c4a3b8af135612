"""`FilterConfig`: everything that the safety filter can be told."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import Any, Literal, Self, get_args

from rudc.errors import InputError
from rudc.safety.rows import RowWeights, ecbf_weights, ttcbf_weights

Kind = Literal["ttcbf", "ecbf"]
Constrained = Literal["gated", "all"]
RoadPoints = Literal["sliding", "fixed"]


@dataclass(frozen=True, slots=True, kw_only=True)
class FilterConfig:
    """Settings of a `SafetyFilter`; what the paper gives (Tab. "Hyper-Parameters") is the default."""

    kind: Kind = "ttcbf"
    """truncated Taylor or exponential control barrier function"""
    constrained: Constrained = "gated"
    """vehicles that are constrained: those whose predicted path meets the ego's, or all"""
    dt: float = 0.1
    """s, how long an action is held"""
    ttcbf_rate: float = 0.1
    """TTCBF's class-K factor lambda, in (0, 1]: the share of h that may be lost in a step"""
    ttcbf_gamma: float = 100.0
    """m2/s3, TTCBF's Gamma; Gamma dt^3 bounds what the truncated series leaves out"""
    ecbf_rate1: float = 1.5
    """1/s, lambda1 of ECBF"""
    ecbf_rate2: float = 0.3
    """1/s, lambda2 of ECBF"""
    d_safe: float = 0.5
    """m, safety buffer added to the support radii of ego and vehicle"""
    half_length: float = 2.5
    """m, half axis a of the ego's ellipse; others' is half their length"""
    half_width: float = 1.0
    """m, half axis b of the ego's ellipse"""
    width_margin: float = 0.1
    """m, added to half the width of others to give their half axis b"""
    max_vehicles: int = 12
    """the nearest so many vehicles, pedestrians and obstacles are constrained at most"""
    gate_distance: float = 0.8
    """m, a vehicle is constrained if the predicted gap between the ellipses falls below this"""
    gate_horizon: float = 3.0
    """s, how far ahead the gate predicts"""
    gate_step: float = 0.2
    """s, between the instants that the gate looks at"""
    road: bool = True
    """whether road-edge points are constrained"""
    road_points: RoadPoints = "sliding"
    """whether a projection on the road's edge moves along with the ego, or stands still as in the paper"""
    road_d_safe: float = 0.2
    """m, buffer at road edges beside half the vehicle's width (dbar); a lane has no room for `d_safe`"""
    ttcbf_road_rate: float = 0.3
    """lambda towards road edges; the paper has the same as towards vehicles, which brakes in every bend"""
    ecbf_road_rate1: float = 7.5
    """1/s, lambda1 towards road edges"""
    ecbf_road_rate2: float = 1.5
    """1/s, lambda2 towards road edges"""
    max_steering_correction: float = 0.05
    """largest change of tan(delta_f); inf for none"""
    max_added_acceleration: float = 0.0
    """m/s2, by how much the filter may raise the acceleration: not at all, it brakes and steers. Free to do
    so (inf, as in the paper) it drives into whoever is ahead to get away from whoever comes from behind"""
    acceleration_weight: float = 1.0
    """w_a, cost of a squared correction of 1 m/s2"""
    steering_weight: float = 20.0
    """w_z, cost of a squared correction of tan(delta_f) by 1"""
    vehicle_slack_weight: float = 1e5
    """cost of a squared slack of 1 m2 per step of a vehicle's constraint when there is no solution without"""
    road_slack_weight: float = 1e2
    """the same for a road-edge point"""
    backup: bool = True
    """whether an action must leave the ego a way to stop, or to go on, without hitting anybody"""
    backup_margin: float = 0.3
    """m, how far it stays away from others then"""
    solver: str = "piqp"
    """QP solver: `piqp` by its own interface, any other by the name it has in qpsolvers"""

    def __post_init__(self) -> None:
        """Refuse what cannot work, naming every field that is wrong."""
        choices = {"kind": Kind, "constrained": Constrained, "road_points": RoadPoints}
        problems = [
            f"{name} must be one of {', '.join(get_args(kind))}, not {getattr(self, name)!r}"
            for name, kind in choices.items()
            if getattr(self, name) not in get_args(kind)
        ]
        for field in fields(self):
            value = getattr(self, field.name)
            if isinstance(value, bool) or not isinstance(value, (int, float)):
                continue
            least_is_fine = field.name in _MAY_BE_ZERO
            finite = math.isfinite(value) or (field.name in _MAY_BE_INFINITE and value > 0)
            if not finite or value < 0 or (value == 0 and not least_is_fine):
                problems.append(
                    f"{field.name} must be {'at least 0' if least_is_fine else 'positive'}, not {value}"
                )
        for name in ("ttcbf_rate", "ttcbf_road_rate"):
            if getattr(self, name) > 1:
                problems.append(f"{name} must be at most 1, not {getattr(self, name)}")
        if problems:
            raise InputError("safety filter: " + "; ".join(problems))

    @classmethod
    def preset(cls, kind: str, **changes: Any) -> Self:
        """`ttcbf` or `ecbf` as agents named `+ttcbf`, `+ecbf` have it; `changes` are fields set otherwise."""
        unknown = [name for name in changes if name not in cls.__dataclass_fields__]
        if unknown:
            raise InputError(f"safety filter: no such setting: {', '.join(unknown)}")
        return cls(**{"kind": kind, **changes})

    def row_weights(self, *, road: bool) -> RowWeights:
        """What makes a row out of h, h' and h'', for vehicles or for road-edge points."""
        if self.kind == "ttcbf":
            return ttcbf_weights(self.ttcbf_road_rate if road else self.ttcbf_rate, self.ttcbf_gamma, self.dt)
        if road:
            return ecbf_weights(self.ecbf_road_rate1, self.ecbf_road_rate2, self.dt)
        return ecbf_weights(self.ecbf_rate1, self.ecbf_rate2, self.dt)


_MAY_BE_ZERO = frozenset(
    {
        "ttcbf_gamma",
        "d_safe",
        "width_margin",
        "max_vehicles",
        "gate_distance",
        "road_d_safe",
        "backup_margin",
        "max_steering_correction",
        "max_added_acceleration",
    }
)
_MAY_BE_INFINITE = frozenset({"max_steering_correction", "max_added_acceleration"})
