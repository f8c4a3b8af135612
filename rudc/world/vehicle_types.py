"""The classes of vehicles that drive, and what SUMO is told of them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from rudc.world.scene import Kind

if TYPE_CHECKING:
    from rudc.scenario.plan import TrafficPlan
    from rudc.vehicle import EgoVehicle

EGO = "ego"
EMERGENCY_DECEL = 9.0
"""m/s2, hardest braking of an SV on a dry road"""


@dataclass(frozen=True, slots=True)
class VehicleType:
    """A class of vehicles; sizes in m, speed in m/s. `vclass` is SUMO's name of the class."""

    kind: Kind
    vclass: str
    length: float
    width: float
    max_speed: float


VEHICLE_TYPES = {
    "car": VehicleType(Kind.CAR, "passenger", 5.0, 1.8, 30.0),
    "truck": VehicleType(Kind.TRUCK, "truck", 7.5, 2.4, 22.0),
    "bus": VehicleType(Kind.BUS, "bus", 12.0, 2.5, 20.0),
    "motorcycle": VehicleType(Kind.MOTORCYCLE, "motorcycle", 2.2, 0.9, 30.0),
    "bicycle": VehicleType(Kind.BICYCLE, "bicycle", 1.8, 0.65, 5.5),
}


def type_file(plan: TrafficPlan, ego: EgoVehicle) -> str:
    """Text of SUMO's additional file: one vehicle type for each class, and the ego's."""
    common = (
        f'carFollowModel="IDM" speedDev="0" '
        f'impatience="{plan.impatience:g}" jmTimegapMinor="{plan.minor_gap_s:g}" '
        f'tau="{plan.headway_s.mean:g}" minGap="{plan.min_gap_m.mean:g}" '
        f'accel="{plan.accel.mean:g}" decel="{plan.decel.mean:g}" emergencyDecel="{EMERGENCY_DECEL:g}"'
    )
    bodies = {name: (t.vclass, t.length, t.width, t.max_speed) for name, t in VEHICLE_TYPES.items()}
    bodies[EGO] = ("passenger", ego.length, ego.width, ego.v_max)
    rows = [
        f'<vType id="{name}" vClass="{vclass}" '
        f'length="{length}" width="{width}" maxSpeed="{speed}" {common}/>'
        for name, (vclass, length, width, speed) in bodies.items()
    ]
    return "<additional>\n" + "\n".join(rows) + "\n</additional>\n"
