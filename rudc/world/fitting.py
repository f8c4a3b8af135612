"""Finds what in a scenario does not fit its network, before anything is run.

rudc/scenario checks a scenario file by itself; but only the network knows whether the file's arms, lanes and
turns exist. Where the ego's route is random, every route that may be drawn is checked.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from rudc.errors import JunctionError, NetworkError
from rudc.network.network import Network, Route, load_network
from rudc.network.road import Arm, Movement
from rudc.network.route_builder import start_row
from rudc.network.stretches import EGO_ARMS, EGO_LANES, stretch_by_id
from rudc.scenario.base import FileModel, parts_of
from rudc.scenario.choices import WordChoice, possible, possible_together
from rudc.scenario.distributions import Distribution, Normal
from rudc.scenario.dotted import Path
from rudc.scenario.drawable import Drawable
from rudc.scenario.fit import Parts
from rudc.scenario.problems import Problem
from rudc.scenario.sections import Ego, Traffic, may_be_zero
from rudc.scenario.selectors import ByArm
from rudc.world.demand import Demand, no_way
from rudc.world.events.selection import by_arm
from rudc.world.obstacles import in_the_way
from rudc.world.spawn import movements_of

TOLERANCE_M = 0.05
"""m by which the ego's path may be shorter than its lanes"""
SURE = 5.0
"""standard deviations of a normal distribution beyond which its values are taken not to be drawn"""
ASTRAY_M = 50.0
"""m from the nearest road beyond which a position is taken for a mistake"""


def misfits(parts: Parts) -> list[Problem]:
    """A problem for each thing that does not fit; empty if everything fits."""
    key = "network"
    try:
        network = load_network(parts.network, parts.junction)
        key = "network" if parts.junction is None else "junction"
        network.refuse_lights()
    except NetworkError as error:
        return [Problem(("junction" if isinstance(error, JunctionError) else key,), str(error))]
    found = _no_arms(network, parts.arms)
    movements, wrong = ([], []) if found else _movements(network, parts.ego)
    found += wrong
    found += _no_way(network, parts.traffic)
    for i, event in parts.events.items():
        for path, part in _placed(event, ("events", i)):
            found += _of_another_type(path, part) or _misplaced(network, movements, path, part)
        for path, who in _by_arm(event, ("events", i)):
            found += _nobody_by(network, path, who)
    if parts.ego is not None:
        found += in_the_way(network, movements, parts.ego, parts.events)
    return found


def _no_arms(network: Network, arms: Mapping[str, Any]) -> list[Problem]:
    """The problems with the arms or edges that the ego's route names."""
    problems = dict[Problem, None]()
    for key, word in arms.items():
        for name in possible(word):
            try:
                if (key, name) != ("from", "random"):
                    network.arm(name)
            except NetworkError as error:
                problems[Problem(("ego", "route", key), str(error))] = None
    return [*problems]


def _movements(network: Network, ego: Ego | None) -> tuple[list[Movement], list[Problem]]:
    """Every movement that the ego may be given, and the problems with its route and its start."""
    if ego is None:
        return [], []
    problems, movements = dict[Problem, None](), dict[Movement, None]()
    for fixed in ego.each():
        try:
            movements |= dict.fromkeys(movements_of(network, fixed.plan(np.random.default_rng(0))))
        except NetworkError as error:
            problems[Problem(("ego", "route"), str(error))] = None
    if problems:
        return [], [*problems]
    return [*movements], _too_far(network, [*movements], ego)


def _no_way(network: Network, traffic: Traffic | None) -> list[Problem]:
    """The problems with the arms by which traffic comes, and with its turns."""
    if traffic is None or (traffic.origins is None and traffic.turns is None):
        return []
    arms, turns = traffic.origins, traffic.turns and traffic.turns.shares
    problems, names = [], dict[str, str]()
    for name, share in (arms or {}).items():
        try:
            first = names.setdefault(network.arm(name).name, name)
            if first != name:
                text = f"is the arm of {first!r}, too: name an arm once"
                problems.append(Problem(("traffic", "from", name), text, on_key=True))
            elif share.support[1]:
                Demand(network, {name: 1.0}, _named(turns))
        except NetworkError as error:
            problems.append(Problem(("traffic", "from", name), str(error), on_key=True))
    at = "traffic", "from" if turns is None else "turns"
    for sure, when in ((False, ""), (True, " in an episode that draws 0 for each share that may be 0")):
        try:
            if not problems:
                Demand(network, _named(arms, sure=sure), _named(turns, sure=sure))
        except NetworkError as error:
            problems.append(Problem(at, f"{error}{when}"))
    return problems


def _named(shares: Mapping[str, Distribution] | None, *, sure: bool = False) -> dict[str, float] | None:
    """Those whose share may be above 0 or, with `sure`, always is; None for None."""
    if shares is None:
        return None
    return {
        name: 1.0 for name, share in shares.items() if share.support[1] and not (sure and may_be_zero(share))
    }


def _too_far(network: Network, movements: list[Movement], ego: Ego) -> list[Problem]:
    """The problem of an arm that is too short for the ego's start, if there is one."""
    ways = {m: float(network.paths.stop_s[start_row(network, m)]) for m in network.onward}
    way, arm, to = min((ways[m], m.origin, m.destination) for m in movements)
    room, far = way - network.vehicle.length, likely(ego.distance)[1]
    if far <= room + TOLERANCE_M:
        return []
    fit = {m: ways[m] - network.vehicle.length + TOLERANCE_M >= far for m in ways}
    among = movements if any(fit[m] for m in movements) else network.onward
    short = {m.origin for m in among if not fit[m]}
    long = list(dict.fromkeys(m.origin for m in among if m.origin not in short))
    choice = long[0] if len(long) == 1 else f"{{choice: [{', '.join(long)}]}}"
    text = (
        f"{far:g} m do not fit on arm {arm!r} of network {network.name}, which has "
        f"{f'{room:.1f} m' if room > 0.0 else 'no room'} for it: the "
        f"ego's path to {to!r} begins {way:.1f} m before the stop line, and the car takes the rest"
        f"{f'; there is room with `route: {{from: {choice}}}`' if long else ''}"
    )
    return [Problem(("ego", "distance"), text)]


def likely(value: Distribution | float) -> tuple[float, float]:
    """Least and greatest value that is drawn; for a normal distribution, within SURE standard deviations. An
    event of a user's may have a plain number.
    """
    if not isinstance(value, Distribution):
        return float(value), float(value)
    low, high = value.support
    if isinstance(value, Normal):
        mean, spread = value.normal.mean, SURE * value.normal.std
        return max(low, mean - spread), min(high, mean + spread)
    return low, high


def _placed(value: Any, path: Path) -> Iterator[tuple[Path, FileModel]]:
    """Every part of an event that names a place, a lane or an arm, and its own place in the file."""
    if isinstance(value, Drawable):
        return
    if isinstance(value, FileModel):
        lane_or_arm = getattr(value, "lane", None) or getattr(value, "arm", None)
        if lane_or_arm is not None or isinstance(getattr(value, "position", None), tuple):
            yield path, value
    for key, part in parts_of(value):
        yield from _placed(part, (*path, key))


def _by_arm(value: Any, path: Path) -> Iterator[tuple[Path, ByArm]]:
    """Every selector of an event, and of its conditions, that names an arm, and its own place in the file."""
    if isinstance(value, ByArm):
        yield path, value
        return
    for key, part in parts_of(value):
        yield from _by_arm(part, (*path, key))


def _nobody_by(network: Network, path: Path, who: ByArm) -> list[Problem]:
    """The problems with the arm of a selector, and with its turn: with each that may be drawn."""
    problems = dict[Problem, None]()
    for name, turn in possible_together(who.origin, who.turn):
        try:
            if not by_arm(network, who.model_copy(update={"origin": name, "turn": turn})).any():
                key = "turn" if turn and network.arm(name).in_lanes else "from"
                problems[Problem((*path, key), no_way(network, [name], turn and [turn]))] = None
        except NetworkError as error:
            problems[Problem((*path, "from"), str(error))] = None
    return [*problems]


def _of_another_type(path: Path, part: Any) -> list[Problem]:
    """The problem of the first key that by its name is a place's, but whose value cannot be, if any."""
    for key, fits, meant in (
        ("position", _is_point, "[east, north] in m"),
        ("lane", _is_name, "the name of a lane"),
        ("arm", _is_name, "the name of an arm"),
        ("at", _is_number, "a number of m"),
        ("length", _is_number, "a number of m"),
    ):
        value = getattr(part, key, None)
        if value is not None and not fits(value):
            other = "if this key of your event means something else, give it another name"
            return [Problem((*path, key), f"{value!r} is not {meant}; {other}")]
    return []


def _is_point(value: Any) -> bool:
    """Whether a value is a point, or nothing that is read as one, such as the number of `sensor_noise`."""
    return not isinstance(value, tuple) or (len(value) == 2 and all(map(_is_number, value)))


def _is_name(value: Any) -> bool:
    return isinstance(value, str | WordChoice)


def _is_number(value: Any) -> bool:
    return isinstance(value, Distribution | float | int)


def _misplaced(network: Network, movements: list[Movement], path: Path, part: Any) -> list[Problem]:
    """The problems with a part's place, or with its lane or arm: with each that may be drawn."""
    if isinstance(getattr(part, "position", None), tuple):
        return _astray(network, (*path, "position"), part.position)
    key = "lane" if getattr(part, "lane", None) is not None else "arm"
    return [
        problem
        for name in possible(getattr(part, key))
        for problem in _misplaced_by_name(network, movements, path, part, key, name)
    ]


def _misplaced_by_name(
    network: Network, movements: list[Movement], path: Path, part: Any, key: str, name: str
) -> list[Problem]:
    """The problems with a part on one lane or arm. For one relative to the ego: those on the first route on
    which there are any.
    """
    if name not in (*EGO_LANES, *EGO_ARMS):
        return _misplaced_on(network, None, path, part, key, name)
    routes = (network.route(m.origin, m.destination) for m in movements)
    wrong = (_misplaced_on(network, route, path, part, key, name) for route in routes)
    return next(filter(None, wrong), [])


def _astray(network: Network, path: Path, position: tuple[Distribution, Distribution]) -> list[Problem]:
    """The problem of a position that is far from every road, wherever in its range it is drawn."""
    (west, east), (south, north) = map(likely, position)
    middle = 0.5 * (west + east), 0.5 * (south + north)
    places = network.center + np.array([middle, *itertools.product((west, east), (south, north))])
    away = np.linalg.norm(places - network.surface.project(places), axis=1)
    if away.min() <= ASTRAY_M:
        return []
    text = (
        f"[{middle[0]:g}, {middle[1]:g}] lies {away[0]:.0f} m from the nearest road of network "
        f"{network.name}; positions are m east and north of the junction's centre"
    )
    return [Problem(path, text)]


def _misplaced_on(
    network: Network, route: Route | None, path: Path, part: Any, key: str, name: str
) -> list[Problem]:
    at, length = getattr(part, "at", None), getattr(part, "length", None)
    try:
        if key == "lane":
            stretches = [network.stretch(name, route)]
        else:
            arm = network.arm(name, route)
            stretches = [stretch_by_id(network, lane_id) for lane_id in _sides(arm)]
    except NetworkError as error:
        own = f"; the ego's are {' and '.join(EGO_ARMS)}" if key == "arm" else ""
        return [Problem((*path, key), f"{error}{own}")]
    reach = min(stretch.reach for stretch in stretches)
    far = 0.0 if at is None else likely(at)[1]
    # A thing on a lane of an arm may reach beyond the arm's outer end, but not with its middle or in a bend.
    end = 0.0 if length is None else likely(length)[1]
    half = not stretches[0].inside and stretches[0].pieces(far, far + end) == 1
    last = far + (0.5 * end if half else end)
    if last <= reach:
        return []
    what = f"{far if far > reach else last:g} m"
    if half and end and far <= reach:
        what = f"the middle of {far:g} to {far + end:g} m, {last:g} m,"
    text = f"{what} lies beyond {name!r} of network {network.name}, which has {reach:.1f} m"
    return [Problem((*path, "at" if far > reach else "length"), text)]


def _sides(arm: Arm) -> tuple[str, ...]:
    """SUMO's ids of the lanes at an arm's two sides, on which places of ways across the arm are counted."""
    if arm.in_lanes and arm.out_lanes:
        return arm.in_lanes[0], arm.out_lanes[0]
    lanes = arm.in_lanes or arm.out_lanes
    return lanes[0], lanes[-1]
