"""What a picture says in words: who drives where, how the ego moves, how it is corrected, what happens."""

from __future__ import annotations

import math
from collections import Counter
from typing import TYPE_CHECKING, Any

from rudc.drawing.view import Driving, ShownEvent, View
from rudc.scenario.base import FileModel
from rudc.scenario.distributions import Distribution
from rudc.scenario.drawable import Drawable
from rudc.scenario.units import unit_of
from rudc.world.events.account import told
from rudc.world.scene import Kind, Scene

if TYPE_CHECKING:
    from rudc.scenario.events import Event

GAP = "      "
"""between the parts of a line"""
EVENTS_A_LINE = 2
EVENT_LINES = 8
"""lines of events at most: below them there is the road"""
UNITS = {
    "simulation_time": "s",
    "traveled_distance": "m",
    "relative_distance": "m",
    "time_headway": "s",
    "time_to_collision": "s",
    "reach_position": "m",
    "speed": "m/s",
    "stand_still": "s",
    "ego_distance_to_junction": "m",
    "ego_distance_to_place": "m",
    "event_state": "s",
}
"""units of the numbers of conditions of `when`"""
WHEN = {
    "simulation_time": "the time is",
    "traveled_distance": "the ego has driven",
    "relative_distance": "the ego's distance to a vehicle is",
    "time_headway": "the ego's headway is",
    "time_to_collision": "the ego's time to collision is",
    "reach_position": "the ego reaches",
    "speed": "the ego's speed is",
    "stand_still": "the ego has stood for",
    "ego_distance_to_junction": "the ego's distance to its stop line is",
    "ego_distance_to_place": "the ego's distance along its path to",
    "event_state": "the time since",
}
"""conditions of `when` in words, where their names do not say enough"""
OTHERS = {"speed": "the speed of a vehicle ({}) is", "reach_position": "a vehicle ({}) reaches"}
"""the same of conditions that may be about another vehicle"""
SENSED = frozenset({"sensor_noise", "sensor_dropout"})
"""kinds of events that show in how the ego sees others"""
REMARKS = {
    "nominal": "none needed",
    "solved": "",
    "relaxed": "no action keeps all constraints",
    "braking": "full braking, nothing else was found",
    "last_resort": "full braking, or there would be no way out",
    "onwards": "goes on at once, since it would be hit if it stopped here",
    "unrolled": "until the expected cost is within its limit",
    "recovery": "the recovery policy drives",
    "projected": "the nearest action whose expected cost is within its limit",
}
"""what the statuses of corrections mean"""


def title(view: View, driving: Driving) -> str:
    """Scenario, agent and seed."""
    seed = "" if view.seed is None else f"seed {view.seed}"
    return GAP.join(part for part in (view.scenario, driving.agent, seed) if part)


def state_line(scene: Scene, driving: Driving) -> str:
    """Time, and how the ego moves; sigma if the driver states one."""
    ego = scene.ego
    parts = [
        f"time {scene.time_s:.1f} s",
        f"speed {ego.v:.1f} m/s",
        f"accel. {_unsigned_zero(ego.acceleration, 1)} m/s2",
        f"steering {_unsigned_zero(math.degrees(ego.steering), 1)} deg",
    ]
    if math.isfinite(driving.sigma):
        parts.append(f"sigma {driving.sigma:.2f}")
    return GAP.join(parts)


def correction_line(view: View, driving: Driving) -> str:
    """What a correction such as the safety filter does, and because of whom; empty if nobody drives."""
    if not driving.status and not driving.active:
        return "no correction" if driving.agent else ""
    a, steering = driving.correction[0], math.degrees(driving.correction[1])
    parts = [f"{v:+.1f} {unit}" for v, unit in ((a, "m/s2"), (steering, "deg")) if abs(v) >= 0.05]
    because, remark = _named(view, driving.active), REMARKS.get(driving.status, driving.status)
    done = ", ".join(parts) + (f" because of {because}" if because else "")
    return "correction: " + "; ".join(part for part in (done.strip(), remark) if part)


def events_lines(events: tuple[ShownEvent, ...]) -> list[str]:
    """Each event's number, its name or else its kind, and since when; EVENTS_A_LINE on a line. Of more than
    EVENT_LINES hold, those that are over are left out first, and then the last; how many are is said.
    """
    room = EVENTS_A_LINE * EVENT_LINES
    named = sorted(events, key=lambda event: event.is_over)[: room if len(events) <= room else room - 1]
    each = [
        f"({event.number}) {event.event.name or _words(event.event.kind)}{_since(event)}"
        for event in sorted(named, key=lambda event: event.number)
    ]
    if len(named) < len(events):
        each.append(f"and {len(events) - len(named)} more")
    return [GAP.join(each[i : i + EVENTS_A_LINE]) for i in range(0, len(each), EVENTS_A_LINE)]


def _called(event: Event) -> str:
    """An event's kind; after its name, if it has one."""
    return f"{event.name}, {_words(event.kind)}" if event.name else _words(event.kind)


def _since(event: ShownEvent) -> str:
    if event.begun_s is None:
        return ": waits"
    if event.is_over:
        return ": over"
    since = f": since {event.begun_s:.1f} s" if event.begun_s > 0 else ""
    return f"{since}, unseen" if event.bodies and event.visible_s is None else since


def _named(view: View, active: tuple[str, ...]) -> str:
    """Constraints in words: a car (2), 2 cars, left edge."""
    scene, numbers = view.truth, view.numbers
    kinds = {name: Kind(int(kind)).name.lower() for name, kind in zip(scene.ids, scene.kind, strict=True)}
    named: Counter[str] = Counter()
    for name in active:
        kind, _, rest = name.partition(":")
        if kind == "veh":
            number = f" ({numbers[rest]})" if rest in numbers else ""
            named[kinds.get(rest, "vehicle") + number] += 1
        elif kind == "road":
            named[f"{rest.partition(':')[0]} road edge"] = 1
        else:
            named[name] = 1
    return ", ".join(f"{n} x {what}" if n > 1 else what for what, n in named.items())


def _unsigned_zero(value: float, digits: int) -> str:
    """With its sign, but no -0.0."""
    return f"{round(value, digits) + 0.0:+.{digits}f}"


_ONE = {"vehicles": "vehicle", "objects": "object", "boxes": "box"}
"""what lists of events hold -> one of it"""


def describe(event: Event) -> str:
    """An event in a line: what it is and its numbers; its `when` is left out."""
    return ", ".join([_called(event), *_numbers(event, without=("when", "kind", "name"))])


def _numbers(model: FileModel, without: tuple[str, ...] = ()) -> list[str]:
    """What each key of a part of a file says, with its unit."""
    data: dict[str, Any] = model.model_dump(mode="json", by_alias=True, exclude_none=True)
    fields = {field.alias or name: (name, field) for name, field in type(model).model_fields.items()}
    parts = []
    for key, value in data.items():
        if key in without:
            continue
        name, field = fields[key]
        part = getattr(model, name)
        if isinstance(value, bool):
            parts.append(_words(key) if value else f"not {_words(key)}")
        elif isinstance(value, list) and part and all(isinstance(one, Distribution) for one in part):
            unit = unit_of(field)
            parts.append(f"{_words(key)} {' x '.join(map(_value, value))}{unit and f' {unit}'}")
        elif isinstance(value, list):
            parts.append(f"{len(value)} {_ONE.get(key, key) if len(value) == 1 else key}")
        elif isinstance(part, FileModel) and not isinstance(part, Distribution | Drawable):
            parts.append(f"{_words(key)} {' '.join(_numbers(part))}")
        else:
            parts.append(f"{_words(key)} {_value(value, unit_of(field))}")
    return parts


def conditions(event: Event) -> str:
    """An event's conditions in words; empty if it has none."""
    return "" if event.when is None else told(event.when, _condition)


def _condition(name: str, condition: FileModel) -> str:
    """One condition in words: the ego's distance to its stop line below 20 m."""
    bounds = condition.model_dump(mode="json", by_alias=True, exclude_none=True, exclude={"vehicle"})
    towards, place = getattr(condition, "vehicle", None), bounds.pop("position", None)
    words = WHEN.get(name, _words(name))
    if towards is not None and name in OTHERS:
        words, towards = OTHERS[name].format(towards), None
    if name == "relative_distance" and "event" in bounds:
        words, towards = f"the ego's distance to event {_value(bounds.pop('event') + 1)} is", None
    if name == "event_state":
        state = "began" if bounds.pop("state") == "begun" else "was over"
        words += f" ({_value(bounds.pop('event') + 1)}) {state} is"
    if towards is not None:
        words = f"{words.removesuffix(' is')} ({towards}) is"
    if place is not None:
        words += f" [{', '.join(_value(v) for v in place)}]"
    if name == "ego_distance_to_place":
        on_lane = f" {bounds.pop('lane')} at {_value(bounds.pop('at'), 'm')}" if "lane" in bounds else ""
        words += f"{on_lane} is"
    return f"{words} {_value(bounds, UNITS[name])}"


def probability(event: Event) -> str:
    """How probable an event of a scenario's file is, in words."""
    chance = None if event.when is None else event.when.probability
    return "1" if chance is None else _value(chance.model_dump(mode="json"))


def remark(event: ShownEvent) -> str:
    """Since when an event is in effect, if not from the start, or why it is not, or why it is not in the
    picture; empty where there is nothing to say.
    """
    if event.is_over:
        return f"begun at {event.begun_s:.1f} s, and over"
    if not event.waits:
        drawn = event.bodies or event.places or event.event.kind in SENSED
        parts = [f"since {event.begun_s:.1f} s"] if event.begun_s else []
        return ", ".join(parts if drawn else [*parts, "nothing to draw"])
    chosen = getattr(event.event, "vehicle", None)
    if event.no_room:
        return "not drawn: waits for room on the road"
    if event.refused:
        return f"not drawn: waits for {f'a vehicle ({chosen})' if chosen else 'something'} to act on"
    until = conditions(event.event)
    parts = [f"not drawn: waits until {until}" if until else "not drawn: begins with the first decision"]
    if chosen is not None:
        parts.append(f"its vehicle ({chosen}) is chosen then")
    elif event.places:
        parts.append("its place is marked")
    return ", ".join(parts)


def _words(key: str) -> str:
    return key.replace("_", " ")


def _value(value: Any, unit: str = "") -> str:
    if isinstance(value, dict) and "choice" in value:
        return _choice(**value["choice"], unit=unit)
    if isinstance(value, dict):
        return " ".join(f"{_words(inner)} {_value(v, unit)}" for inner, v in value.items())
    if isinstance(value, bool) or not isinstance(value, int | float):
        return str(value)
    digits = f"{value:.0f}" if abs(value) >= 999.5 else f"{value:.3g}"
    return f"{digits} {unit}".rstrip()


def _choice(values: list[Any], weights: list[float] | None = None, *, unit: str) -> str:
    """What may be drawn: `left or right`, `3 m/s (75 %) or 4 m/s (25 %)`."""
    if weights is None:
        return " or ".join(_value(value, unit) for value in values)
    each = [(_value(v, unit), w / sum(weights)) for v, w in zip(values, weights, strict=True) if w > 0.0]
    return " or ".join(f"{text} ({100.0 * share:.0f} %)" if share < 1.0 else text for text, share in each)
