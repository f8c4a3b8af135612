"""`EpisodePlan`: one episode made concrete, every distribution that describes it as a whole already drawn."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Protocol

from rudc.errors import SimulationError
from rudc.scenario.choices import Turn

if TYPE_CHECKING:
    from rudc.scenario.distributions import Distribution
    from rudc.scenario.events.event import Event


@dataclass(frozen=True, slots=True)
class EgoPlan:
    """Where the ego starts and where it goes; the world draws what is None from the network."""

    origin: str | None
    """arm (compass name) or edge id it comes from"""
    turn: Turn | None
    destination: str | None
    """arm or edge id it leaves by"""
    speed_mps: float
    distance_m: float
    """before the stop line"""
    destination_m: float
    """beyond the junction's exit, where the episode succeeds"""
    may_cross_centre: bool = False
    """whether it may drive on the lanes of oncoming traffic"""


@dataclass(frozen=True, slots=True)
class TrafficPlan:
    """Surrounding vehicles (SVs). Distributions left here are drawn anew for each SV."""

    density: float
    """veh/km of two-way road"""
    speed: Distribution
    """m/s, initial"""
    mix: Mapping[str, float]
    """share of each vehicle type: car, truck, bus, motorcycle, bicycle"""
    impatience: float
    """SUMO's `impatience`, 0 to 1"""
    minor_gap_s: float
    """s, SUMO's `jmTimegapMinor`: the gap that is enough on the minor road"""
    headway_s: Distribution
    """s, IDM's desired time headway"""
    min_gap_m: Distribution
    """m, IDM's standstill distance"""
    accel: Distribution
    """m/s2, IDM's acceleration"""
    decel: Distribution
    """m/s2, IDM's comfortable deceleration"""
    speed_factor: Distribution
    """desired speed, as a multiple of the limit"""
    warm_up_s: float
    """s simulated before the ego appears"""
    origins: Mapping[str, float] | None = None
    """share of those who come by each arm (compass name or edge id); None: as many as the arms have lanes"""
    turns: Mapping[str, float] | None = None
    """share of each turn: left, straight, right; None: all ways on are equally likely"""


class Drawable(Protocol):
    """What episodes are drawn from: a `Scenario`."""

    def plan(self, seed: int, attempt: int = 0) -> EpisodePlan:
        """One episode, the same for the same seed and attempt."""
        ...


@dataclass(frozen=True, slots=True)
class EpisodePlan:
    """Everything the world needs to set up and run one episode."""

    scenario: str
    network: str
    """name of a shipped network or absolute path of a .net.xml"""
    junction: str | None
    seed: int
    attempt: int
    """how often the seed was redrawn because the ego could not start safely"""
    world_seed: tuple[int, ...]
    """entropy of the world's own generator: numpy.random.default_rng(world_seed)"""
    ego: EgoPlan
    traffic: TrafficPlan
    events: tuple[Event, ...]
    """in file order, numbers drawn; events whose `probability` failed are absent"""
    timeout_s: float
    event_numbers: tuple[int, ...]
    """place of each of `events` in the scenario's file, from 1"""
    scripted: tuple[Event, ...] = ()
    """all events as they stand in the scenario's file, those that are absent from this episode included"""
    source: Drawable | None = field(default=None, repr=False, compare=False)
    """what it was drawn from"""

    def redrawn(self) -> EpisodePlan:
        """The same episode drawn once more, for when the ego cannot start safely in this one."""
        if self.source is None:
            raise SimulationError("this plan was not drawn from a scenario and cannot be drawn again")
        return self.source.plan(self.seed, self.attempt + 1)
