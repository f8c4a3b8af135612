"""`FilterConfig`: everything that the safety filter can be told.

Defaults are the paper's (Tab. "Hyper-Parameters") where a docstring does not say "ours". The paper's filter
as written is `paper_settings`. It gives neither d_safe, dbar nor the weights of the QP: these are ours.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal, Self

from pydantic import Field, PlainSerializer, ValidationError

from rudc.errors import InputError
from rudc.hints import there_are
from rudc.kinds import problems
from rudc.safety.rows import RowWeights, ecbf_weights, ttcbf_weights
from rudc.settings import Settings

Rule = Literal["ttcbf", "ecbf"]
Constrained = Literal["gated", "all"]
RoadPoints = Literal["sliding", "fixed"]

Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Share = Annotated[float, Field(gt=0, le=1, allow_inf_nan=False)]
Unbounded = Annotated[
    float,
    Field(ge=0),
    PlainSerializer(lambda value: "inf" if value == math.inf else value, when_used="json"),
]
"""at least 0; infinity, which JSON lacks, is written "inf" """


class FilterConfig(Settings):
    """Settings of a `SafetyFilter`. What has no effect under the others (`ecbf_rate1` under `ttcbf`) is
    refused, and is not written.
    """

    rule: Rule = "ttcbf"
    """truncated Taylor or exponential control barrier function"""
    constrained: Constrained = "gated"
    """vehicles that are constrained: those whose predicted path meets the ego's (ours), or all, as in the
    paper
    """
    dt: Positive = 0.1
    """s, how long an action is held"""
    ttcbf_rate: Share = 0.1
    """TTCBF's class-K factor lambda, in (0, 1]: the share of h that may be lost in a step"""
    ttcbf_gamma: NotNegative = 100.0
    """m2/s3, TTCBF's Gamma; Gamma dt^3 bounds what the truncated series leaves out"""
    ecbf_rate1: Positive = 1.5
    """1/s, lambda1 of ECBF"""
    ecbf_rate2: Positive = 0.3
    """1/s, lambda2 of ECBF"""
    d_safe: NotNegative = 0.5
    """m, safety buffer added to the support radii of ego and vehicle"""
    half_length: Positive = 2.5
    """m, half axis a of the ego's ellipse; others' is half their length"""
    half_width: Positive = 1.0
    """m, half axis b of the ego's ellipse"""
    width_margin: NotNegative = 0.1
    """m, added to half the width of others to give their half axis b"""
    max_vehicles: int | None = Field(default=12, ge=0)
    """the nearest so many vehicles, pedestrians and obstacles are constrained at most (ours); null for all of
    them, as in the paper
    """
    gate_distance: NotNegative = 0.8
    """m, a vehicle is constrained if the predicted gap between the ellipses falls below this (ours)"""
    gate_horizon: Positive = 3.0
    """s, how far ahead the gate predicts (ours)"""
    gate_step: Positive = 0.2
    """s, between the instants that the gate looks at (ours)"""
    road: bool = True
    """whether road-edge points are constrained"""
    road_points: RoadPoints = "sliding"
    """whether a projection on the road's edge moves along with the ego (ours), or stands still (`fixed`) as
    in the paper
    """
    road_d_safe: NotNegative = 0.2
    """m, buffer at road edges beside half the vehicle's width (dbar) (ours): a lane has no room for `d_safe`
    """
    ttcbf_road_rate: Share = 0.3
    """lambda towards road edges (ours): the paper's, as towards vehicles, brakes in every bend"""
    ecbf_road_rate1: Positive = 7.5
    """1/s, lambda1 towards road edges (ours)"""
    ecbf_road_rate2: Positive = 1.5
    """1/s, lambda2 towards road edges (ours)"""
    max_steering_correction: Unbounded = 0.05
    """largest change of tan(delta_f) (ours); inf for none, as in the paper"""
    max_added_acceleration: Unbounded = 0.0
    """m/s2, by how much the filter may raise the acceleration (ours): not at all, it brakes and steers. Free
    to do so (inf, as in the paper) it drives into whoever is ahead to get away from whoever comes from behind
    """
    acceleration_weight: Positive = 1.0
    """w_a, cost of a squared correction of 1 m/s2"""
    steering_weight: Positive = 20.0
    """w_z, cost of a squared correction of tan(delta_f) by 1"""
    vehicle_violation_weight: Positive = 1e5
    """cost of a squared violation of 1 m2 per step of a vehicle's row when no action satisfies all (ours)"""
    road_violation_weight: Positive = 1e2
    """the same for a road-edge point (ours)"""
    last_resort: bool = True
    """whether an action must leave the ego a way to stop, or to go on, without hitting anybody (ours)"""
    last_resort_margin: NotNegative = 0.3
    """m, how far it stays away from others then (ours)"""
    solver: str = "piqp"
    """QP solver: `piqp` by its own interface, any other by the name it has in qpsolvers"""

    def without_effect(self) -> dict[str, str]:
        """Name of each setting that the others leave without effect -> where (`with rule=ttcbf`)."""
        names = type(self).model_fields
        other = "ecbf" if self.rule == "ttcbf" else "ttcbf"
        idle = {name: f"with rule={self.rule}" for name in names if name.startswith(f"{other}_")}
        if self.constrained == "all":
            idle |= {name: "with constrained=all" for name in names if name.startswith("gate_")}
        if not self.road:
            idle |= {name: "with road=false" for name in names if "road_" in name}
        if not self.last_resort:
            idle["last_resort_margin"] = "with last_resort=false"
        return idle

    @classmethod
    def preset(cls, rule: str, **changes: Any) -> Self:
        """`ttcbf` or `ecbf` as agents named `+ttcbf`, `+ecbf` have it; `changes` are fields set otherwise.
        Raises InputError.
        """
        for name in changes:
            if name not in cls.model_fields:
                raise InputError(
                    f"correction.{name}: there is no such setting{there_are(name, cls.model_fields)}"
                )
        try:
            return cls.model_validate({"rule": rule, **changes})
        except ValidationError as error:
            raise InputError(problems(error, "correction")) from None

    def row_weights(self, *, road: bool) -> RowWeights:
        """What makes a row out of h, h' and h'', for vehicles or for road-edge points."""
        if self.rule == "ttcbf":
            return ttcbf_weights(self.ttcbf_road_rate if road else self.ttcbf_rate, self.ttcbf_gamma, self.dt)
        if road:
            return ecbf_weights(self.ecbf_road_rate1, self.ecbf_road_rate2, self.dt)
        return ecbf_weights(self.ecbf_rate1, self.ecbf_rate2, self.dt)


def paper_settings(rule: Rule) -> dict[str, Any]:
    """The settings in which a filter as the paper has it differs from ours: every vehicle constrained, road
    points that stand still, at the vehicles' buffer and rates, corrections bounded by the vehicle's limits
    only, and no last resort. What to do where no action satisfies all rows the paper leaves open.
    """
    own = FilterConfig.model_fields
    rates = ("rate",) if rule == "ttcbf" else ("rate1", "rate2")
    return {
        "rule": rule,
        "constrained": "all",
        "max_vehicles": None,
        "road_points": "fixed",
        "road_d_safe": own["d_safe"].default,
        **{f"{rule}_road_{rate}": own[f"{rule}_{rate}"].default for rate in rates},
        "max_steering_correction": math.inf,
        "max_added_acceleration": math.inf,
        "last_resort": False,
    }
