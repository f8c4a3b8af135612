"""`stalled_vehicle`: a vehicle that stands still in its lane, a new one or one of the traffic."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any, Literal

from pydantic import SerializerFunctionWrapHandler, model_serializer

from rudc.scenario.choices import AnyVehicleType, Place
from rudc.scenario.events.event import ROUNDED_S, UNHURRIED, Duration, Held, VehicleEvent
from rudc.scenario.events.registry import register_event
from rudc.scenario.events.stage import Stage
from rudc.scenario.selectors import Selector
from rudc.scenario.triggers import Metre

STANDS = 0.1
"""m/s, below which a stalled vehicle has come to rest; nearly 0, since its duration counts from there"""


class StalledVehicle(VehicleEvent, frozen=True):
    """A vehicle that stands still in its lane: a new one, or a surrounding vehicle that stops."""

    kind: Literal["stalled_vehicle"]
    """a vehicle that stands still in its lane"""
    lane: Place | None = None
    """lane on which a vehicle stands"""
    at: Metre | None = None
    """m from the junction along `lane`, of its centre"""
    type: AnyVehicleType = "car"
    """what vehicle stands on `lane`"""
    vehicle: Selector | None = None
    """surrounding vehicle that stops, instead of `lane`"""
    duration: Duration | None = None
    """s it stands, for a `vehicle` from when it has come to stand; by default for good. One on `lane` is then
    taken away, a `vehicle` drives on"""

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


class StalledVehicleEffect(Held[StalledVehicle]):
    """It stands on its lane, or comes to a stop; then the duration counts from standstill."""

    _stands_since: float | None = None

    @property
    def from_the_start(self) -> bool:  # pyright: ignore[reportIncompatibleVariableOverride] - depends on the event
        return self.event.lane is not None

    @property
    def is_endless(self) -> bool:
        """Whether it has no duration: who stands does not leave."""
        return self.event.duration is None

    def begin(self, stage: Stage) -> bool:
        if self.event.lane is None or self.event.at is None:
            return super().begin(stage)
        place = stage.pose_on_lane(self.event.lane, float(self.event.at))
        return self.put(stage, [(self.event.type, place, None)])

    def hold(self, stage: Stage, name: str) -> None:
        stage.seize(name)

    def let_go(self, stage: Stage, name: str) -> None:
        stage.release(name)

    def step(self, stage: Stage) -> None:
        super().step(stage)
        fastest = max(map(stage.speed, self.held), default=math.inf)
        if self._stands_since is None and fastest < STANDS:
            self._stands_since = stage.time_s

    def is_over(self, stage: Stage) -> bool:
        if self.event.vehicle is None or self.event.duration is None:
            return super().is_over(stage)
        over_s = math.inf if self._stands_since is None else self._stands_since + float(self.event.duration)
        return stage.time_s >= over_s - ROUNDED_S or self.all_left(stage)

    def command(self, stage: Stage, name: str) -> None:
        stage.slow_down(name, UNHURRIED)

    def end(self, stage: Stage) -> None:
        stage.remove_things(self.name)
        super().end(stage)


register_event(StalledVehicle, StalledVehicleEffect)
