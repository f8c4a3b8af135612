"""Whether an event's trigger holds, by ASAM OpenSCENARIO's conditions (simulation_time, traveled_distance, ...)."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from rudc.world.events.stage import pick
from rudc.world.geometry import rectangle_gaps
from rudc.world.scene import Scene

if TYPE_CHECKING:
    from rudc.scenario.triggers import Trigger


def holds(trigger: Trigger, scene: Scene, rng: np.random.Generator) -> bool:
    """Whether every condition of a trigger holds in this scene."""
    return True
