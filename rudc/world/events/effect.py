"""What every event's effect has in common."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Generic, TypeVar

from rudc.world.events.stage import pick
from rudc.world.scene import Scene

if TYPE_CHECKING:
    from rudc.scenario.events import Event
    from rudc.world.events.stage import Stage

E = TypeVar("E", bound="Event")


class Effect(Generic[E]):
    """One event of a scenario, acting on the stage."""

    from_the_start = False
    """whether, without a trigger, it is there before the ego is and traffic warms up around it"""

    def __init__(self, event: E, name: str) -> None:
        self.event = event
        self.name = name

    def begin(self, stage: Stage, scene: Scene | None) -> bool:
        """Take effect; False when there is nothing to act on yet, and the event waits. No scene before the warm-up."""
        raise NotImplementedError(f"{type(self).__name__} must say how it begins")

    def step(self, stage: Stage, scene: Scene) -> None:
        """Go on, before each decision while in effect."""

    def end(self, stage: Stage) -> None:
        """Stop, when the event's duration has passed."""


class Held(Effect[E]):
    """An effect that commands the vehicles it selected when it began."""

    def __init__(self, event: E, name: str) -> None:
        super().__init__(event, name)
        self.held: list[str] = []

    def begin(self, stage: Stage, scene: Scene | None) -> bool:
        assert scene is not None, "a selector needs a scene"
        self.held = [scene.ids[i] for i in pick(scene, self.event.vehicle, stage.rng)]
        for name in self.held:
            stage.traffic.drivers[name].scripted = True
        self.step(stage, scene)
        return bool(self.held)

    def step(self, stage: Stage, scene: Scene) -> None:
        rows = {name: i for i, name in enumerate(scene.ids)}
        self.held = [name for name in self.held if name in rows]
        for name in self.held:
            self.command(stage, name, math.hypot(*scene.velocity[rows[name]]))

    def command(self, stage: Stage, name: str, speed: float) -> None:
        """Do to one held vehicle, now at `speed` m/s, what the event says."""

    def end(self, stage: Stage) -> None:
        for name in self.held:
            if name in stage.traffic.drivers:
                stage.traffic.drivers[name].scripted = False
                stage.sumo.release(name, stage.traffic.drivers[name].mode)
