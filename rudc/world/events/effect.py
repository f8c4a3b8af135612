"""What every event's effect has in common."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Generic, TypeVar

from rudc.scenario.events import (
    Event,
    HardBrake,
    PriorityViolation,
    SlowVehicle,
    Speeding,
    StalledVehicle,
)
from rudc.world.events.stage import pick
from rudc.world.scene import Scene

if TYPE_CHECKING:
    from rudc.world.events.stage import Stage

E = TypeVar("E", bound=Event)
H = TypeVar("H", HardBrake, PriorityViolation, Speeding, SlowVehicle, StalledVehicle)


class Effect(Generic[E]):
    """One event of a scenario, acting on the stage."""

    from_the_start = False
    """whether, without a trigger, it is there before the ego is and traffic warms up around it"""

    def __init__(self, event: E, name: str) -> None:
        self.event = event
        self.name = name
        self.begun_s = 0.0
        """s, when it began"""

    def begin(self, stage: Stage, scene: Scene | None) -> bool:
        """Take effect; False when there is nothing to act on yet, and the event waits. No scene before the
        warm-up."""
        raise NotImplementedError(f"{type(self).__name__} must say how it begins")

    def step(self, stage: Stage, scene: Scene) -> None:
        """Go on, before each decision while in effect."""

    def is_over(self, scene: Scene) -> bool:
        """Whether the event's duration, if it has one, has passed."""
        duration = getattr(self.event, "duration", None)
        return duration is not None and scene.time_s >= self.begun_s + float(duration)

    def end(self, stage: Stage) -> None:
        """Stop, once it is over."""

    def bodies(self, stage: Stage) -> frozenset[str]:
        """Names of whom it put on the road or has taken hold of so far."""
        return frozenset(prop.name for prop in stage.props if prop.name.startswith(f"{self.name}:"))


class Held(Effect[H]):
    """An effect on the vehicles it selected when it began."""

    overrides = True
    """whether the yielding layer leaves the held vehicles alone"""

    def __init__(self, event: H, name: str) -> None:
        super().__init__(event, name)
        self.held: list[str] = []
        self.chosen: frozenset[str] = frozenset()
        """all whom it ever held"""

    def begin(self, stage: Stage, scene: Scene | None) -> bool:
        if scene is None or self.event.vehicle is None:
            return False
        self.held = [scene.ids[i] for i in pick(scene, self.event.vehicle, stage.rng)]
        self.chosen = frozenset(self.held)
        for name in self.held:
            stage.traffic.drivers[name].overridden += self.overrides
            self.hold(stage, name)
        self.step(stage, scene)
        return bool(self.held)

    def step(self, stage: Stage, scene: Scene) -> None:
        rows = {name: i for i, name in enumerate(scene.ids)}
        self.held = [name for name in self.held if name in rows]
        for name in self.held:
            self.command(stage, name, math.hypot(*scene.velocity[rows[name]]))

    def end(self, stage: Stage) -> None:
        for name in self.held:
            if name in stage.traffic.drivers:
                stage.traffic.drivers[name].overridden -= self.overrides
                self.let_go(stage, name)

    def bodies(self, stage: Stage) -> frozenset[str]:
        return self.chosen | super().bodies(stage)

    def hold(self, stage: Stage, name: str) -> None:
        """Do to one vehicle, once, what the event says."""

    def command(self, stage: Stage, name: str, speed: float) -> None:
        """Do to one held vehicle, now at `speed` m/s, what the event says at every decision."""

    def let_go(self, stage: Stage, name: str) -> None:
        """Undo what `hold` did to a vehicle that is still there."""
