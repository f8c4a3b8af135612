"""`View`: what there is to see of an episode at one instant. Frames, films and previews are drawn from it."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from rudc.arrays import Array
from rudc.geometry import rectangle_corners
from rudc.network.polyline import resample
from rudc.scenario.poses import Pose
from rudc.world.events.places import across_arm, against_lane
from rudc.world.obstacles import listed_parts, standing_parts
from rudc.world.scene import Scene

if TYPE_CHECKING:
    from rudc.network.network import Network, Route
    from rudc.scenario.events import Event
    from rudc.world.isolated import AnyWorld


WAY_M = 20.0
"""m of a long way that are drawn"""


@dataclass(frozen=True)
class ShownEvent:
    """One event of the episode, as a picture numbers it."""

    number: int
    """its place in the scenario's file, from 1"""
    event: Event
    begun_s: float | None = None
    """s when it took effect; None while it waits"""
    visible_s: float | None = None
    """s when the ego first met it (`Happening.visible_s`); None before"""
    is_over: bool = False
    bodies: frozenset[str] = frozenset()
    """names, as in `Scene.ids`, of whom it put on the road or has taken hold of"""
    unlawful: frozenset[str] = frozenset()
    """those of them that break the rules now: they disregard the right of way"""
    places: tuple[tuple[float, float], ...] = ()
    """m, where its number goes while no body carries it"""
    patch: tuple[Array, ...] = ()
    """(4, 2) m each, the corners of what is slippery now"""
    way: Array | None = None
    """(K, 2) m, where somebody will move who is not there yet"""
    refused: bool = False
    """whether it waits though its conditions hold: there is no room for it, or nobody to act on"""
    no_room: bool = False
    """whether it waits for room on the road"""

    @property
    def waits(self) -> bool:
        """Whether it has not begun."""
        return self.begun_s is None


@dataclass(frozen=True)
class Driving:
    """What the driver says of its last decision."""

    agent: str = ""
    """its name in tables"""
    sigma: float = math.nan
    """its uncertainty, reward units; nan if it states none"""
    status: str = ""
    """what a correction such as the safety filter did (`nominal`, `solved`, ...); empty without one"""
    correction: tuple[float, float] = (0.0, 0.0)
    """by how much it changed the action: m/s2, rad"""
    active: tuple[str, ...] = ()
    """names of the constraints that it acts on: `veh:ID`, `road:left:PLACE`"""
    constrained: tuple[str, ...] = ()
    """names of all its constraints"""


MISPLACED_M = 0.1
"""m, from which on somebody is shown elsewhere than they are"""


@dataclass(frozen=True)
class View:
    """A scene, what the ego's sensors show of it, and what the scenario does to it."""

    truth: Scene
    perceived: Scene | None = None
    """what the sensors show; None if that is the truth"""
    occluders: Array = field(default_factory=lambda: np.zeros((0, 5)))
    """(K, 5) opaque boxes: centre x, y (m), heading (rad), length, width (m)"""
    range_m: float = math.inf
    """m, how far the sensors reach"""
    scenario: str = ""
    seed: int | None = None
    events: tuple[ShownEvent, ...] = ()
    outcome: str = ""
    """how the episode ended; empty while it goes on"""

    @property
    def hidden(self) -> frozenset[str]:
        """Names of those whom the ego's sensors do not show."""
        return frozenset() if self.perceived is None else frozenset(self.truth.ids) - set(self.perceived.ids)

    @property
    def misplaced(self) -> tuple[int, ...]:
        """Rows of `perceived` of those whom the sensors show elsewhere than they are."""
        if self.perceived is None:
            return ()
        places = dict(zip(self.truth.ids, self.truth.position, strict=True))
        shown = zip(self.perceived.ids, self.perceived.position, strict=True)
        return tuple(
            k
            for k, (name, place) in enumerate(shown)
            if name in places and np.abs(place - places[name]).max() >= MISPLACED_M
        )

    @property
    def sensors_limited(self) -> bool:
        """Whether there are places that the ego cannot see."""
        return math.isfinite(self.range_m) or len(self.occluders) > 0

    @property
    def heedless(self) -> frozenset[str]:
        """Names of those whom an event has disregard the right of way."""
        return frozenset().union(*(event.unlawful for event in self.events))

    @property
    def numbers(self) -> dict[str, str]:
        """Name of each body that takes part in events -> their numbers, such as `1,2`."""
        found: dict[str, list[str]] = {}
        for event in self.events:
            for name in event.bodies:
                found.setdefault(name, []).append(str(event.number))
        return {name: ",".join(numbers) for name, numbers in found.items()}


def view_of(world: AnyWorld, outcome: str | None = None) -> View:
    """The episode that a world plays, as it is now."""
    scene, seen, sensors, plan = world.scene(), world.perceived(), world.sensors(), world.plan
    happenings = world.happenings()
    return View(
        truth=scene,
        perceived=None if seen is scene else seen,
        occluders=sensors.occluders,
        range_m=sensors.range_m,
        scenario=plan.scenario,
        seed=plan.seed,
        events=tuple(
            ShownEvent(
                number, happening.event, happening.begun_s, happening.visible_s, happening.is_over,
                happening.bodies, happening.unlawful,
                () if happening.bodies or happening.is_over
                else places(world.network, scene.route, happening.event),
                _corners(happening.patch),
                way_of(world.network, scene.route, happening.event) if happening.begun_s is None else None,
                happening.refused, happening.no_room,
            )
            for number, happening in zip(plan.event_numbers, happenings, strict=True)
        ),
        outcome=outcome or "",
    )  # fmt: skip


def _corners(boxes: tuple[tuple[float, ...], ...]) -> tuple[Array, ...]:
    """The corners (4, 2) m of boxes as in `Happening.patch`."""
    return tuple(rectangle_corners(box[:2], box[2], box[3:]) for box in map(np.array, boxes))


def places(network: Network, route: Route, event: Event) -> tuple[tuple[float, float], ...]:
    """m, m: where an event takes place, as far as it says so itself."""
    parts: Any = (*standing_parts(event).values(), *listed_parts(event, "boxes")) or (event,)
    found = []
    for part in parts:
        # the `position` of `sensor_noise` is no place
        position = getattr(part, "position", None) if isinstance(part, Pose) else None
        lane, arm_name, at = (getattr(part, name, None) for name in ("lane", "arm", "at"))
        if position is not None:
            x, y = (float(v) for v in position)
            found.append((float(network.center[0]) + x, float(network.center[1]) + y))
        elif lane is not None:
            lateral = float(getattr(part, "lateral", 0.0))
            found.append(network.place_on_lane(lane, float(at or 0.0), lateral, route=route)[:2])
        elif arm_name is not None:
            x, y = across_arm(network, route, arm_name, float(at or 0.0))[_side(part)].tolist()
            found.append((x, y))
    return tuple(found)


def way_of(network: Network, route: Route, event: Event) -> Array | None:
    """(K, 2) m, the beginning of the way that an event sends somebody along; None if it sends nobody."""
    arm_name, lane, at = (getattr(event, name, None) for name in ("arm", "lane", "at"))
    if arm_name is not None:
        way = across_arm(network, route, arm_name, float(at or 0.0))
        return way[::-1] if _side(event) else way
    if event.kind == "wrong_way":
        way = against_lane(network, route, str(lane), float(at or 0.0))
        return resample(way, np.linspace(0.0, WAY_M, 9))
    return None


def _side(crossing: Any) -> int:
    """Which end of the way across an arm comes first."""
    return 1 if getattr(crossing, "from_side", "right") == "left" else 0
