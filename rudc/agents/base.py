"""`Agent`, the interface of every driver of the ego vehicle, and `Decision`, what a driver returns."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, Literal, NamedTuple, Protocol

import numpy as np

from rudc.arrays import Array
from rudc.world.config import EgoDriver
from rudc.world.scene import Scene

if TYPE_CHECKING:
    from rudc.learning.uncertainty import Uncertainty
    from rudc.safety.corrected import Corrected
    from rudc.safety.plant import PlantEstimate


class Decision(NamedTuple):
    """One decision, and what is known about how it came to be."""

    u: Array
    """(2,) the action that is applied: acceleration m/s2, front-wheel angle rad"""
    u_rl: Array
    """(2,) nominal action, in the same units: what the driver itself proposed, before any correction
    (rudc/agents/patience.py is part of the driver)"""
    uncertainty: Uncertainty | None = None
    """uncertainty of the return that follows the proposal, reward units; None for drivers that state none"""
    corrected: Corrected | None = None
    """the result of a correction, such as the safety filter; None without one"""
    timing_ms: Mapping[str, float] = MappingProxyType({})
    """ms spent in each part (`outlook`, `observation`, `policy`, `critic`, `correction`)"""
    by_route: Uncertainty | None = None
    """the uncertainty compared with what is usual where the ego is (rudc/agents/route_sigma.py); None where
    that is not known"""
    states: Literal["paper", "route"] = "paper"
    """which one `sigma` is: `uncertainty` (`paper`) or `by_route` (`route`)"""
    plant: PlantEstimate | None = None
    """what was known of the car (rudc/agents/adaptation.py); None for drivers that do not watch it"""
    asks_grip: bool = False
    """whether the ego brakes in order to learn how well the road grips"""
    still_onwards: bool = False
    """whether a correction before `corrected` makes the ego go on, and `corrected` left its acceleration"""

    @property
    def bounded(self) -> Array:
        """(2,) m/s2 and rad, change of the corrected action by the bounds of an outlook on speed and grip
        (rudc/agents/outlook.py); 0 without a correction.
        """
        return np.zeros(2) if self.corrected is None else self.u - self.corrected.u

    @property
    def onwards(self) -> bool:
        """Whether a correction makes the ego go on because stopping would be worse."""
        return self.still_onwards or (self.corrected is not None and self.corrected.onwards)

    @property
    def sigma(self) -> float:
        """sigma_total, as in the paper or by route (see `states`); nan for drivers without it."""
        stated = self.by_route if self.states == "route" else self.uncertainty
        return math.nan if stated is None else float(stated.total)


def unfiltered(acceleration: float, steering: float) -> Decision:
    """The decision of a driver without uncertainty and correction: m/s2, and front-wheel angle in rad."""
    u = np.array([acceleration, steering])
    return Decision(u, u)


class Agent(Protocol):
    """A driver of the ego vehicle. Keeps nothing from one episode to the next.

    An agent of one's own needs `reset` and `act` only, and its `act` may answer just two numbers:
    `make_agent` returns it with the rest (rudc/agents/guarded.py).
    """

    @property
    def name(self) -> str:
        """Its name in tables and in `rudc sweep --agent NAME`. One's own agents have the name by which
        `make_agent` was asked for them; a `name` of their class is not looked at.
        """
        ...

    @property
    def ego_driver(self) -> EgoDriver:
        """Who drives: `agent`, or `sumo`: then SUMO itself drives, and what `act` returns is ignored. One's
        own agents that do not say are `agent`.
        """
        ...

    def reset(self, scene: Scene, seed: int) -> None:
        """Forget the last episode and prepare for one that begins with `scene`; all randomness comes from
        `seed`.
        """
        ...

    def act(self, scene: Scene) -> Decision:
        """What to do for the next 0.1 s, given what the ego's sensors show."""
        ...


class Urged:
    """Base of RUDC's own drivers whose proposals can be changed before they are corrected. An outlook asks
    for this class: what another driver calls `urge` is its own.
    """

    urge: Callable[[Scene, Array], Array] | None = None
    """scene, proposal (2,) in m/s2 and rad -> proposal that is then corrected; None: it stays as it is"""


def layers(agent: Agent) -> Iterator[Agent]:
    """An agent, the agent that it wraps, and so on: a wrapping agent has the wrapped one as `inner`."""
    here: Agent | None = agent
    while here is not None:
        yield here
        here = getattr(here, "inner", None)
