"""All barriers by name."""

from __future__ import annotations

from rudc.errors import InputError
from rudc.imports import Registry
from rudc.safety.barrier import Barrier
from rudc.safety.clearance import Clearance
from rudc.safety.road_edges import RoadBarrier
from rudc.safety.vehicles import VehicleBarrier

BARRIERS = Registry[type[Barrier]]("rudc.barriers")
"""name -> class, in the order of their rows"""
BARRIERS.update({"vehicle": VehicleBarrier, "road": RoadBarrier})


def register_barrier(barrier: type[Barrier]) -> None:
    """Make a barrier known by its name: `correction.NAME=true` switches it on, and
    `correction.NAME_KEY=VALUE` changes one of its `Settings`. Raises InputError if it lacks a
    method, or has inputs of the residual predictor and is no `Clearance`.
    """
    missing: list[str] = sorted(barrier.__abstractmethods__)
    if barrier.inputs and barrier.features is Barrier.features:
        missing.append("features (it has inputs)")
    if missing:
        raise InputError(f"barrier {barrier.name!r} lacks {', '.join(missing)}")
    if barrier.inputs and not issubclass(barrier, Clearance):
        raise InputError(
            f"barrier {barrier.name!r} has inputs, but residuals are predicted for bodies to keep clear of "
            "only; leave inputs out, or make it a Clearance (rudc/safety/clearance.py)"
        )
    BARRIERS[barrier.name] = barrier
