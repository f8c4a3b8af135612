"""What happens in an episode besides ordinary traffic: one pydantic model a kind.

A new kind is one model here, listed in `AnyEvent`, and one effect in `rudc.world.events`. Positions are in m
east and north of the junction's centre; lanes are named `ARM_in_INDEX` and `ARM_out_INDEX` (0 = rightmost) or
by SUMO's id; `at` is in m outwards from the stop line, or on an outbound lane from the junction's exit. Files
give angles in degrees, and the properties ending in `_rad` give radians.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Discriminator, SerializerFunctionWrapHandler, Tag, model_serializer, model_validator

from rudc.scenario.base import FileModel, Identifier, refuse
from rudc.scenario.distributions import AnyDistribution, Bounds, Constant, draw
from rudc.scenario.poses import OpaqueBox, Placement, VehicleType
from rudc.scenario.triggers import Metre, Selector, Trigger

Duration = Annotated[AnyDistribution, Bounds(0, 600, "s", above=True)]
Speed = Annotated[AnyDistribution, Bounds(0, 40, "m/s")]
MovingSpeed = Annotated[AnyDistribution, Bounds(0, 40, "m/s", above=True)]


class Event(FileModel, frozen=True):
    """Something that happens in an episode."""

    kind: str
    """which kind of event"""
    when: Trigger | None = None
    """conditions that must all hold for it to happen, once; without them it is there from the start"""

    def drawn(self, rng: np.random.Generator) -> Event | None:
        """The event with its numbers drawn, or None where its `probability` says that it does not happen.

        What is left of `when` holds conditions only; it is None when there are none.
        """
        chance = 1.0 if self.when is None else self.when.chance.sample(rng)
        # Drawn whatever the chance, so that another probability leaves the event's numbers as they were.
        happens = rng.random() < chance
        event = draw(self, rng)
        if not happens or event.when is None:
            return event if happens else None
        when = event.when.model_copy(update={"probability": None}) if event.when.conditions else None
        return event.model_copy(update={"when": when})


class Accident(Event, frozen=True):
    """Stationary vehicles anywhere, at any heading."""

    kind: Literal["accident"]
    """stationary vehicles anywhere, at any heading"""
    vehicles: tuple[Placement, ...]
    """the vehicles involved"""

    @model_validator(mode="after")
    def _check(self) -> Accident:
        if not self.vehicles:
            refuse("an accident involves one vehicle at least", "vehicles")
        return self


class StalledVehicle(Event, frozen=True):
    """A vehicle that stands still in its lane: a new one, or a surrounding vehicle that stops."""

    kind: Literal["stalled_vehicle"]
    """a vehicle that stands still in its lane"""
    lane: Identifier | None = None
    """lane on which a vehicle stands"""
    at: Metre | None = None
    """m from the junction along `lane`"""
    type: VehicleType = "car"
    """what vehicle stands on `lane`"""
    vehicle: Selector | None = None
    """surrounding vehicle that stops, instead of `lane`"""
    duration: Duration | None = None
    """s it stands; by default for good"""

    @classmethod
    def misfits(cls, given: Mapping[str, Any]) -> Iterator[tuple[str, str | None]]:
        """Either a lane and a place on it, or a surrounding vehicle."""
        if ("lane" in given) == ("vehicle" in given):
            if set(given) <= set(cls.model_fields):
                yield "expected either `lane` and `at` or `vehicle`", None
        elif "lane" in given and "at" not in given:
            yield "needs `at`, the distance from the junction in m", "lane"
        elif "vehicle" in given:
            for name in ("at", "type"):
                if name in given:
                    yield "goes with `lane` only", name

    @model_serializer(mode="wrap")
    def _without_idle_type(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        data = handler(self)
        return data if self.lane is not None else {key: value for key, value in data.items() if key != "type"}


class LaneClosure(Event, frozen=True):
    """A stretch of a lane that is closed by an obstacle."""

    kind: Literal["lane_closure"]
    """a stretch of a lane that is closed"""
    lane: Identifier
    """lane that is closed"""
    at: Metre
    """m from the junction, the end nearer to it"""
    length: Annotated[AnyDistribution, Bounds(0, 500, "m", above=True)]
    """m, away from the junction"""


class HardBrake(Event, frozen=True):
    """A surrounding vehicle brakes hard for no visible reason."""

    kind: Literal["hard_brake"]
    """a surrounding vehicle brakes hard for no visible reason"""
    vehicle: Selector = "leader"
    """which vehicle"""
    deceleration: Annotated[AnyDistribution, Bounds(0, 12, "m/s2", above=True)] = Constant(value=7.0)
    """m/s2"""
    duration: Duration = Constant(value=3.0)
    """s; it stands once it has stopped, until then"""


class PriorityViolation(Event, frozen=True):
    """A surrounding vehicle disregards the right of way."""

    kind: Literal["priority_violation"]
    """a surrounding vehicle disregards the right of way"""
    vehicle: Selector = "crossing"
    """which vehicle"""
    duration: Duration | None = None
    """s; by default for good"""


class Speeding(Event, frozen=True):
    """A surrounding vehicle drives above the limit."""

    kind: Literal["speeding"]
    """a surrounding vehicle drives above the limit"""
    vehicle: Selector = "crossing"
    """which vehicle"""
    factor: Annotated[AnyDistribution, Bounds(1, 4, above=True)]
    """times the limit"""
    duration: Duration | None = None
    """s; by default for good"""


class SlowVehicle(Event, frozen=True):
    """A surrounding vehicle crawls."""

    kind: Literal["slow_vehicle"]
    """a surrounding vehicle crawls"""
    vehicle: Selector = "leader"
    """which vehicle"""
    speed: MovingSpeed
    """m/s it does not exceed"""
    duration: Duration | None = None
    """s; by default for good"""


class WrongWay(Event, frozen=True):
    """A vehicle drives along a lane against its direction."""

    kind: Literal["wrong_way"]
    """a vehicle drives along a lane against its direction"""
    lane: Identifier
    """lane it drives along; on ARM_out_INDEX it comes towards the junction"""
    at: Metre
    """m from the junction, where it appears"""
    speed: MovingSpeed = Constant(value=6.0)
    """m/s"""
    type: VehicleType = "car"
    """what vehicle"""


class DensitySurge(Event, frozen=True):
    """Traffic density changes during the episode."""

    kind: Literal["density_surge"]
    """traffic density changes during the episode"""
    density: Annotated[AnyDistribution, Bounds(0, 150, "veh/km")]
    """veh/km of two-way road from then on"""
    duration: Duration | None = None
    """s; by default for good"""


class PedestrianCrossing(Event, frozen=True):
    """Pedestrians walk across an arm in front of traffic."""

    kind: Literal["pedestrian_crossing"]
    """pedestrians walk across an arm"""
    arm: Identifier
    """arm they cross"""
    at: Metre = Constant(value=3.0)
    """m from the junction, of the line they walk along"""
    speed: Annotated[AnyDistribution, Bounds(0, 10, "m/s", above=True)] = Constant(value=1.4)
    """m/s"""
    count: Annotated[AnyDistribution, Bounds(1, 30, whole=True)] = Constant(value=1.0)
    """how many, one behind the other"""
    from_side: Literal["left", "right"] = "right"
    """side they start from, as seen going towards the junction"""


class Occlusion(Event, frozen=True):
    """Boxes that hide what is behind them from the ego; nothing collides with them."""

    kind: Literal["occlusion"]
    """boxes that hide what is behind them from the ego"""
    boxes: tuple[OpaqueBox, ...]
    """the boxes"""

    @model_validator(mode="after")
    def _check(self) -> Occlusion:
        if not self.boxes:
            refuse("nothing is hidden without a box", "boxes")
        return self


class SensorNoise(Event, frozen=True):
    """Gaussian errors of what the ego perceives of others."""

    kind: Literal["sensor_noise"]
    """Gaussian errors of what the ego perceives of others"""
    position: Annotated[AnyDistribution, Bounds(0, 20, "m")] = Constant(value=0.0)
    """m, standard deviation along each axis"""
    speed: Annotated[AnyDistribution, Bounds(0, 20, "m/s")] = Constant(value=0.0)
    """m/s, standard deviation"""
    heading: Annotated[AnyDistribution, Bounds(0, 180, "deg")] = Constant(value=0.0)
    """deg, standard deviation"""

    @classmethod
    def misfits(cls, given: Mapping[str, Any]) -> Iterator[tuple[str, str | None]]:
        """One of its numbers at least."""
        if not {"position", "speed", "heading"} & set(given) and set(given) <= set(cls.model_fields):
            yield "expected one or more of `position`, `speed` and `heading` (standard deviations)", None

    @property
    def heading_rad(self) -> float:
        """rad, standard deviation."""
        return math.radians(float(self.heading))


class SensorDropout(Event, frozen=True):
    """The ego misses others at random, and beyond a range."""

    kind: Literal["sensor_dropout"]
    """the ego misses others at random, and beyond a range"""
    probability: Annotated[AnyDistribution, Bounds(0, 1)] = Constant(value=0.0)
    """of missing a vehicle, each vehicle at each decision anew"""
    range: Annotated[AnyDistribution, Bounds(0, 1000, "m", above=True)] | None = None
    """m beyond which nothing is seen; by default no limit"""

    @classmethod
    def misfits(cls, given: Mapping[str, Any]) -> Iterator[tuple[str, str | None]]:
        """One of its numbers at least."""
        if not {"probability", "range"} & set(given) and set(given) <= set(cls.model_fields):
            yield "expected `probability`, `range` or both", None


class LowFriction(Event, frozen=True):
    """A slippery road."""

    kind: Literal["low_friction"]
    """a slippery road"""
    friction: Annotated[AnyDistribution, Bounds(0.03, 1.2)]
    """coefficient of friction: 0.9 dry, 0.5 wet, 0.3 snow, 0.1 ice"""


class ActuatorDelay(Event, frozen=True):
    """The ego's commands take effect late."""

    kind: Literal["actuator_delay"]
    """the ego's commands take effect late"""
    delay: Annotated[AnyDistribution, Bounds(0, 2, "s")] = Constant(value=0.0)
    """s until a command takes effect"""
    lag: Annotated[AnyDistribution, Bounds(0, 3, "s")] = Constant(value=0.0)
    """s, time constant of a first-order lag"""

    @classmethod
    def misfits(cls, given: Mapping[str, Any]) -> Iterator[tuple[str, str | None]]:
        """One of its numbers at least."""
        if not {"delay", "lag"} & set(given) and set(given) <= set(cls.model_fields):
            yield "expected `delay`, `lag` or both", None


EVENT_KINDS: dict[str, type[Event]] = {
    "accident": Accident,
    "stalled_vehicle": StalledVehicle,
    "lane_closure": LaneClosure,
    "hard_brake": HardBrake,
    "priority_violation": PriorityViolation,
    "speeding": Speeding,
    "slow_vehicle": SlowVehicle,
    "wrong_way": WrongWay,
    "density_surge": DensitySurge,
    "pedestrian_crossing": PedestrianCrossing,
    "occlusion": Occlusion,
    "sensor_noise": SensorNoise,
    "sensor_dropout": SensorDropout,
    "low_friction": LowFriction,
    "actuator_delay": ActuatorDelay,
}
"""Name in files -> model."""


def _kind(value: Any) -> str | None:
    """Tag of an event's kind; in brackets, so that none reads like a key."""
    kind = value.kind if isinstance(value, Event) else value.get("kind") if isinstance(value, dict) else None
    return f"<{kind}>" if isinstance(kind, str) and kind in EVENT_KINDS else None


AnyEvent = Annotated[
    Annotated[Accident, Tag("<accident>")]
    | Annotated[StalledVehicle, Tag("<stalled_vehicle>")]
    | Annotated[LaneClosure, Tag("<lane_closure>")]
    | Annotated[HardBrake, Tag("<hard_brake>")]
    | Annotated[PriorityViolation, Tag("<priority_violation>")]
    | Annotated[Speeding, Tag("<speeding>")]
    | Annotated[SlowVehicle, Tag("<slow_vehicle>")]
    | Annotated[WrongWay, Tag("<wrong_way>")]
    | Annotated[DensitySurge, Tag("<density_surge>")]
    | Annotated[PedestrianCrossing, Tag("<pedestrian_crossing>")]
    | Annotated[Occlusion, Tag("<occlusion>")]
    | Annotated[SensorNoise, Tag("<sensor_noise>")]
    | Annotated[SensorDropout, Tag("<sensor_dropout>")]
    | Annotated[LowFriction, Tag("<low_friction>")]
    | Annotated[ActuatorDelay, Tag("<actuator_delay>")],
    Discriminator(_kind, custom_error_type="event_kind", custom_error_message="expected an event"),
]
"""Any one event; its `kind` says which."""
