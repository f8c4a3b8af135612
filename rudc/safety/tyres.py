"""How hard an ego can brake while it steers: its tyres (rudc/world/kernels.py: within_friction) steer first,
and brake with what is left of the grip.

While it stops, the ego steers no harder than STEERS of the grip. On a dry road full braking is left beside
that, on a poor one (`Scene.grip`) less.
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
"""share of the grip that a command may ask for"""
STEERS = 0.73
"""share of the grip that steering may take while the ego stops"""
BRAKES = math.sqrt(1.0 - STEERS**2)
"""share of the grip that is left for braking then"""


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
        return min(self.braking, self.grip * BRAKES)

    def made_of(self, u: Array, v: float) -> Array:
        """(2,) m/s2 and rad, what is made of the command `u` (2,) at v m/s."""
        a, delta, body = u.item(0), u.item(1), self.body
        if self._at_most(delta, v) ** 2 + a * a <= self.grip**2:  # true of nearly all commands
            return u
        kept = body.delta_max, body.wheelbase, body.cg_to_rear
        return np.array(within_friction(a, delta, v, self.grip, *kept))

    def firm(self, delta: float, v: float) -> float:
        """rad, `delta` cut to what the ego steers at v m/s while it stops."""
        if self._at_most(delta, v) <= STEERS * self.grip:
            return delta
        body = self.body
        most = widest(v, STEERS * self.grip, body.delta_max, body.wheelbase, body.cg_to_rear)
        return min(max(delta, -most), most)

    def stop(self, delta: float, v: float) -> tuple[float, float]:
        """rad and m/s2, steering and braking of who stops from v m/s with the wheels at `delta` rad."""
        lateral = self._at_most(delta, v)
        if lateral <= STEERS * self.grip and lateral**2 + self.braking**2 <= self.grip**2:
            return delta, self.braking
        firm, body = self.firm(delta, v), self.body
        bend = math.sin(slip_of(firm, body.wheelbase, body.cg_to_rear)) / body.cg_to_rear
        return firm, self.beside(bend, v)

    def beside(self, bend: float, v: float) -> float:
        """m/s2, hardest braking from v m/s on in a bend of `bend` 1/m, with STEERS of the grip at most."""
        lateral = min(v * v * abs(bend), STEERS * self.grip)
        return min(self.braking, math.sqrt(self.grip**2 - lateral**2))

    def _at_most(self, delta: float, v: float) -> float:
        """m/s2, at most the lateral acceleration at v m/s with the wheels at `delta` rad."""
        return v * v * math.tan(abs(delta)) / self.body.wheelbase


def tyres_of(scene: Scene) -> Tyres:
    """The tyres of a scene's ego; where nothing is known of the road, it is dry."""
    body, grip = scene.vehicle, min(scene.grip, DRY * GRAVITY)
    return Tyres(body, grip, min(-body.a_min, USABLE * grip))
