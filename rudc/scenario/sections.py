"""The parts of a scenario besides its events: the ego, the traffic around it, and when an episode ends."""

from __future__ import annotations

import itertools
from collections.abc import Collection, Iterator, Mapping
from typing import Annotated, Any, ClassVar, Self

import numpy as np
from pydantic import (
    AfterValidator,
    Field,
    GetJsonSchemaHandler,
    SerializerFunctionWrapHandler,
    model_serializer,
    model_validator,
)
from pydantic_core import CoreSchema

from rudc.errors import InputError
from rudc.scenario.base import FileModel, Identifier, Truth, refuse
from rudc.scenario.choices import AnyEgoTurn, Place, possible_together
from rudc.scenario.distributions import (
    AnyDistribution,
    Bounds,
    Constant,
    Distribution,
    Normal,
    NormalParameters,
    Uniform,
    draw,
)
from rudc.scenario.events.event import Speed
from rudc.scenario.plan import EgoPlan, TrafficPlan
from rudc.scenario.shared import Shared

Share = Annotated[AnyDistribution, Bounds(0, 1e6)]


class EgoRoute(FileModel, frozen=True):
    """Where the ego comes from and goes: `random`, {from: ARM, turn: TURN} or {from: EDGE, to: EDGE}."""

    origin: Place = Field(default="random", alias="from")
    """arm (compass name) or edge it comes from, or random"""
    turn: AnyEgoTurn = "random"
    """where it turns, drawn where several arms lie that way; to the left it starts on the leftmost lane that
    leads there, else on the rightmost"""
    to: Place | None = None
    """arm or edge it leaves by, instead of `turn`"""

    @model_validator(mode="before")
    @classmethod
    def _from_word(cls, data: Any) -> Any:
        if isinstance(data, str):
            if data != "random":
                refuse(
                    f"expected random, {{from: ARM, turn: TURN}} or {{from: EDGE, to: EDGE}}; got {data!r}"
                )
            return {}
        return data

    @classmethod
    def misfits(cls, given: Mapping[str, Any]) -> Iterator[tuple[str, str | None]]:
        """Where it goes is given by `turn` or by `to`, and `to` needs `from`."""
        if "to" in given and "turn" in given:
            yield "does not go with `turn`: give one of the two", "to"
        origin = given.get("from", given.get("origin"))
        if "to" in given and origin is None:
            yield "needs `from`, the arm or edge it comes from", "to"
        if "to" in given and "random" in _words(origin):
            several = "`sweep: {ego.route.from: [ARM, ARM]}` drives from each of several"
            yield f"does not go with `from: random`: name the arm or edge it comes from; {several}", "to"

    def each(self) -> list[EgoRoute]:
        """Every route that may be drawn, with nothing left to `choice`."""
        return [
            self.model_copy(update={"origin": origin, "turn": turn, "to": to})
            for origin, turn, to in possible_together(self.origin, self.turn, self.to)
        ]

    @model_serializer(mode="wrap")
    def _without_idle_turn(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        data = handler(self)
        return data if self.to is None else {key: value for key, value in data.items() if key != "turn"}

    @classmethod
    def __get_pydantic_json_schema__(
        cls, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        return {"anyOf": [{"const": "random"}, handler.resolve_ref_schema(handler(schema))]}


def _words(given: Any) -> list[Any]:
    """The words that may be drawn of what a file gives: one, or a `choice` of several."""
    choice = given.get("choice") if isinstance(given, Mapping) else [given]
    values = choice.get("values") if isinstance(choice, Mapping) else choice
    return list(values) if isinstance(values, list | tuple) else []


class Ego(FileModel, frozen=True):
    """The ego's task and start."""

    route: EgoRoute = EgoRoute()
    """random, {from: ARM, turn: TURN} or {from: EDGE, to: EDGE}"""
    speed: Speed = Uniform(uniform=(6.0, 10.0))
    """m/s, at the start; at most 15 m/s, the limit of its road, and what bends before its stop line allow"""
    distance: Annotated[AnyDistribution, Bounds(0, 1000, "m", above=True)] = Uniform(uniform=(35.0, 45.0))
    """m from its front to the stop line, at the start"""
    destination: Annotated[AnyDistribution, Bounds(0, 1000, "m", above=True)] = Constant(value=30.0)
    """m beyond the junction's exit, where it has arrived; the end of the arm, if that is nearer"""
    may_cross_centre: Truth = False
    """whether it may pass what blocks its way on the lanes of oncoming traffic: no `wrong_way` then"""

    def each(self) -> list[Ego]:
        """The ego with every route that may be drawn."""
        return [self.model_copy(update={"route": route}) for route in self.route.each()]

    def plan(self, rng: np.random.Generator) -> EgoPlan:
        """The ego of one episode."""
        route = self.route
        origin, turn, to = (draw(word, rng) for word in (route.origin, route.turn, route.to))
        return EgoPlan(
            origin=None if origin == "random" else origin,
            turn=None if turn == "random" else turn,
            destination=to,
            speed_mps=self.speed.sample(rng),
            distance_m=self.distance.sample(rng),
            destination_m=self.destination.sample(rng),
            may_cross_centre=self.may_cross_centre,
        )


class Idm(FileModel, frozen=True):
    """Parameters of the Intelligent Driver Model, drawn anew for each surrounding vehicle."""

    headway: Annotated[AnyDistribution, Bounds(0, 10, "s", above=True)] = Constant(value=1.0)
    """s, desired time headway"""
    min_gap: Annotated[AnyDistribution, Bounds(0, 20, "m", above=True)] = Constant(value=2.5)
    """m, gap at standstill"""
    accel: Annotated[AnyDistribution, Bounds(0, 10, "m/s2", above=True)] = Constant(value=2.6)
    """m/s2, greatest acceleration"""
    decel: Annotated[AnyDistribution, Bounds(0, 10, "m/s2", above=True)] = Constant(value=4.5)
    """m/s2, comfortable deceleration"""


def _refuse_nothing(shares: Mapping[str, Distribution], example: str) -> None:
    """Refuse shares that are all 0, or that can all be drawn as 0."""
    if all(share.support[1] == 0 for share in shares.values()):
        refuse(f"one share at least must be above 0, as in {example}")
    if _may_all_be_zero(shares.values()):
        refuse(
            "all shares can be drawn as 0 in the same episode; one at least must always be above 0 "
            "(episodes without traffic: `density: {choice: [0, 20]}`)"
        )


def may_be_zero(share: Distribution) -> bool:
    """Whether a share can be drawn as 0: 0 itself, or a choice with 0 in it. A number from a range is taken
    to be above 0.
    """
    return 0.0 in (share.possible or share.support[1:])


def _may_all_be_zero(shares: Collection[Distribution]) -> bool:
    """Whether all shares can be drawn as 0 at once. Those that a shared number says go together."""
    said = {share.shared: share.number for share in shares if isinstance(share, Shared)}
    listed = {name: number.possible for name, number in said.items() if number and number.possible}
    for values in itertools.product(*listed.values()):
        at = dict(zip(listed, values, strict=True))
        if all(
            share.of(at[share.shared]) == 0.0
            if isinstance(share, Shared) and share.shared in at
            else may_be_zero(share)
            for share in shares
        ):
            return True
    return False


def _drawn(key: str, shares: Mapping[str, Distribution], rng: np.random.Generator) -> dict[str, float]:
    """Name -> share, of those above 0; together 1."""
    drawn = {name: share.sample(rng) for name, share in shares.items()}
    total = sum(drawn.values())
    if total == 0:
        raise InputError(f"{key}: every share was drawn as 0")
    return {name: share / total for name, share in drawn.items() if share > 0}


def _in_order(shares: Mapping[str, Distribution]) -> dict[str, Distribution]:
    """The same shares in the order of their names: a digest does not know the order of the file."""
    return dict(sorted(shares.items()))


class Shares(FileModel, frozen=True):
    """Relative shares, one for each key; one that is not given is 0."""

    EXAMPLE: ClassVar[str]
    """what a file may say"""

    @model_validator(mode="after")
    def _check(self) -> Self:
        _refuse_nothing(self.shares, self.EXAMPLE)
        return self

    @property
    def shares(self) -> dict[str, Distribution]:
        """Key -> share."""
        return {name: getattr(self, name) for name in type(self).model_fields}


class Mix(Shares, frozen=True):
    """Relative shares of the types of surrounding vehicles."""

    EXAMPLE: ClassVar[str] = "{car: 0.8, truck: 0.2}"

    car: Share = Constant(value=0.0)
    """share of cars, 5 m long"""
    truck: Share = Constant(value=0.0)
    """share of trucks, 7.5 m long"""
    bus: Share = Constant(value=0.0)
    """share of buses, 12 m long"""
    motorcycle: Share = Constant(value=0.0)
    """share of motorcycles, 2.2 m long"""
    bicycle: Share = Constant(value=0.0)
    """share of bicycles, 1.8 m long"""


class Turns(Shares, frozen=True):
    """Relative shares of the turns at the junction."""

    EXAMPLE: ClassVar[str] = "{left: 1, straight: 4}"

    left: Share = Constant(value=0.0)
    """share of those who turn left, of all who come by an arm"""
    straight: Share = Constant(value=0.0)
    """share of those who go straight on"""
    right: Share = Constant(value=0.0)
    """share of those who turn right"""


def _of_arms(shares: dict[str, Distribution]) -> dict[str, Distribution]:
    _refuse_nothing(shares, "{north: 3, east: 1}")
    return shares


class Traffic(FileModel, frozen=True):
    """Surrounding vehicles."""

    density: Annotated[AnyDistribution, Bounds(0, 150, "veh/km")] = Constant(value=20.0)
    """veh/km of two-way road, held throughout the episode"""
    speed: Speed = Uniform(uniform=(6.0, 10.0))
    """m/s, at the start, at most the limit of its road; drawn anew for each vehicle"""
    mix: Mix = Mix(car=Constant(value=1.0))
    """relative share of each type of vehicle; of those not named, none"""
    origins: Annotated[dict[Identifier, Share], AfterValidator(_of_arms)] | None = Field(
        default=None, alias="from"
    )
    """ARM -> relative share of those who come by it, such as {north: 3, east: 1}; by an arm that is not named
    come only those whom an event needs; by default in proportion to the arms' lanes; `density` is that of all
    roads together, and few arms may not let in so many"""
    turns: Turns | None = None
    """relative share of each turn among those who come by an arm, such as {left: 1, straight: 4}; of those
    not named, none; by default all ways on are equally likely"""
    impatience: Annotated[AnyDistribution, Bounds(0, 1)] = Constant(value=0.6)
    """how far they rely on others to brake for them, 0 to 1 (SUMO's `impatience`, 0 by default in SUMO)"""
    minor_gap: Annotated[AnyDistribution, Bounds(0, 20, "s")] = Constant(value=0.6)
    """s, gap that is enough for them on the minor road (SUMO's `jmTimegapMinor`, 1 by default in SUMO)"""
    idm: Idm = Idm()
    """how they follow each other"""
    speed_factor: Annotated[AnyDistribution, Bounds(0.1, 3)] = Normal(
        normal=NormalParameters(mean=1.0, std=0.1, low=0.8, high=1.2)
    )
    """desired speed, as a multiple of the limit; drawn anew for each vehicle"""
    warm_up: Annotated[AnyDistribution, Bounds(0, 300, "s")] = Constant(value=5.0)
    """s simulated before the ego appears"""

    def plan(self, rng: np.random.Generator) -> TrafficPlan:
        """The traffic of one episode; what differs from vehicle to vehicle stays a distribution."""
        return TrafficPlan(
            density=self.density.sample(rng),
            speed=self.speed,
            mix=_drawn("traffic.mix", self.mix.shares, rng),
            impatience=self.impatience.sample(rng),
            minor_gap_s=self.minor_gap.sample(rng),
            headway_s=self.idm.headway,
            min_gap_m=self.idm.min_gap,
            accel=self.idm.accel,
            decel=self.idm.decel,
            speed_factor=self.speed_factor,
            warm_up_s=self.warm_up.sample(rng),
            origins=None if self.origins is None else _drawn("traffic.from", _in_order(self.origins), rng),
            turns=None if self.turns is None else _drawn("traffic.turns", self.turns.shares, rng),
        )


class Episode(FileModel, frozen=True):
    """When an episode ends by itself."""

    timeout: Annotated[AnyDistribution, Bounds(0, 3600, "s", above=True)] = Constant(value=40.0)
    """s after which the ego counts as frozen"""
