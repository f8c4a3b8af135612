"""Whether a scenario's episodes can be set up, found out before anything is run."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from rudc.errors import RudcError, ScenarioError
from rudc.kernels import as_written
from rudc.network.check import against_lane
from rudc.network.network import load_network
from rudc.network.route_builder import start_row
from rudc.network.stretches import EGO_IN, EGO_OUT
from rudc.scenario.choices import possible, words_in
from rudc.scenario.dotted import value_text
from rudc.scenario.events import effect_of
from rudc.scenario.events.pedestrian_crossing import PedestrianCrossing
from rudc.scenario.events.vehicle_crossing import VehicleCrossing, beyond_way
from rudc.scenario.library import shown
from rudc.scenario.loader import load_scenario
from rudc.scenario.numbers_in import numbers_in
from rudc.scenario.selectors import ByArm
from rudc.scenario.shared import Shared
from rudc.scenario.spread import spread
from rudc.scenario.triggers import Threshold
from rudc.vehicle import EgoVehicle
from rudc.world.casting import selected
from rudc.world.config import WorldConfig
from rudc.world.events import numbered
from rudc.world.events.conditions import way_to
from rudc.world.events.places import across_arm, size_of
from rudc.world.events.selection import arrivals
from rudc.world.fitting import likely, misfits
from rudc.world.obstacles import standing_parts
from rudc.world.spawn import movements_of
from rudc.world.vehicle_types import VEHICLE_TYPES

if TYPE_CHECKING:
    from rudc.network.network import Network
    from rudc.network.road import Movement
    from rudc.scenario.events import Event
    from rudc.scenario.model import Scalar, Scenario
    from rudc.scenario.triggers import Conditions

COUNTED = "simulation_time", "event_state"
"""conditions on a time that goes on by DECISION_S from one decision to the next"""
DECISION_S = WorldConfig().decision_s
SHARP = math.radians(120)
"""a turn sharper than this may lead over lanes of the opposite direction"""
IN_THE_WAY = (
    "accident",
    "stalled_vehicle",
    "lane_closure",
    "slippery_patch",
    "pedestrian_crossing",
    "vehicle_crossing",
)
"""kinds of events that put something in the ego's way at a place in a lane or across an arm"""
TRIED = 16
"""episodes that are set up at most: `rudc scenario validate` answers at once"""


def validated(path: Path, tried: int = TRIED) -> tuple[Scenario | None, list[str]]:
    """A file's scenario, None where it cannot be read, and all that is wrong with it, a line each; `tried` as
    for `try_out`."""
    try:
        scenario = load_scenario(path, fit=misfits)
    except ScenarioError as error:
        return None, str(error).splitlines()
    return scenario, [f"{shown(path)}: {problem}" for problem in try_out(scenario, tried)]


def try_out(scenario: Scenario, tried: int = TRIED) -> list[str]:
    """What goes wrong when episodes of the scenario are set up in a world.

    `tried` episodes are shared out among the points of its sweep that `tried_points` chooses, one to each at
    least: those of the first seeds. Only the first that goes wrong is told of each point.
    """
    from rudc.world.world import World  # loads libsumo, which checking alone does not need

    found: dict[str, str] = {}
    points = tried_points(scenario)
    for swept in points:
        seed = 0
        try:
            point = scenario.varied(swept) if swept else scenario
            with as_written(), World(load_network(point.network, point.junction)) as world:
                for seed in range(max(tried // len(points), 1)):
                    world.reset(point.plan(seed))
        except RudcError as error:
            found.setdefault(str(error), _where({**swept, "seed": seed} if seed else swept))
    return [where + text for text, where in found.items()]


def never_happening(scenario: Scenario) -> list[str]:
    """A line for each event that can never happen: it waits for a time, a way, a speed or a place that no
    episode reaches, for a quantity below its least value, for a time between two decisions, for the end of an
    event without duration, or for a vehicle from where no arm is or of a kind that never comes by the ego's
    own arm, or its probability is 0; one for a start speed or a destination that no episode reaches; one for
    each kind of `traffic.mix` that may drive nowhere; one for what stands in or crosses the ego's exit
    beyond its destination; and one for a shared number that nothing names. Of a sweep, at the points that
    `tried_points` chooses."""
    found: dict[str, str] = {}
    for swept in tried_points(scenario):
        point = scenario.varied(swept) if swept else scenario
        for text in chain(*(find(point) for find in _FINDERS)):
            found.setdefault(text, _where(swept))
    return [found[text] + text for text in sorted(found, key=_number)]


def _number(text: str) -> int:
    """The number of the event that a warning is about; 0 if it is about none."""
    about = re.match(r"event (\d+)", text)
    return int(about[1]) if about else 0


def _in_vain(scenario: Scenario) -> Iterator[str]:
    for number, event in enumerate(scenario.events, start=1):
        if event.when is None:
            continue
        reasons = [*_why_not(scenario, number - 1, event.when)]
        groups = [[*_why_not(scenario, number - 1, group)] for group in event.when.any or ()]
        if event.when.chance.support[1] == 0.0:
            reasons.insert(0, "its probability is 0")
        if groups and all(groups):
            reasons.append(" and ".join(dict.fromkeys(why for why, *_ in groups)))
        for why in reasons:
            yield f"event {numbered(number, event)} can never happen: {why}"


def _why_not(scenario: Scenario, waiting: int, group: Conditions) -> Iterator[str]:
    """Why conditions of the event number `waiting`, from 0, can never hold together, as far as is known."""
    yield from _never(group, scenario.episode.timeout.support[1])
    yield from _endless(scenario, waiting, group)
    yield from _of_nothing(scenario, group)
    yield from _passed(scenario, group)
    yield from _elsewhere(scenario, group)


def _elsewhere(scenario: Scenario, when: Conditions) -> Iterator[str]:
    """Why none of the ego's ways leads past a place, or so far beyond it."""
    place = when.ego_distance_to_place
    if place is None:
        return
    network, movements = _roads(scenario)
    below = place.below.support[1] if place.below else math.inf
    for route in (network.route(m.origin, m.destination) for m in movements):
        last = route.exit_s + likely(scenario.ego.destination)[1] + network.vehicle.length
        for end in (0, 1):
            ahead = way_to(place, network, route, lambda value, end=end: likely(value)[end])
            if ahead is not None and ahead - below <= last + network.vehicle.v_max * DECISION_S:
                return
    yield "it waits for ego_distance_to_place, and no way of the ego leads to that place, or so far past it"


def _passed(scenario: Scenario, when: Conditions) -> Iterator[str]:
    """Why the ego never comes so far beyond its stop line."""
    below = when.ego_distance_to_junction and when.ego_distance_to_junction.below
    if not below:
        return
    network = load_network(scenario.network, scenario.junction)
    inside = float((network.paths.exit_s - network.paths.stop_s).max())
    most = inside + likely(scenario.ego.destination)[1] + network.vehicle.length
    if -below.support[1] > most + network.vehicle.v_max * DECISION_S:
        yield (
            f"it waits for ego_distance_to_junction below {below.support[1]:g} m, and the ego has arrived "
            f"{most:.0f} m beyond its stop line at the latest (ego.destination)"
        )


def _roads(scenario: Scenario) -> tuple[Network, list[Movement]]:
    """The network, and every movement that the ego may be given."""
    network = load_network(scenario.network, scenario.junction)
    plans = [ego.plan(np.random.default_rng(0)) for ego in scenario.ego.each()]
    return network, [*dict.fromkeys(m for plan in plans for m in movements_of(network, plan))]


def _nobody(scenario: Scenario) -> Iterator[str]:
    """Events whose vehicle would come from where no way leads to the junction."""
    network, movements = _roads(scenario)
    rows = {start_row(network, movement) for movement in movements}
    from_where = {"oncoming": "opposite the ego's", "crossing": "to a side of the ego's"}
    missing = {
        who: where for who, where in from_where.items()
        if not any(arrivals(network.paths, row, who == "oncoming").any() for row in rows)
    }  # fmt: skip
    for number, event in enumerate(scenario.events, start=1):
        for who in sorted(missing.keys() & _needed(event)):
            yield (
                f"event {numbered(number, event)} can never happen: no arm lies {missing[who]}, from "
                f"which a vehicle ({who}) would come"
            )


def _never_comes(scenario: Scenario) -> Iterator[str]:
    """Events whose vehicle is of a kind that never comes by the ego's own arm, where none is added."""
    network, movements = _roads(scenario)
    arms = {movement.origin for movement in movements}
    if len(arms) != 1:
        return
    for number, event in enumerate(scenario.events, start=1):
        for who in (who for who in _needed(event) if isinstance(who, ByArm)):
            own = {network.arm(name).name for name in possible(who.origin)} == arms
            kinds = [kind for kind in possible(who.type) if kind is not None]
            if own and kinds and not any(_may_come(scenario, kind) for kind in kinds):
                yield (
                    f"event {numbered(number, event)} can never happen: traffic.mix has no "
                    f"{' or '.join(kinds)}, and on the ego's own arm none is added"
                )


def _may_come(scenario: Scenario, kind: str) -> bool:
    """Whether traffic may have a kind of vehicle."""
    return bool(getattr(scenario.traffic.mix, kind).support[1])


def _needed(event: Event) -> list[str | ByArm]:
    """Whom an event selects, itself and in the conditions that must all hold."""
    if event.when is None or event.when.any is None or len(event.when.any) == 1:
        return selected([event])
    return selected([event.model_copy(update={"when": event.when.model_copy(update={"any": None})})])


def _too_fast(scenario: Scenario) -> Iterator[str]:
    """A start speed that the car or its road never allows."""
    network, movements = _roads(scenario)
    arms = {movement.origin for movement in movements}
    limits = [network.speed_limit(edge) for name in arms for edge in network.arm(name).in_edges]
    fastest, least = min(network.vehicle.v_max, max(limits)), likely(scenario.ego.speed)[0]
    if least > fastest:
        yield (
            f"the ego starts at {fastest:g} m/s at most, not at {least:g} (ego.speed): neither its road nor "
            "the car allows more"
        )


def _endless(scenario: Scenario, waiting: int, when: Conditions) -> Iterator[str]:
    """Why the end of an event never comes for which the event number `waiting`, from 0, waits."""
    after = when.event_state
    if after is None or after.state != "over" or after.event.support[0] != after.event.support[1]:
        return
    k = int(after.event.support[0])
    awaited = scenario.events[k]
    effect = effect_of(awaited, awaited.kind)
    others = [event.kind for i, event in enumerate(scenario.events) if i not in (k, waiting)]
    if effect.is_endless and not (effect.replaceable and awaited.kind in others):
        yield f"it waits for the end of event {numbered(k + 1, awaited)}, which has no duration"


def _of_nothing(scenario: Scenario, when: Conditions) -> Iterator[str]:
    """Why the ego is near to nothing of an event: that puts nothing on the road, and takes hold of nobody."""
    near = when.relative_distance
    if near is None or near.event is None or near.event.support[0] != near.event.support[1]:
        return
    k = int(near.event.support[0])
    event = scenario.events[k]
    effect = effect_of(event, event.kind)
    if effect.felt or effect.underfoot:
        named = numbered(k + 1, event)
        yield f"it waits for relative_distance to event {named}, which puts nothing on the road"


def _unused(scenario: Scenario) -> Iterator[str]:
    """A shared number that nothing names."""
    named = {number.shared for _, number in numbers_in(scenario) if isinstance(number, Shared)}
    named |= {word.shared for word in words_in(scenario)}
    for name in scenario.shared:
        if name not in named:
            yield f"nothing names the shared number {name!r}: {{shared: {name}}} would"


def _never(when: Conditions, end: float) -> Iterator[str]:
    """Why conditions can never hold together in an episode that ends at `end` (s), as far as is known."""
    fastest = EgoVehicle().v_max
    ends, drives = f"episodes end at {end:g} s (episode.timeout)", f"the ego drives at most {fastest:g} m/s"
    most = {
        "simulation_time": (end, "s", ends),
        "event_state": (end, "s", ends),
        "stand_still": (end, "s", ends),
        "traveled_distance": (fastest * end, "m", f"{drives}, and {ends}"),
        "speed": (fastest, "m/s", drives),
    }
    for name, threshold in when.conditions.items():
        if not isinstance(threshold, Threshold):
            continue
        others = name == "speed" and getattr(threshold, "vehicle", None) is not None
        greatest, unit, why = (math.inf, "", "") if others else most.get(name, (math.inf, "", ""))
        if threshold.above and threshold.above.support[0] >= greatest:
            yield f"it waits for {name} above {threshold.above.support[0]:g} {unit}, and {why}"
        if threshold.below and threshold.below.support[1] <= threshold.LEAST:
            yield f"it waits for {name} below {threshold.below.support[1]:g}, and there is nothing below that"
        elif threshold.below and name in COUNTED:
            first = threshold.above.support[0] if threshold.above else -DECISION_S  # time 0 counts
            latest = threshold.below.support[1]
            after = DECISION_S * (math.floor(first / DECISION_S + 1e-9) + 1)
            if after >= latest - 1e-9:
                yield (
                    f"it waits for {name} above {first:g} s and below {latest:g} s, and no decision falls "
                    f"between: there is one every {DECISION_S:g} s"
                )


def _out_of_reach(scenario: Scenario) -> Iterator[str]:
    (network, movements), ego = _roads(scenario), scenario.ego
    car, end = network.vehicle, scenario.episode.timeout.support[1]
    if car.v_max * end > 1.2 * network.paths.length.max():  # saves building the routes, which takes a second
        return
    routes = [network.route(m.origin, m.destination) for m in movements]
    beyond = likely(ego.destination)[0]
    inside = min(min(r.exit_s + beyond, r.length - car.length) - r.stop_line_s for r in routes)
    way = likely(ego.distance)[0] + 0.5 * car.length + inside
    if way > car.v_max * end:
        yield (
            f"the ego can never arrive: its way is {way:.0f} m at least, it drives at most {car.v_max:g} "
            f"m/s, and episodes end at {end:g} s (episode.timeout)"
        )


def _too_sharp(scenario: Scenario) -> Iterator[str]:
    if scenario.ego.may_cross_centre:
        return
    network, movements = _roads(scenario)
    for m in movements:
        if abs(m.angle) > SHARP and (said := against_lane(network, network.route(m.origin, m.destination))):
            yield said


def _nowhere(scenario: Scenario) -> Iterator[str]:
    network, traffic = load_network(scenario.network, scenario.junction), scenario.traffic
    refused = frozenset.intersection(*(network.refused[m.origin, m.destination] for m in network.onward))
    for kind, known in VEHICLE_TYPES.items():
        if known.vclass in refused and traffic.density.support[1] and getattr(traffic.mix, kind).support[1]:
            yield f"no {kind} of traffic.mix can appear: every way through the junction refuses its kind"


def _beyond(scenario: Scenario) -> Iterator[str]:
    """What stands in the ego's exit, or crosses it, where the episode has ended."""
    end = likely(scenario.ego.destination)[1]
    for number, event in enumerate(scenario.events, start=1):
        if event.kind not in IN_THE_WAY:
            continue
        places = {f"{key}.{k}": placed for (key, k), placed in standing_parts(event).items()}
        for key, placed in (places or {"": event}).items():
            names = possible(getattr(placed, "lane", None) or getattr(placed, "arm", ""))
            in_exit = all(name.startswith("ego_out") for name in names)
            if in_exit and (at := likely(placed.at)[0]) > end + EgoVehicle().length:
                yield (
                    f"event {numbered(number, event)}: the ego never comes to {key or 'it'}, {at:g} m "
                    f"along its exit, since it arrives {end:g} m along it (ego.destination)"
                )


def _unpaused(scenario: Scenario) -> Iterator[str]:
    """A pause that begins where those who cross have arrived."""
    network, movements = _roads(scenario)
    of_ego = {EGO_IN: {m.origin for m in movements}, EGO_OUT: {m.destination for m in movements}}
    for number, event in enumerate(scenario.events, start=1):
        if not isinstance(event, PedestrianCrossing | VehicleCrossing) or event.pause is None:
            continue
        after, at = event.pause.after.support[0], likely(event.at)[0]
        arms = {arm for name in possible(event.arm) for arm in of_ego.get(name, {name})}
        way = max(float(np.hypot(*np.diff(across_arm(network, None, arm, at), axis=0)[0])) for arm in arms)
        if isinstance(event, VehicleCrossing):
            size = event.size
            length = size[0].support[1] if size else max(size_of(kind)[0] for kind in possible(event.type))
            way += 0.5 * length + beyond_way(length)
        if after >= way:
            yield (
                f"event {numbered(number, event)}: its pause begins after {after:g} m (pause.after), "
                f"and those who cross have arrived after {way:.1f} m"
            )


_FINDERS = (
    _in_vain, _nobody, _never_comes, _too_fast, _out_of_reach, _nowhere, _beyond, _unpaused, _unused,
    _too_sharp,
)  # fmt: skip


def _where(swept: dict[str, Scalar]) -> str:
    """`with traffic.density=10: `, or nothing where there is nothing to say."""
    values = ", ".join(f"{key}={value_text(value)}" for key, value in swept.items())
    return f"with {values}: " if values else ""


def tried_points(scenario: Scenario) -> list[dict[str, Scalar]]:
    """The points of a sweep that `try_out` sets up: all, or `TRIED` at most of a larger sweep (`spread`)."""
    keys, values = list(scenario.sweep), list(scenario.sweep.values())
    return [
        {key: values[k][i] for k, (key, i) in enumerate(zip(keys, point, strict=True))}
        for point in spread([len(known) for known in values], TRIED)
    ]
