"""What every driver of the ego vehicle is: `Agent`, and what it answers: `Decision`."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, Literal, NamedTuple, Protocol

import numpy as np

from rudc.arrays import Array
from rudc.world.scene import Scene

if TYPE_CHECKING:
    from rudc.learning.uncertainty import Uncertainty
    from rudc.safety.corrected import Corrected
    from rudc.safety.plant import PlantEstimate

EgoDriver = Literal["agent", "sumo"]


class Decision(NamedTuple):
    """One decision, and what is known about how it came to be."""

    u: Array
    """(2,) what is applied: acceleration m/s2, front-wheel angle rad"""
    u_rl: Array
    """(2,) what the driver itself proposed (rudc/agents/patience.py included), before any correction, in the
    same units"""
    uncertainty: Uncertainty | None = None
    """of the return that follows the proposal, reward units; None for drivers that state none"""
    corrected: Corrected | None = None
    """what a correction, such as the safety filter, says about its work; None without one"""
    timing_ms: Mapping[str, float] = MappingProxyType({})
    """ms spent in each part (`outlook`, `observation`, `policy`, `critic`, `correction`)"""
    by_route: Uncertainty | None = None
    """the uncertainty compared with what is usual where the ego is (rudc/agents/route_sigma.py); None where
    that is not known"""
    states: Literal["paper", "route"] = "paper"
    """which of the two the driver calls its sigma"""
    plant: PlantEstimate | None = None
    """what was known of the car (rudc/agents/adaptation.py); None for drivers that do not watch it"""
    asks_grip: bool = False
    """whether the ego brakes in order to learn how well the road grips"""

    @property
    def bounded(self) -> Array:
        """(2,) m/s2 and rad, by which bounds on speed and grip (rudc/agents/outlook.py) changed what was
        corrected; 0 without a correction.
        """
        return np.zeros(2) if self.corrected is None else self.u - self.corrected.u

    @property
    def onwards(self) -> bool:
        """Whether a correction has the ego go on, since stopping would be worse."""
        return self.corrected is not None and self.corrected.onwards

    @property
    def sigma(self) -> float:
        """sigma_total, or that by route; nan for drivers that state no uncertainty."""
        stated = self.by_route if self.states == "route" else self.uncertainty
        return math.nan if stated is None else float(stated.total)


def unfiltered(acceleration: float, steering: float) -> Decision:
    """The decision of a driver without uncertainty and without correction, in m/s2 and rad."""
    u = np.array([acceleration, steering])
    return Decision(u, u)


class Agent(Protocol):
    """A driver of the ego vehicle. Keeps nothing from one episode to the next."""

    @property
    def name(self) -> str:
        """As in tables and in `rudc sweep --agent NAME`."""
        ...

    @property
    def ego_driver(self) -> EgoDriver:
        """`sumo`: SUMO itself drives, and `act` is not listened to."""
        ...

    def reset(self, scene: Scene, seed: int) -> None:
        """Forget the last episode and prepare for one that begins with `scene`; all randomness comes from
        `seed`.
        """
        ...

    def act(self, scene: Scene) -> Decision:
        """What to do for the next 0.1 s, given what the ego's sensors show."""
        ...


def layers(agent: Agent) -> Iterator[Agent]:
    """An agent, the one that it is put round, and so on: whoever is put round another names it `inner`."""
    here: Agent | None = agent
    while here is not None:
        yield here
        here = getattr(here, "inner", None)
