"""How hard an ego can brake while it steers: its tyres (rudc/world/kernels.py: within_friction) steer first,
and brake with what is left of the grip.

While it stops, the ego steers no harder than STEERS of the grip. On a dry road full braking is left beside
that, on a poor one, where `vehicle.a_min` is USABLE of the grip (rudc/agents/adaptation.py), less.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from rudc.arrays import Array
from rudc.vehicle import EgoVehicle
from rudc.world.ego import DRY, GRAVITY
from rudc.world.kernels import slip_of, widest, within_friction
from rudc.world.scene import Scene

USABLE = 0.9
"""share of the grip that braking may use"""
STEERS = 0.73
"""share of the grip that steering may take while the ego stops"""


class Tyres(NamedTuple):
    """The grip of a scene's ego, as it is known."""

    body: EgoVehicle
    grip: float
    """m/s2"""
    braking: float
    """m/s2, hardest braking straight on"""

    @property
    def least(self) -> float:
        """m/s2, hardest braking beside the hardest steering of a stop."""
        return min(self.braking, self.grip * math.sqrt(1.0 - STEERS**2))

    def made_of(self, u: Array, v: float) -> Array:
        """(2,) m/s2 and rad, what is made of the command `u` (2,) at v m/s."""
        body = self.body
        return np.array(
            within_friction(
                float(u[0]), float(u[1]), v, self.grip, body.delta_max, body.wheelbase, body.cg_to_rear
            )
        )

    def firm(self, delta: float, v: float) -> float:
        """rad, `delta` cut to what the ego steers at v m/s while it stops."""
        body = self.body
        most = widest(v, STEERS * self.grip, body.delta_max, body.wheelbase, body.cg_to_rear)
        return min(max(delta, -most), most)

    def beside(self, bend: float, v: float) -> float:
        """m/s2, hardest braking from v m/s on in a bend of `bend` 1/m, with STEERS of the grip at most."""
        lateral = min(v * v * abs(bend), STEERS * self.grip)
        return min(self.braking, math.sqrt(self.grip**2 - lateral**2))

    def bend(self, delta: float) -> float:
        """1/m, curvature of the way at the wheels' angle `delta` rad."""
        return math.sin(slip_of(delta, self.body.wheelbase, self.body.cg_to_rear)) / self.body.cg_to_rear


def tyres_of(scene: Scene) -> Tyres:
    """The tyres of a scene's ego. Where its `vehicle` brakes less hard than the network's, that says how well
    the road grips; else it is dry.
    """
    body = scene.vehicle
    poor = body.a_min > scene.network.vehicle.a_min
    grip = -body.a_min / USABLE if poor else DRY * GRAVITY
    return Tyres(body, grip, min(-body.a_min, USABLE * grip))
