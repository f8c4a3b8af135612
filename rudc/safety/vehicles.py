"""The barrier towards vehicles, pedestrians and obstacles. Each is an ellipse that moves at its present
velocity, and so is the ego; the half axes are half the length, and half the width plus a margin. An ellipse
does not cover the body's corners: h < 0 is sure where bodies of 0.7 times the size would overlap.

Of all of them, or of those that the gate lets through (see gating.py), the nearest twelve are constrained
unless settings say otherwise.
"""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

import numpy as np

from rudc.arrays import Array, Flags, Index
from rudc.network.paths import SPACING
from rudc.safety.barrier import BarrierSettings, Found
from rudc.safety.barrier_kernels import ellipses, some_bodies
from rudc.safety.clearance import EPSILON, Bodies, Clearance
from rudc.safety.gating import Gate
from rudc.safety.residual_kernels import vehicle_features
from rudc.safety.rules import NotNegative, Positive
from rudc.settings import within
from rudc.vehicle import EgoVehicle
from rudc.world.scene import Scene

FAR = "farther than that no other road user matters"
BODY = "half axes of a road vehicle, m"


class VehicleSettings(BarrierSettings):
    """Settings of the barrier towards vehicles."""

    constrained: Literal["gated", "all"] = "gated"
    """who is constrained: those whose predicted path meets the ego's (`gated`, ours), or `all`, as in the
    paper"""
    d_safe: Annotated[NotNegative, within(0, 20, FAR)] = 0.5
    """m, safety buffer added to the support radii of ego and vehicle"""
    half_length: Annotated[Positive | None, within(0.1, 20, BODY)] = None
    """m, half axis a of the ego's ellipse; null for half its length, as for others"""
    half_width: Annotated[Positive | None, within(0.1, 20, BODY)] = None
    """m, half axis b of the ego's ellipse; null for half its width plus `width_margin`, as for others"""
    width_margin: Annotated[NotNegative, within(0, 20, FAR)] = 0.1
    """m, added to half the width of a vehicle to give its half axis b (ours)"""
    max_vehicles: Annotated[int | None, within(0, 1000, "null is all there are")] = 12
    """how many vehicles, pedestrians and obstacles are constrained at most, the nearest first (ours);
    null for all of them, as in the paper
    """
    gate_distance: Annotated[NotNegative, within(0, 100, FAR)] = 0.8
    """m, a vehicle is constrained if the predicted gap between the ellipses falls below this (ours)"""
    gate_horizon: Annotated[Positive, within(0.01, 60, "nobody's path is known for longer")] = 3.0
    """s, how far ahead the gate predicts (ours)"""
    gate_step: Annotated[Positive, within(0.01, 60, "each instant looked at takes memory and time")] = 0.2
    """s, time between the instants that the gate checks (ours)"""

    def axes(self, vehicle: EgoVehicle) -> tuple[float, float]:
        """m, half axes a and b of the ego's ellipse."""
        a, b = self.half_length, self.half_width
        return (
            0.5 * vehicle.length if a is None else a,
            0.5 * vehicle.width + self.width_margin if b is None else b,
        )

    def without_effect(self) -> dict[str, str]:
        """The gate's settings, where all are constrained."""
        if self.constrained == "gated":
            return {}
        return {name: "with constrained=all" for name in type(self).model_fields if name.startswith("gate_")}


class VehicleBarrier(Clearance):
    """The barrier towards everybody and everything that moves or stands in the way."""

    name: ClassVar[str] = "vehicle"
    prefix: ClassVar[str | None] = ""
    at_work: ClassVar[bool] = True
    inputs: ClassVar[tuple[str, ...]] = (
        "cos(relative heading)",
        "sin(relative heading)",
        "its speed ahead / 10",
        "its speed to the left / 10",
        "its acceleration / 6",
        "its yaw rate",
        "its half length / 5",
        "its half width / 5",
        "buffer",
    )
    Settings: ClassVar[type[BarrierSettings]] = VehicleSettings

    def __init__(self, settings: VehicleSettings) -> None:
        self.settings = settings
        self._gate = Gate(settings.gate_horizon, settings.gate_step, settings.gate_distance)

    def find(self, scene: Scene) -> Found:
        """See `Barrier`; nearest first."""
        ellipses = self._ellipses(scene)
        chosen = self._chosen(scene, *ellipses)
        return Found(tuple(["veh:" + scene.ids[i] for i in chosen.tolist()]), chosen, ellipses)

    def fill(self, scene: Scene, found: Found, to: Bodies) -> None:
        """See `Clearance`."""
        some_bodies(
            scene.position, scene.velocity, scene.heading, *found.data, found.others, self.settings.d_safe,
            to.position, to.velocity, to.direction, to.mode, to.margin, to.short, to.stretch,
        )  # fmt: skip

    def in_conflict(self, scene: Scene, found: Found) -> Flags:
        """See `Barrier`: those that the ego would meet, as gating.py explains."""
        return self._gate.in_conflict(scene, found.others, *found.data)

    def features(self, scene: Scene, found: Found, part: Bodies, xi: Array) -> None:
        """See `Barrier`."""
        paths = scene.network.paths
        vehicle_features(
            xi, scene.ego.psi, part.direction, part.velocity, part.short, part.stretch, part.margin,
            found.others, scene.acceleration, scene.path, scene.path_s, paths.heading, SPACING,
        )  # fmt: skip

    def _ellipses(self, scene: Scene) -> tuple[Array, Array]:
        """B^2 + eps0 and A^2 - B^2, (2, N) m2 each: for the ego in the first row, the others in the
        second.
        """
        settings = self.settings
        return ellipses(scene.size, *settings.axes(scene.vehicle), settings.width_margin, EPSILON)

    def _chosen(self, scene: Scene, short: Array, stretch: Array) -> Index:
        """Indices of the others to be constrained, nearest first."""
        if not scene.count:
            return np.empty(0, dtype=np.int64)
        if self.settings.constrained == "all":
            return np.arange(scene.count)[: self.settings.max_vehicles]
        return self._gate.meeting(scene, short, stretch)[: self.settings.max_vehicles]
