"""What a road lets the ego do, and how fast it may drive where it grips poorly.

mu g is the road's grip. The ego's commands ask for USABLE of it (rudc/agents/adaptation.py): in the scene
that a driver is shown, `vehicle.a_min` is -USABLE mu g, or the vehicle's own full braking if that is less.
"""

from __future__ import annotations

import math

from rudc.safety.tyres import USABLE
from rudc.world.scene import Scene

BRAKING = 0.6
"""share of mu g that planned braking may ask for"""
POOR = 6.0
"""m/s2, grip below this is poor: it is what full braking needs on a dry road"""
CAREFUL = 6.0
"""m/s, always allowed on straights"""
STOPPING = 25.0
"""m, within which the ego can stop on straights where grip is poor, unless it drives at CAREFUL or less"""


def careful(braking: float) -> float:
    """m/s, highest speed on straights of a poor road, where planned braking is `braking` m/s2."""
    return max(CAREFUL, math.sqrt(2.0 * braking * STOPPING))


def fastest(scene: Scene) -> float:
    """m/s, highest speed on straights; inf where the road does not grip poorly, as far as its braking shows
    that."""
    usable = -scene.vehicle.a_min
    if usable >= min(-scene.network.vehicle.a_min, USABLE * POOR):
        return math.inf
    return careful(BRAKING / USABLE * usable)
