"""Episode plans for tests and benchmarks of the world, built directly, without a scenario file."""

from dataclasses import dataclass, field

import numpy as np

from rudc.scenario.choices import Turn
from rudc.scenario.distributions import Constant, Distribution, Uniform
from rudc.scenario.events import EVENT_KINDS, Event
from rudc.scenario.plan import EgoPlan, EpisodePlan, TrafficPlan

ALL_KINDS = {"car": 0.6, "truck": 0.12, "bus": 0.08, "motorcycle": 0.12, "bicycle": 0.08}


def constant(value: float) -> Distribution:
    return Constant(value=value)


def event(kind: str, **fields: object) -> Event:
    """An event as a scenario file would give it, its numbers drawn."""
    found, rng = EVENT_KINDS[kind].model_validate({"kind": kind, **fields}), np.random.default_rng(0)
    assert found.happens(rng)
    return found.drawn(rng)


@dataclass(frozen=True)
class PlanSource:
    """What a scenario would be: `plan(seed)` gives an episode, `redrawn()` of which works."""

    network: str = "four_way"
    density: float = 20.0
    origin: str | None = None
    turn: Turn | None = None
    mix: dict[str, float] = field(default_factory=lambda: {"car": 1.0})
    impatience: float = 0.6
    minor_gap_s: float = 0.6
    warm_up_s: float = 5.0
    speed: tuple[float, float] = (6.0, 10.0)
    distance: tuple[float, float] = (35.0, 45.0)
    headway_s: Distribution = field(default_factory=lambda: constant(1.0))
    speed_factor: Distribution = field(default_factory=lambda: constant(1.0))
    events: tuple[Event, ...] = ()
    timeout_s: float = 40.0
    origins: dict[str, float] | None = None
    turns: dict[str, float] | None = None

    def plan(self, seed: int, attempt: int = 0) -> EpisodePlan:
        rng = np.random.default_rng([seed, attempt])
        speed, distance = rng.uniform(*self.speed), rng.uniform(*self.distance)
        traffic = TrafficPlan(
            self.density,
            Uniform(uniform=(6.0, 10.0)),
            self.mix,
            self.impatience,
            self.minor_gap_s,
            self.headway_s,
            constant(2.0),
            constant(2.5),
            constant(3.0),
            self.speed_factor,
            self.warm_up_s,
            self.origins,
            self.turns,
        )
        ego = EgoPlan(self.origin, self.turn, None, speed, distance, 30.0)
        return EpisodePlan(
            scenario="test",
            network=self.network,
            junction=None,
            seed=seed,
            attempt=attempt,
            world_seed=(seed, attempt),
            ego=ego,
            traffic=traffic,
            events=self.events,
            timeout_s=self.timeout_s,
            event_numbers=tuple(range(1, len(self.events) + 1)),
            scripted=self.events,
            source=self,  # pyright: ignore[reportArgumentType] - it stands in for a scenario
        )
