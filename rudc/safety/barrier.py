"""What a barrier is: functions h of the scene that must not fall below 0, with their derivatives.

One class holds all that the filter needs to know about one kind of constraint: which things in a scene it
constrains, h and its derivatives, which of these things are in conflict with the ego where not all rows can
hold, and the inputs of the residual predictor. The rest of the filter is the same for all barriers. To add
one, write a subclass of `Barrier`, or of `Clearance` (rudc/safety/clearance.py) for things to keep a distance
from, and an entry in `BARRIERS` (rudc/safety/barriers.py) or a call of `register_barrier`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any, ClassVar, NamedTuple

import numpy as np
from pydantic import BaseModel, ConfigDict

from rudc.arrays import Array, Flags, Index
from rudc.world.scene import Scene

STEP = 0.1
"""s, how long an action is held in the step that the residual predictor predicts"""
NOBODY: Index = np.empty(0, dtype=np.int64)


class Terms(NamedTuple):
    """h and its derivatives for K constraints, each (K,), while the input u = (a, z), z = tan(delta_f), is
    held:

    h'  = L_f h + L_g h u        h'' = L_f^2 h + (L_g L_f h + L_f L_g h) u + X a z + Y z^2
    """

    h: Array
    """m2, or another unit of the barrier's own. Where h does not change, its row holds if h >= c0 / s0
    (rudc/safety/rows.py): 1 of that unit with TTCBF's default settings for vehicles, 0 with ECBF
    """
    lf: Array
    """L_f h, m2/s"""
    lg: Array
    """L_g h for steering, m2/s per unit of z"""
    lf2: Array
    """L_f^2 h, m2/s2"""
    lglf_a: Array
    """L_g L_f h for acceleration, m2/s2 per m/s2"""
    lglf_z: Array
    """L_g L_f h for steering, m2/s2 per unit of z"""
    lflg: Array
    """L_f L_g h for steering, m2/s2 per unit of z"""
    az: Array
    """X, m2/s2 per m/s2 and unit of z"""
    zz: Array
    """Y, m2/s2 per unit of z squared"""
    lg_a: Array | None = None
    """L_g h for acceleration, m2/s per m/s2; None where all are 0, as for every h that does not depend on the
    ego's speed
    """


class Found(NamedTuple):
    """What a barrier found in a scene: k things to constrain."""

    names: tuple[str, ...]
    """(k,) as in `Corrected.names`, such as `veh:ID` or `road:left:cg`"""
    others: Index = NOBODY
    """(k,) indices of these things among the scene's others; empty if they are not among them"""
    data: Any = None
    """what the barrier's other methods need besides"""


class BarrierSettings(BaseModel):
    """Base of a barrier's settings; it has none itself."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    def without_effect(self) -> dict[str, str]:
        """Name of each setting that has no effect because of the others -> which (`with ...`)."""
        return {}


class Barrier(ABC):
    """One kind of constraint."""

    name: ClassVar[str]
    """its name in `BARRIERS`; `correction.NAME=true` switches it on"""
    prefix: ClassVar[str | None] = None
    """beginning of the keys of its settings; None: its name and `_`"""
    at_work: ClassVar[bool] = False
    """whether it is on by default"""
    as_road: ClassVar[bool] = False
    """whether its rows use the rates and the violation weight of road edges, not those of vehicles"""
    inputs: ClassVar[tuple[str, ...]] = ()
    """inputs of the residual predictor besides `COMMON`; empty: nothing is predicted, w = 0. A `Clearance`
    alone may have some
    """
    Settings: ClassVar[type[BarrierSettings]] = BarrierSettings

    def __init__(self, settings: Any) -> None:
        """`settings`: an instance of its class `Settings`."""
        self.settings = settings

    @abstractmethod
    def find(self, scene: Scene) -> Found:
        """The k things in the scene that are to be constrained."""

    @abstractmethod
    def terms(self, scene: Scene, found: Found) -> Terms:
        """h and its derivatives, (k,) each, for what was found."""

    def in_conflict(self, scene: Scene, found: Found) -> Flags:
        """(k,) whether each thing is in conflict with the ego: where no action satisfies all rows, the rows
        of these must hold first. By default all are, but none of a barrier with `as_road`.
        """
        return np.full(len(found.names), not self.as_road)

    def on_path(self, scene: Scene) -> Scene | None:
        """The scene with another ego, one that is known to keep h >= 0 by following its path, whatever its
        rows say. The rows are then relaxed so far that such an ego would satisfy them. None if the barrier
        knows no such ego: its rows stay as they are.
        """
        return None

    def features(  # noqa: B027 -- not abstract, since a barrier without inputs has nothing to write
        self, scene: Scene, found: Found, part: Any, xi: Array
    ) -> None:
        """Write the `inputs` into the columns of `xi` (k, 8 + inputs) after the first 8. `part`: the things
        that were found, as `Bodies` (k,). A barrier without inputs writes nothing.
        """


COMMON = (
    "acceleration / 6",
    "tan(steering)",
    "speed / 10",
    "realised acceleration / 6",
    "tan(realised steering)",
    "ahead / 20",
    "to the left / 20",
    "distance / 20",
)
"""inputs of the residual predictor that are the same for every constraint: in SI units and the ego's frame,
divided as stated"""
