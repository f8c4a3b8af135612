"""Problems with things that a scenario file places: two things in the same place, things where the ego
starts, and boxes that should hide what is beside the road but reach onto it.

They are found from the file alone. Each event is played on a stage on which nothing moves and which notes the
things that would stand there. Only events of which nothing is drawn are played; the places of others are
checked when the episode is set up.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from rudc.arrays import Array
from rudc.errors import NetworkError
from rudc.geometry import rectangle_gaps
from rudc.network.stretches import EGO_LANES
from rudc.scenario.base import parts_of
from rudc.scenario.distributions import Constant
from rudc.scenario.dotted import Path, dotted
from rudc.scenario.drawable import Drawable
from rudc.scenario.events import Event, effect_of
from rudc.scenario.events.registry import ask_effect
from rudc.scenario.events.stage import Body, Halt, Size, XYHeading
from rudc.scenario.poses import Pose
from rudc.scenario.problems import Problem
from rudc.scenario.selectors import Selector
from rudc.world.events.places import (
    ON_THE_ROAD,
    NetworkStage,
    Standing,
    overlapped,
    reaches_onto_road,
    said,
    size_of,
)
from rudc.world.spawn import MARGIN_M

if TYPE_CHECKING:
    from rudc.network.network import Movement, Network, Route
    from rudc.scenario.sections import Ego


NAMED = 2
"""things at most that are named in whose place another stands: of 300 in one place each pair would be told"""
_Thing = tuple[Path, Event, Standing]
"""where the file places a thing, the event of that thing, and the thing itself"""


class _Site(NetworkStage):
    """A stage that only notes what events put there; nothing moves on it."""

    decision_s = 0.1

    def __init__(self, network: Network, route: Route) -> None:
        self.network, self.route = network, route
        self.unlawful = set()
        self.found: list[Standing] = []
        self.hiding: list[tuple[XYHeading, Size]] = []
        """place and size (m) of the boxes that hide what is behind them"""

    @property
    def time_s(self) -> float:
        return 0.0

    @property
    def present(self) -> tuple[str, ...]:
        return ()

    @property
    def density(self) -> float:
        return 0.0

    def set_density(self, density: float | None, event: str = "") -> None: ...

    def stand(
        self, name: str, body: Body, place: XYHeading, size: Size | None = None, *, for_s: float = math.inf
    ) -> None:
        self.found.append(Standing(name, body, place, size or size_of(body)))

    def is_free(
        self, body: Body, place: XYHeading, size: Size | None = None, *, for_ego: bool = False
    ) -> bool:
        return True

    def is_taken_for_now(self, body: Body, place: XYHeading, size: Size | None = None) -> bool:
        return False

    def choose(self, selector: Selector) -> list[str]:
        return []

    def held_by(self, number: int | None) -> list[str]:
        return []

    def speed(self, name: str) -> float:
        return 0.0

    def is_inside(self, name: str) -> bool:
        return False

    def seize(self, name: str, *, heedless: bool = False) -> None: ...

    def release(self, name: str, *, heedless: bool = False) -> None: ...

    def slow_down(self, name: str, deceleration: float, least: float = 0.0) -> None: ...

    def set_speed_factor(self, name: str, factor: float | None, event: str = "") -> None: ...

    def set_top_speed(self, name: str, speed: float | None, event: str = "") -> None: ...

    def send(
        self, name: str, body: Body, way: Array, speed: float, late_m: float = 0.0, beyond_m: float = 0.0,
        behind: Array | None = None, halt: Halt | None = None, size: Size | None = None,
    ) -> None: ...  # fmt: skip

    def has_room(
        self, body: Body, way: Array, speed: float, late_m: float = 0.0, size: Size | None = None
    ) -> bool:
        return True

    def things_of(self, event: str) -> frozenset[str]:
        return frozenset()

    def remove_things(self, event: str) -> None: ...

    def hide_behind(self, event: str, place: XYHeading, size: Size) -> None:
        self.hiding.append((place, size))

    def hide_behind_things(self, event: str) -> None: ...

    def reveal(self, event: str) -> None: ...

    def set_noise(self, position: float, speed: float, heading: float) -> None: ...

    def set_own_noise(self, acceleration: float) -> None: ...

    def set_dropout(self, probability: float, range_m: float) -> None: ...

    def set_friction(self, friction: float | None) -> None: ...

    def lay_patch(self, event: str, lane: str, at: float, length: float, friction: float) -> None: ...

    def remove_patch(self, event: str) -> None: ...

    def set_actuators(self, delay_s: float, lag_s: float) -> None: ...


def in_the_way(
    network: Network, movements: Sequence[Movement], ego: Ego, events: Mapping[int, Event]
) -> list[Problem]:
    """The problems with things that events place.

    Things that overlap on some route that the ego may be given, things that are too close to the ego's start
    on every such route, and boxes that should hide what is beside the road but reach onto it.
    """
    placed = [event for event in events.values() if _is_placed(event)]
    if not placed:
        return []
    if not isinstance(ego.distance, Constant) and not any(map(_follows_ego, placed)):
        movements = movements[:1]
    overlaps: list[Problem] = []
    boxes: dict[Path, Problem] = {}
    starts: list[dict[Path, Problem]] = []
    for movement in movements:
        route = network.route(movement.origin, movement.destination)
        for i, event in events.items():
            boxes = {**_boxes_on_the_road(network, route, i, event), **boxes}
        things = [thing for i, event in events.items() for thing in _standing(network, route, i, event)]
        overlaps += _overlaps(network, things)
        starts.append(
            {path: p for path, event, thing in things for p in _at_start(route, ego, path, event, thing)}
        )
    always = [p for path, p in starts[0].items() if all(path in start for start in starts)] if starts else []
    return [*dict.fromkeys(overlaps), *always, *boxes.values()]


def _overlaps(network: Network, things: list[_Thing]) -> list[Problem]:
    found = []
    for k, (path, event, thing) in enumerate(things):
        earlier = {other.name: at for at, before, other in things[:k] if _at_once(before, event)}
        met = overlapped(thing, [other for _, _, other in things[:k] if other.name in earlier])
        for other in met[:NAMED]:
            where = f"stands where {dotted(earlier[other.name])} stands, {said(network, thing.place)}"
            found.append(Problem(path, f"{where}; move one of them"))
    return found


def _at_start(route: Route, ego: Ego, path: Path, event: Event, thing: Standing) -> list[Problem]:
    """The problem of a thing that is there from the start, too close to the ego's start, if that is fixed."""
    if event.when is not None or not isinstance(ego.distance, Constant):
        return []
    body = route.key.vehicle
    s = route.stop_line_s - float(ego.distance) - 0.5 * body.length
    x, y, psi = (float(value) for value in route.path.pose(s))
    at, heading, size = np.array([thing.place[:2]]), np.array([thing.place[2]]), np.array([thing.size])
    gap = float(rectangle_gaps(x, y, psi, body.length, body.width, at, heading, size)[0])
    text = f"stands {gap:.1f} m from where the ego starts (ego.distance); {MARGIN_M:g} m are needed"
    return [Problem(path, text)] if gap < MARGIN_M else []


def _is_placed(event: Event) -> bool:
    """Whether all numbers and words of an event are fixed, not drawn; its trigger (`when`) does not count."""
    return all(_is_fixed(getattr(event, name)) for name in type(event).model_fields if name != "when")


def _follows_ego(event: Event) -> bool:
    """Whether an event names a lane relative to the ego (`EGO_LANES`)."""
    parts = (event, *standing_parts(event).values(), *listed_parts(event, "boxes"))
    return any(getattr(part, "lane", None) in EGO_LANES for part in parts)


def listed_parts(event: Event, key: str) -> tuple[Any, ...]:
    """The parts that an event lists under a key; none where an event of a user's has something else there."""
    parts = getattr(event, key, ())
    return tuple(parts) if isinstance(parts, (tuple, list)) else ()


def standing_parts(event: Event) -> dict[tuple[str, int], Any]:
    """Place in the event -> part, of what it lists that stands on the road, in the order of its things."""
    keys = ("vehicles", "objects")
    listed = ((key, k, part) for key in keys for k, part in enumerate(listed_parts(event, key)))
    return {(key, k): part for key, k, part in listed if isinstance(part, Pose)}


def _played(network: Network, route: Route, i: int, event: Event) -> _Site | None:
    """A stage on which an event has begun; None if some of it is drawn, or for which event it waits, or if a
    place does not exist.
    """
    state = event.when.event_state if event.when else None
    if not _is_placed(event) or (state is not None and not isinstance(state.event, Constant)):
        return None
    site = _Site(network, route)
    try:
        ask_effect(effect_of(event, f"{event.kind}{i}"), "begin", site, i + 1)
    except NetworkError:
        return None  # rudc/world/fitting.py reports it
    return site


def _standing(network: Network, route: Route, i: int, event: Event) -> Iterator[_Thing]:
    """The things that an event puts on the road to stand there."""
    site = None if effect_of(event, event.kind).felt else _played(network, route, i, event)
    parts = {str(k): path for k, path in enumerate(standing_parts(event))}
    for thing in site.found if site is not None else ():
        yield ("events", i, *parts.get(thing.name.rpartition(":")[2], ())), event, thing


def _boxes_on_the_road(network: Network, route: Route, i: int, event: Event) -> dict[Path, Problem]:
    """The problem of each box that reaches onto the road, by the box's place in the file."""
    site = _played(network, route, i, event) if listed_parts(event, "boxes") else None
    found = {}
    for k, (place, size) in enumerate(site.hiding if site is not None else ()):
        path: Path = ("events", i, "boxes", k)
        if reaches_onto_road(network, place, size):
            found[path] = Problem(path, f"{said(network, place)}: {ON_THE_ROAD}")
    return found


def _is_fixed(value: Any) -> bool:
    if isinstance(value, Drawable):
        return isinstance(value, Constant)
    return all(_is_fixed(part) for _, part in parts_of(value))


def _at_once(a: Event, b: Event) -> bool:
    """Whether the things of both events are sure to stand there at the same time: not if one of two events
    has a duration, after which its things are gone.
    """
    return a is b or (getattr(a, "duration", None) is None and getattr(b, "duration", None) is None)
