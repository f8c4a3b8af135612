"""Whether a file fits what it names beyond itself: its network's arms, lanes and turns.

The check itself, a `Fit`, comes from a package that knows networks (`rudc.world.fitting.misfits`). It is made
for every combination of swept values that it could depend on, `ASKED` at most, and each problem is reported
once, at its place. Every part of the file that can be read by itself is checked, so that all problems of a
file are reported at once.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeVar

from pydantic import TypeAdapter, ValidationError
from pydantic_core import PydanticCustomError

from rudc.scenario.choices import Place
from rudc.scenario.distributions import shared_in
from rudc.scenario.dotted import DottedKeyError, Path, dotted, with_value
from rudc.scenario.drawable import sharing
from rudc.scenario.events import AnyEvent, Event
from rudc.scenario.fixed import Constant
from rudc.scenario.model import GRID_LIMIT
from rudc.scenario.networks import existing_network
from rudc.scenario.problems import Problem
from rudc.scenario.sections import Ego, Traffic
from rudc.scenario.spread import spread
from rudc.scenario.yaml_text import Report, Sheet

Model = TypeVar("Model")

_EVENT: TypeAdapter[Event] = TypeAdapter(AnyEvent)
_EGO: TypeAdapter[Ego] = TypeAdapter(Ego)
_TRAFFIC: TypeAdapter[Traffic] = TypeAdapter(Traffic)
_PLACE: TypeAdapter[Any] = TypeAdapter(Place)
_NETWORK = "four_way"
ASKED_ABOUT = ("network", "junction", "ego", "events", "traffic.from", "traffic.turns", "shared")
"""dotted keys that a fit can depend on"""
ASKED = 64
"""combinations of their swept values that are checked; the others may fail when a sweep comes to them"""


@dataclass(frozen=True)
class Parts:
    """What a file says of a place: its network, and what of the rest could be read."""

    network: str
    """name of a shipped network or path of a .net.xml"""
    junction: str | None = None
    ego: Ego | None = None
    """None where it cannot be read"""
    arms: Mapping[str, Any] = field(default_factory=dict)
    """`from` and `to` of the ego's route -> arm or edge, or a choice of several, of those that can be read"""
    traffic: Traffic | None = None
    """without what cannot be read; None where none of it can"""
    events: dict[int, Event] = field(default_factory=dict)
    """place in the file's list -> event, of those that can be read"""


Fit = Callable[[Parts], Sequence[Problem]]
"""says what of a scenario does not fit"""


def fit_reports(sheet: Sheet, data: dict[str, Any], fit: Fit) -> list[Report]:
    """What does not fit, each once: at its own place, or at the swept values that cause it."""
    base = {key: value for key, value in data.items() if key != "sweep"}
    axes = _axes(base, data.get("sweep"))
    points = spread([len(values) for values in axes.values()], ASKED)
    choices = [dict(zip(axes, point, strict=True)) for point in points]
    found: dict[Problem, list[dict[str, int]]] = {}
    paths: dict[str, Path] = {}
    for choice in choices:
        point = base
        try:
            for key, i in choice.items():
                point, paths[key] = with_value(point, key, axes[key][i])
        except DottedKeyError:  # one swept value leaves no place for another: `sweep_reports` says so
            continue
        for problem in dict.fromkeys(_misfits(point, fit)):
            found.setdefault(problem, []).append(choice)
    for problems in _by_path(found):
        # A problem at every point is reported once, even if its words differ from network to network.
        hit = [tuple(choice.values()) for problem in problems for choice in found[problem]]
        if len(problems) > 1 and len(hit) == len(set(hit)) == len(choices):
            found[problems[0]] += [choice for problem in problems[1:] for choice in found.pop(problem)]
    reports = [
        report
        for problem, where in found.items()
        for report in _placed(sheet, problem, where, choices, paths)
    ]
    return list(dict.fromkeys(reports))


def _misfits(point: dict[str, Any], fit: Fit) -> Iterator[Problem]:
    """What does not fit, for each combination of the values that shared numbers may have, ASKED at most: what
    one number says goes together. Parts that name a shared number that is wrong itself are left out.
    """
    known = {name: number for name, number in shared_in(point).items() if number is not None}
    values = {name: number.possible for name, number in known.items() if number.possible}
    for places in spread([len(of) for of in values.values()], ASKED):
        fixed = {name: Constant(value=of[i]) for (name, of), i in zip(values.items(), places, strict=True)}
        with sharing({**known, **fixed}):
            parts = readable(point)
        if parts is not None:
            yield from fit(parts)


def _by_path(problems: Iterable[Problem]) -> list[list[Problem]]:
    groups: dict[Path, list[Problem]] = {}
    for problem in problems:
        groups.setdefault(problem.path, []).append(problem)
    return list(groups.values())


def readable(data: dict[str, Any]) -> Parts | None:
    """The parts of a file's data that are as they should be; None without a network."""
    try:
        network = existing_network(data.get("network", _NETWORK))
    except (PydanticCustomError, TypeError):
        return None
    junction = data.get("junction")
    if junction is not None and not isinstance(junction, str | int):
        return None
    given = data.get("events")
    read = ((i, _read(_EVENT, item)) for i, item in enumerate(given if isinstance(given, list) else ()))
    events = {i: event for i, event in read if event is not None}
    ego = _read(_EGO, data.get("ego", {}))
    traffic = _read(_TRAFFIC, data.get("traffic", {}), wrong_too=True)
    arms = _arms(data.get("ego"))
    return Parts(network, None if junction is None else str(junction), ego, arms, traffic, events)


def _arms(ego: Any) -> dict[str, Any]:
    """Arms or edges that the ego's route names in a file, each by itself: other keys may be wrong."""
    route = ego.get("route") if isinstance(ego, dict) else None
    given = route if isinstance(route, dict) else {}
    if "origin" in given:
        given = {"from": given["origin"], **given}
    read = {key: _read(_PLACE, given[key]) for key in ("from", "to") if key in given}
    return {key: word for key, word in read.items() if word is not None}


def _read(adapter: TypeAdapter[Model], data: Any, *, wrong_too: bool = False) -> Model | None:
    """What a mapping says, without its unknown keys and, with `wrong_too`, without those whose values are
    wrong; None if anything else in it is wrong.
    """
    try:
        return adapter.validate_python(data)
    except ValidationError as error:
        if not isinstance(data, dict):
            return None
        found = error.errors()
    left_out = {detail["loc"][-1] for detail in found if detail["type"] == "extra_forbidden"}
    left_out |= {detail["loc"][0] for detail in found if wrong_too and detail["loc"]}
    try:
        return adapter.validate_python({key: value for key, value in data.items() if key not in left_out})
    except ValidationError:
        return None


def _axes(base: dict[str, Any], sweep: Any) -> dict[str, list[Any]]:
    """Swept key -> values, of those keys that a fit can depend on."""
    axes: dict[str, list[Any]] = {}
    combinations = 1
    for key, values in sweep.items() if isinstance(sweep, dict) else ():
        if not _is_asked_about(key) or not isinstance(values, list) or not values:
            continue
        try:
            with_value(base, key, values[0])
        except DottedKeyError:
            continue
        combinations *= len(values)
        if combinations <= GRID_LIMIT:
            axes[key] = values
    return axes


def _is_asked_about(key: str) -> bool:
    """Whether a fit can depend on a dotted key, on something in it, or on what it is a part of."""
    return any(f"{known}.".startswith(f"{key}.") or key.startswith(f"{known}.") for known in ASKED_ABOUT)


def _placed(
    sheet: Sheet,
    problem: Problem,
    where: list[dict[str, int]],
    choices: list[dict[str, int]],
    paths: dict[str, Path],
) -> list[Report]:
    """The problem at the swept values that are to blame for it, or at its own place if none is."""
    for key, path in paths.items():
        shared = min(len(path), len(problem.path))
        if path[:shared] == problem.path[:shared]:
            return [_at_value(sheet, problem, key, i) for i in sorted({choice[key] for choice in where})]
    if len(where) == len(choices):
        return [sheet.report(problem.path, problem.text, problem.on_key)]
    for key in paths:
        values = {choice[key] for choice in where}
        if len(where) == sum(choice[key] in values for choice in choices):
            return [_at_value(sheet, problem, key, i) for i in sorted(values)]
    key = next(iter(paths))
    return [_at_value(sheet, problem, key, where[0][key])]


def _at_value(sheet: Sheet, problem: Problem, key: str, index: int) -> Report:
    return sheet.report(("sweep", key, index), f"{dotted(problem.path)}: {problem.text}")
