"""The barriers there are, by name."""

from __future__ import annotations

from rudc.errors import InputError
from rudc.imports import Registry
from rudc.safety.barrier import Barrier
from rudc.safety.road_edges import RoadBarrier
from rudc.safety.vehicles import VehicleBarrier

BARRIERS = Registry[type[Barrier]]("rudc.barriers")
"""name -> class, in the order of their rows"""
BARRIERS.update({"vehicle": VehicleBarrier, "road": RoadBarrier})


def register_barrier(barrier: type[Barrier]) -> None:
    """Make a barrier known by its name: `correction.NAME=true` puts it to work, `correction.NAME_KEY=VALUE`
    sets what its `Settings` have. Raises InputError where it is not complete.
    """
    missing: list[str] = sorted(barrier.__abstractmethods__)
    if barrier.inputs and barrier.features is Barrier.features:
        missing.append("features (it has inputs)")
    if missing:
        raise InputError(f"barrier {barrier.name!r} lacks {', '.join(missing)}")
    BARRIERS[barrier.name] = barrier
