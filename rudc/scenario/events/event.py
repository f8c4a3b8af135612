"""What every kind of event has in common: the model of what a file says, and the effect that plays it.

A new kind is one file beside this one: a model (a subclass of `Event` with a `kind` and its numbers), an
effect (a subclass of `Effect`, or of `Held` if it acts on vehicles), and `register_event(model, effect)`.
Nothing else knows it by name: what a scenario may say, the errors, the JSON Schema and the script of an
episode follow from that.
"""

from __future__ import annotations

import math
import re
from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Annotated, Generic, Protocol, TypeVar

import numpy as np
from pydantic import AfterValidator

from rudc.scenario.base import FileModel, NonEmpty, refuse
from rudc.scenario.distributions import AnyDistribution, Bounds, Distribution, draw
from rudc.scenario.events.stage import Stage, Thing
from rudc.scenario.selectors import Selector
from rudc.scenario.triggers import Trigger, awaited

Duration = Annotated[AnyDistribution, Bounds(0, 600, "s", above=True)]
Speed = Annotated[AnyDistribution, Bounds(0, 40, "m/s")]
MovingSpeed = Annotated[AnyDistribution, Bounds(0, 40, "m/s", above=True)]
Gap = Annotated[AnyDistribution, Bounds(0.5, 30, "s")]

FOLLOWING_S = 1.2
"""s between the rear of one who crosses and the front of the next, where the file does not say"""
UNHURRIED = 3.0
"""m/s2, with which an event slows down or stops a vehicle whose driver need not hurry"""
ROUNDED_S = 1e-6
"""s by which a sum of times may be off"""
HARDEST = 12.0
"""m/s2, hardest braking that an event can ask of a vehicle"""
WAITS_S = 20.0
"""s that an event waits, at most, while somebody is where its things would stand, or cannot stop before"""


def _plain(name: str) -> str:
    if re.fullmatch(r"[A-Za-z][A-Za-z0-9_-]*", name) is None:
        refuse(f"expected a name of letters, digits, '_' and '-' that begins with a letter; got {name!r}")
    return name


class Event(FileModel, frozen=True):
    """Something that happens in an episode: what a file says of it."""

    kind: str
    """which kind of event"""
    name: Annotated[NonEmpty, AfterValidator(_plain)] | None = None
    """a name of its own, by which `event_state` may call it; by default only its number in the file"""
    when: Trigger | None = None
    """conditions under which it happens, once; without them it happens at the start"""

    def happens(self, rng: np.random.Generator) -> bool:
        """Whether it happens in an episode, drawn with its `probability`."""
        chance = 1.0 if self.when is None else self.when.chance.sample(rng)
        return bool(rng.random() < chance)

    def drawn(self, rng: np.random.Generator) -> Event:
        """The event with its numbers drawn.

        What is left of `when` holds conditions only; it is None when there are none.
        """
        event = draw(self, rng)
        if event.when is None:
            return event
        waits = event.when.conditions or event.when.any
        when = event.when.model_copy(update={"probability": None}) if waits else None
        return event.model_copy(update={"when": when})


class Called(Protocol):
    """What has the kind of an event and, if it has one, its name."""

    @property
    def kind(self) -> str:
        """Which kind of event."""
        ...

    @property
    def name(self) -> str | None:
        """Its name in the file."""
        ...


def numbered(number: int, event: Called) -> str:
    """`2 (events.1, lorry) hard_brake`: an event's number as pictures show it, its key in the file, its name
    if it has one, and its kind."""
    called = f", {event.name}" if event.name else ""
    return f"{number} (events.{number - 1}{called}) {event.kind}"


class VehicleEvent(Event, frozen=True):
    """Something that surrounding vehicles do."""

    vehicle: Selector | None = None
    """which vehicle"""


E = TypeVar("E", bound=Event)
V = TypeVar("V", bound=VehicleEvent)


class Effect(ABC, Generic[E]):
    """One event of an episode, acting on the stage."""

    from_the_start = False
    """whether, if it has no trigger, it is there before the ego is, so that traffic warms up around it"""
    felt = False
    """whether it has no body, and the ego feels it as soon as it begins"""
    underfoot = False
    """whether it has a slippery patch for a body (`Stage.lay_patch`): the ego feels it once it is on it"""
    replaceable = False
    """whether it is over as soon as a later event of its kind begins; when that one's duration has passed, it
    begins again if it has no duration itself"""

    def __init__(self, event: E, name: str) -> None:
        self.event = event
        self.name = name
        self.begun_s = 0.0
        """s, when it began, or last tried to"""
        self.chosen: frozenset[str] = frozenset()
        """surrounding vehicles that it has taken hold of so far"""
        self.waits_since_s: float | None = None
        """s, when it began to wait for somebody to leave the place of its things, counted anew as long as
        something stands there that will be taken away; its trigger need not come true again"""

    @abstractmethod
    def begin(self, stage: Stage) -> bool:
        """Take effect; False when there is nothing to act on yet, and the event waits."""

    def put(self, stage: Stage, things: Sequence[Thing]) -> bool:
        """Put things on the road that stand there. False while something that will be taken away is in a
        place of theirs; then, for WAITS_S at most, while somebody is there or could not stop before it. The
        ego counts only once the event has waited: by then its trigger need not hold any more.
        """
        taken = any(stage.is_taken_for_now(*thing) for thing in things)
        has_waited = self.waits_since_s is not None
        since_s = stage.time_s if self.waits_since_s is None or taken else self.waits_since_s
        self.waits_since_s = since_s
        if taken:
            return False
        waits = stage.time_s < since_s + WAITS_S - ROUNDED_S
        if waits and not all(stage.is_free(*thing, for_ego=has_waited) for thing in things):
            return False
        duration = _duration_of(self.event)
        for_s = math.inf if duration is None else float(duration)
        for i, thing in enumerate(things):
            stage.stand(f"{self.name}:{i}", *thing, for_s=for_s)
        return True

    def step(self, stage: Stage) -> None:
        """Go on, before each decision while in effect."""

    def is_over(self, stage: Stage) -> bool:
        """Whether it is over: by default, once its duration has passed."""
        return self.has_lasted(stage)

    def has_lasted(self, stage: Stage) -> bool:
        """Whether the event's duration, if it has one, has passed."""
        duration = _duration_of(self.event)
        return duration is not None and stage.time_s >= self.begun_s + float(duration) - ROUNDED_S

    @property
    def is_endless(self) -> bool:
        """Whether it has no duration, and nothing else by which it would be over."""
        return type(self).is_over is Effect.is_over and _duration_of(self.event) is None

    def end(self, stage: Stage) -> None:
        """Stop, once it is over."""


def _duration_of(event: Event) -> Distribution | None:
    return getattr(event, "duration", None)


class Felt(Effect[E]):
    """An effect without a body: on the ego's sensors or plant, or on traffic as a whole."""

    felt = True


class Passing(Effect[E]):
    """An effect that sends road users over the road; it is over once they have left."""

    @staticmethod
    def gap_s(gap: Distribution | None) -> float:
        """s between the rear of one and the front of the next, once `gap` is drawn."""
        return FOLLOWING_S if gap is None else float(gap)

    def is_over(self, stage: Stage) -> bool:
        return not stage.things_of(self.name)


class Held(Effect[V]):
    """An effect on the vehicles it selected when it began."""

    def __init__(self, event: V, name: str) -> None:
        super().__init__(event, name)
        self.held: list[str] = []

    def begin(self, stage: Stage) -> bool:
        if self.event.vehicle is None:
            return False
        if self.event.vehicle == "same":
            self.held = stage.held_by(awaited(self.event.when))
        else:
            self.held = stage.choose(self.event.vehicle)
        self.chosen = frozenset(self.held)
        for name in self.held:
            self.hold(stage, name)
        self.step(stage)
        return bool(self.held)

    def step(self, stage: Stage) -> None:
        present = set(stage.present)
        self.held = [name for name in self.held if name in present]
        for name in self.held:
            self.command(stage, name)

    def is_over(self, stage: Stage) -> bool:
        """Whether its duration has passed, or all its vehicles have left."""
        return super().is_over(stage) or self.all_left(stage)

    def all_left(self, stage: Stage) -> bool:
        """Whether it took hold of vehicles, of which none is there any more."""
        return bool(self.chosen) and self.chosen.isdisjoint(stage.present)

    def end(self, stage: Stage) -> None:
        present = set(stage.present)
        for name in self.held:
            if name in present:
                self.let_go(stage, name)
        stage.unlawful.difference_update(self.chosen - present)

    def hold(self, stage: Stage, name: str) -> None:
        """Do to one vehicle, once, what the event says."""

    def command(self, stage: Stage, name: str) -> None:
        """Do to one held vehicle what the event says at every decision."""

    def let_go(self, stage: Stage, name: str) -> None:
        """Undo what `hold` did to a vehicle that is still there."""
