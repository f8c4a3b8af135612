"""What a barrier is: functions h of the scene that must not fall below 0, with their derivatives.

One class holds all there is to know of one kind of constraint: whom or what it is about in a scene, h and its
derivatives, who of them is in conflict with the ego where not all rows can hold, and what the residual
predictor looks at. The filter does the rest, whichever barriers there are. A further one is a subclass of
`Barrier`, or of `Clearance` (rudc/safety/clearance.py) for anything to keep a distance from, and an entry in
`BARRIERS` (rudc/safety/barriers.py) or a call of `register_barrier`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any, ClassVar, NamedTuple

import numpy as np
from pydantic import BaseModel, ConfigDict

from rudc.arrays import Array, Flags, Index
from rudc.world.scene import Scene

STEP = 0.1
"""s, how long an action is held, in what the residual predictor predicts"""
NOBODY: Index = np.empty(0, dtype=np.int64)


class Terms(NamedTuple):
    """h and its derivatives for K constraints, each (K,), while the input u = (a, z), z = tan(delta_f), is
    held:

    h'  = L_f h + L_g h u        h'' = L_f^2 h + (L_g L_f h + L_f L_g h) u + X a z + Y z^2
    """

    h: Array
    """m2, or whatever unit a barrier has. Where h does not change, its row holds from h = c0 / lambda on:
    with TTCBF's default settings 1 of that unit, with ECBF 0 (rudc/safety/rows.py)
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
    """L_g h for acceleration, m2/s per m/s2; None where all are 0, as of anything that depends on places only
    """


class Found(NamedTuple):
    """What a barrier found in a scene: k things."""

    names: tuple[str, ...]
    """(k,) as in `Corrected.names`, such as `veh:ID` or `road:left:cg`"""
    others: Index = NOBODY
    """(k,) which of the scene's others they are; empty if they are none"""
    data: Any = None
    """what else the barrier will want to know"""


class BarrierSettings(BaseModel):
    """Base of a barrier's settings; none."""

    model_config = ConfigDict(frozen=True, extra="forbid", use_attribute_docstrings=True)

    def without_effect(self) -> dict[str, str]:
        """Name of each setting that the others leave without effect -> where."""
        return {}


class Barrier(ABC):
    """One kind of constraint."""

    name: ClassVar[str]
    """in `BARRIERS`; `correction.NAME=true` puts it to work"""
    prefix: ClassVar[str | None] = None
    """what its settings' keys begin with; None: its name and `_`"""
    at_work: ClassVar[bool] = False
    """whether it is at work if nothing is said"""
    as_road: ClassVar[bool] = False
    """whether its rows have the rule's rates and the price of road edges, not those of vehicles"""
    inputs: ClassVar[tuple[str, ...]] = ()
    """what the residual predictor looks at beside `COMMON`; empty: nothing is predicted, w = 0"""
    Settings: ClassVar[type[BarrierSettings]] = BarrierSettings

    def __init__(self, settings: Any) -> None:
        """`settings`: of its class `Settings`."""
        self.settings = settings

    @abstractmethod
    def find(self, scene: Scene) -> Found:
        """What is to be constrained."""

    @abstractmethod
    def terms(self, scene: Scene, found: Found) -> Terms:
        """h and derivatives (k,) of what was found."""

    def in_conflict(self, scene: Scene, found: Found) -> Flags:
        """(k,) whose rows come first where no action satisfies all."""
        return np.full(len(found.names), not self.as_road)

    def on_path(self, scene: Scene) -> Scene | None:
        """The scene with an ego that keeps h >= 0 by following its path, whatever rows say: they ask no more
        of the ego than of that one. None: they ask what they ask.
        """
        return None

    def features(  # noqa: B027 -- not abstract, since a barrier without inputs has nothing to write
        self, scene: Scene, found: Found, part: Any, xi: Array
    ) -> None:
        """Write the `inputs` into the columns of `xi` (k, 8 + inputs) behind the first 8. `part`: what was
        found, as `Bodies` of (k,). Of a barrier without inputs there is nothing to write.
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
"""what the residual predictor looks at of every constraint: SI units, in the ego's frame, divided as stated
"""
