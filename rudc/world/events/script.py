"""`Script`: the events of one episode, each waiting for its trigger, in effect, or over."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from rudc.world.events.conditions import holds
from rudc.world.events.driving import (
    DensitySurgeEffect,
    HardBrakeEffect,
    PriorityViolationEffect,
    SlowVehicleEffect,
    SpeedingEffect,
)
from rudc.world.events.effect import Effect
from rudc.world.events.sensing import (
    ActuatorDelayEffect,
    LowFrictionEffect,
    SensorDropoutEffect,
    SensorNoiseEffect,
)
from rudc.world.events.standing import (
    AccidentEffect,
    LaneClosureEffect,
    OcclusionEffect,
    PedestrianCrossingEffect,
    StalledVehicleEffect,
    WrongWayEffect,
)
from rudc.world.scene import Scene

if TYPE_CHECKING:
    from rudc.scenario.events import Event
    from rudc.world.events.stage import Stage

EFFECTS: dict[str, type[Effect]] = {
    "accident": AccidentEffect,
    "lane_closure": LaneClosureEffect,
    "stalled_vehicle": StalledVehicleEffect,
    "hard_brake": HardBrakeEffect,
    "priority_violation": PriorityViolationEffect,
    "speeding": SpeedingEffect,
    "slow_vehicle": SlowVehicleEffect,
    "wrong_way": WrongWayEffect,
    "density_surge": DensitySurgeEffect,
    "pedestrian_crossing": PedestrianCrossingEffect,
    "occlusion": OcclusionEffect,
    "sensor_noise": SensorNoiseEffect,
    "sensor_dropout": SensorDropoutEffect,
    "low_friction": LowFrictionEffect,
    "actuator_delay": ActuatorDelayEffect,
}
"""the class that plays each kind of event"""


class Happening(NamedTuple):
    """How one event of an episode stands."""

    name: str
    """its kind and its place among the episode's events, as in `Script.log`"""
    event: Event
    begun_s: float | None
    """s when it took effect; None while it waits"""
    is_over: bool
    bodies: frozenset[str]
    """names, as in `Scene.ids`, of whom it put on the road or has taken hold of so far"""


class Script:
    """Plays the events of one episode."""

    def __init__(self, events: tuple[Event, ...], stage: Stage) -> None:
        self._stage = stage
        self._effects = [EFFECTS[event.kind](event, f"{event.kind}{i}") for i, event in enumerate(events)]
        self._waiting = list(self._effects)
        self._active: list[Effect] = []
        self.log: list[tuple[float, str]] = []
        """(s, event name) of every event that took effect"""
        self._begin([e for e in self._waiting if e.from_the_start and e.event.when is None], None)

    def step(self, scene: Scene) -> None:
        """Go on with what is in effect, end what is over, begin what is triggered."""
        if not self._waiting and not self._active:
            return
        for effect in list(self._active):
            if effect.is_over(scene):
                effect.end(self._stage)
                self._active.remove(effect)
            else:
                effect.step(self._stage, scene)
        due = [e for e in self._waiting if e.event.when is None or holds(e.event.when, scene, self._stage)]
        self._begin(due, scene)

    def _begin(self, effects: list[Effect], scene: Scene | None) -> None:
        for effect in effects:
            if effect.begin(self._stage, scene):
                effect.begun_s = scene.time_s if scene else 0.0
                self._waiting.remove(effect)
                self._active.append(effect)
                self.log.append((effect.begun_s, effect.name))

    def happenings(self) -> tuple[Happening, ...]:
        """How each event stands, in the order of the episode's plan."""
        begun = {name: begun_s for begun_s, name in self.log}
        return tuple(
            Happening(
                effect.name,
                effect.event,
                begun.get(effect.name),
                effect.name in begun and effect not in self._active,
                effect.bodies(self._stage),
            )
            for effect in self._effects
        )
