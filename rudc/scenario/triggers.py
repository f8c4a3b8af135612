"""When an event happens: conditions named as in ASAM OpenSCENARIO where it has one.

All conditions of one `when` must hold at once, and of the groups under `any` one at least; then the event
happens, once. They are about the ego, if nothing else is said.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Annotated, Any, ClassVar, Literal, Self

from pydantic import AfterValidator, GetJsonSchemaHandler, model_validator
from pydantic_core import CoreSchema

from rudc.scenario.base import FileModel, Identifier, refuse
from rudc.scenario.distributions import AnyDistribution, Bounds, Constant, Distribution
from rudc.scenario.selectors import Selector
from rudc.scenario.shared import Shared

Second = Annotated[AnyDistribution, Bounds(0, 600, "s")]
Metre = Annotated[AnyDistribution, Bounds(0, 1000, "m")]
Position = tuple[
    Annotated[AnyDistribution, Bounds(-2000, 2000, "m")], Annotated[AnyDistribution, Bounds(-2000, 2000, "m")]
]
"""[x, y] in m east and north of the junction's centre."""


class Threshold(FileModel, frozen=True):
    """Holds while a quantity is above one value, below another, or both."""

    LEAST: ClassVar[float] = 0.0
    """least value of the quantity"""
    above: AnyDistribution | None = None
    """holds when the quantity is greater"""
    below: AnyDistribution | None = None
    """holds when the quantity is smaller"""

    @model_validator(mode="after")
    def _check(self) -> Threshold:
        if self.above is None and self.below is None:
            refuse("expected {above: x}, {below: x} or both")
        if self._contradictory:
            refuse("can never hold: `above` is not smaller than `below`", "above")
        return self

    @property
    def _contradictory(self) -> bool:
        above, below = self.above, self.below
        if above is None or below is None:
            return False
        if isinstance(above, Shared) and isinstance(below, Shared) and above.shared == below.shared:
            values = (above.number.possible or above.number.support) if above.number is not None else ()
            return bool(values) and all(above.of(value) >= below.of(value) for value in values)
        return above.support[0] >= below.support[1]

    def as_drawn(self) -> Self:
        """The same, with its numbers drawn. If these contradict each other: a threshold that never holds
        (below the least value), since a file may not give contradicting numbers.
        """
        if not self._contradictory:
            return self
        return self.model_copy(update={"above": None, "below": Constant(value=self.LEAST)})

    def holds(self, value: float) -> bool:
        """Whether the quantity satisfies it, once its numbers are drawn; not a number satisfies nothing."""
        return (
            (self.above is None or value > float(self.above))
            and (self.below is None or value < float(self.below))
            and value == value
        )


class TimeThreshold(Threshold, frozen=True):
    """A time in s, above one value, below another, or both."""

    above: Second | None = None
    """s; holds when it is longer"""
    below: Second | None = None
    """s; holds when it is shorter"""


class DistanceThreshold(Threshold, frozen=True):
    """A distance in m, above one value, below another, or both."""

    above: Metre | None = None
    """m; holds when it is longer"""
    below: Metre | None = None
    """m; holds when it is shorter"""


class SpeedThreshold(Threshold, frozen=True):
    """A speed in m/s, above one value, below another, or both."""

    above: Annotated[AnyDistribution, Bounds(0, 60, "m/s")] | None = None
    """m/s; holds when it is faster"""
    below: Annotated[AnyDistribution, Bounds(0, 60, "m/s")] | None = None
    """m/s; holds when it is slower"""


class PathThreshold(Threshold, frozen=True):
    """A distance in m along the ego's path, negative once past it."""

    LEAST: ClassVar[float] = -1000.0
    """m, least value of the quantity"""
    above: Annotated[AnyDistribution, Bounds(-1000, 1000, "m")] | None = None
    """m; holds when it is farther"""
    below: Annotated[AnyDistribution, Bounds(-1000, 1000, "m")] | None = None
    """m; holds when it is nearer"""


class SpeedOf(SpeedThreshold, frozen=True):
    """The speed in m/s of the ego, or of a vehicle."""

    vehicle: Selector | None = None
    """of which vehicle; by default the ego's"""


class TimeHeadway(TimeThreshold, frozen=True):
    """The time in s that the ego needs at its present speed for the gap to a vehicle."""

    vehicle: Selector = "leader"
    """towards which vehicle"""


class TimeToCollision(TimeThreshold, frozen=True):
    """The time in s in which the gap between the ego and a vehicle closes at their present velocities."""

    vehicle: Selector = "nearest"
    """towards which vehicle"""


class OrName:
    """Marks the number of an event, for which a file may give the event's name. `Scenario` puts the number in
    its place."""

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        return {"anyOf": [handler(schema), {"type": "string", "minLength": 1}]}


class RelativeDistance(DistanceThreshold, frozen=True):
    """The distance in m between the ego's centre and a vehicle's, or a thing's of an event."""

    vehicle: Selector = "nearest"
    """towards which vehicle"""
    event: Annotated[AnyDistribution, Bounds(0, 999, whole=True), OrName()] | None = None
    """towards the nearest vehicle or thing of which event, instead; as in `event_state`"""

    @classmethod
    def misfits(cls, given: Mapping[str, Any]) -> Iterator[tuple[str, str | None]]:
        """A vehicle, or an event."""
        if "event" in given and given.get("vehicle", "nearest") != "nearest":
            yield "takes the place of `vehicle`; give one of them", "event"


class EventState(TimeThreshold, frozen=True):
    """The time in s since an earlier event of the file began, or since it was over."""

    event: Annotated[AnyDistribution, Bounds(0, 999, whole=True), OrName()]
    """which event, by its `name` or its number: one that stands before this in the file; the first is 0, as
    in the key events.0"""
    state: Literal["begun", "over"] = "begun"
    """whether the time counts from its begin or from its end; never, if it does not happen or does not end"""
    above: Second | None = Constant(value=0.0)
    """s; holds when it is longer"""


class Somewhere(FileModel, frozen=True):
    """A place."""

    position: Position | None = None
    """[x, y] in m east and north of the junction's centre"""
    lane: Identifier | None = None
    """lane that the place is on, instead of `position`"""
    at: Metre | None = None
    """m from the junction along `lane`, or inside the junction in driving direction"""

    @classmethod
    def misfits(cls, given: Mapping[str, Any]) -> Iterator[tuple[str, str | None]]:
        """Either a position, or a lane and a place on it."""
        if ("position" in given) == ("lane" in given):
            if set(given) <= set(cls.model_fields):
                yield "expected either `position` or `lane` and `at`", None
        elif "lane" in given and "at" not in given:
            yield "needs `at`, the place along it in m", "lane"
        elif "at" in given and "lane" not in given:
            yield "goes with `lane` only", "at"


class ReachPosition(Somewhere, frozen=True):
    """The ego, or a vehicle, is near a place."""

    vehicle: Selector | None = None
    """which vehicle; by default the ego"""
    tolerance: Annotated[AnyDistribution, Bounds(0, 200, "m", above=True)] = Constant(value=2.0)
    """m, how near counts as there"""


class DistanceToPlace(Somewhere, PathThreshold, frozen=True):
    """The distance in m along the ego's path to a place that is on it, or at most 10 m beside it; negative
    once past it. It never holds in an episode in which the ego's path does not lead there."""


def _some(groups: tuple[Any, ...]) -> tuple[Any, ...]:
    if not groups:
        refuse("expected one group of conditions at least")
    return groups


class Conditions(FileModel, frozen=True):
    """Conditions that must all hold at once."""

    simulation_time: TimeThreshold | None = None
    """s since the episode began"""
    traveled_distance: DistanceThreshold | None = None
    """m the ego has driven since the episode began"""
    relative_distance: RelativeDistance | None = None
    """m from the ego's centre to that of a surrounding vehicle, or of who or what takes part in an event"""
    time_headway: TimeHeadway | None = None
    """s of headway to a surrounding vehicle, by default the leader"""
    time_to_collision: TimeToCollision | None = None
    """s until the gap to a surrounding vehicle, by default the nearest, has closed"""
    reach_position: ReachPosition | None = None
    """the ego, or a vehicle, is near a place"""
    speed: SpeedOf | None = None
    """the speed of the ego, or of a vehicle, m/s"""
    stand_still: TimeThreshold | None = None
    """s for which the ego has been standing (slower than 0.5 m/s) without a break; 0 while it moves"""
    ego_distance_to_junction: PathThreshold | None = None
    """m from the ego to its stop line, negative past it"""
    ego_distance_to_place: DistanceToPlace | None = None
    """m from the ego along its path to a place on it or at most 10 m beside it, negative past it"""
    event_state: EventState | None = None
    """s since an earlier event of the file began, or was over"""

    @model_validator(mode="after")
    def _check(self) -> Self:
        if not self.model_fields_set:
            refuse(f"no condition given; expected one or more of {', '.join(type(self).model_fields)}")
        return self

    @property
    def conditions(self) -> dict[str, FileModel]:
        """Name -> condition, of those given."""
        named = {name: getattr(self, name) for name in Conditions.model_fields}
        return {name: condition for name, condition in named.items() if condition is not None}


class Trigger(Conditions, frozen=True):
    """When the event happens: conditions that must all hold at once, and of the groups in `any` one."""

    any: Annotated[tuple[Conditions, ...], AfterValidator(_some)] | None = None
    """groups of these conditions; at least one group must hold, too"""
    probability: Annotated[AnyDistribution, Bounds(0, 1)] | None = None
    """whether the event happens in this episode at all; drawn once per episode"""

    @property
    def groups(self) -> dict[tuple[str | int, ...], Conditions]:
        """Where it stands in `when` -> conditions that hold together: its own, and each group of `any`."""
        return {(): self, **{("any", i): group for i, group in enumerate(self.any or ())}}

    @property
    def chance(self) -> Distribution:
        """Probability that the event happens at all."""
        return Constant(value=1.0) if self.probability is None else self.probability


def awaited(trigger: Trigger | None) -> int | None:
    """Number, in keys, of the event for which a drawn trigger waits; None if it waits for none."""
    return None if trigger is None or trigger.event_state is None else int(float(trigger.event_state.event))


def named_events(group: Conditions) -> dict[tuple[str, str], Distribution]:
    """Where in a group of conditions an earlier event is named -> its number."""
    parts = {"event_state": group.event_state, "relative_distance": group.relative_distance}
    return {(name, "event"): part.event for name, part in parts.items() if part is not None and part.event}
