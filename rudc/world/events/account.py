"""Describes in words when each event of an episode began, or why it has not begun."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from rudc.scenario.events.event import numbered

if TYPE_CHECKING:
    from rudc.scenario.base import FileModel
    from rudc.scenario.plan import EpisodePlan
    from rudc.scenario.triggers import Trigger
    from rudc.world.events.script import Happening


def event_lines(plan: EpisodePlan, happenings: Sequence[Happening]) -> list[str]:
    """`2 (events.1) hard_brake: not there, ...`, a line for each event of the scenario's file."""
    pairs = zip(plan.event_numbers, happenings, strict=True)
    lines = {number: _line(number, happening) for number, happening in pairs}
    for number, event in enumerate(plan.scripted, start=1):
        if number not in lines:
            lines[number] = f"{numbered(number, event)}: not in this episode, its probability decided so"
    return [lines[number] for number in sorted(lines)]


def _line(number: int, happening: Happening) -> str:
    head = numbered(number, happening.event)
    if happening.begun_s is None:
        return f"{head}: not there, it waits for {_awaited(happening)}"
    since = f"began at {happening.begun_s:.1f} s" if happening.begun_s > 0 else "from the start"
    over = ", over" if happening.is_over else ""
    met = "reached" if happening.underfoot else "seen"
    if happening.visible_s is None:
        return f"{head}: {since}{over}, not {met} by the ego"
    seen = "" if happening.felt else f", {met} by the ego at {happening.visible_s:.1f} s"
    return f"{head}: {since}{over}{seen}"


def _awaited(happening: Happening) -> str:
    if happening.no_room:
        return "room on the road"
    event = happening.event
    when = None if happening.refused else event.when
    parts = [] if when is None else [told(when, lambda name, condition: f"{name} {_words(condition)}")]
    who = getattr(event, "vehicle", None)
    if who is not None:
        parts.append(f"a vehicle to act on ({who})")
    return " and ".join(parts) or ("something to act on" if happening.refused else "the first decision")


def told(when: Trigger, say: Callable[[str, FileModel], str]) -> str:
    """Conditions in words, `say(name, condition)` for each: `a and b`, `a and (b or c and d)`."""
    own, *groups = ([say(*named) for named in group.conditions.items()] for group in when.groups.values())
    either = [" and ".join(group) for group in groups]
    return " and ".join([*own, *([f"({' or '.join(either)})"] if len(either) > 1 else either)])


def _words(condition: FileModel) -> str:
    data = condition.model_dump(mode="json", exclude_none=True)
    if getattr(condition, "event", None) is not None:
        data.pop("vehicle", None)  # the event stands in its place
    elif (who := getattr(condition, "vehicle", None)) is not None:
        data["vehicle"] = str(who)
    data = {key: data[key] for key in ("event", "state") if key in data} | data  # first which, then how long
    return " ".join(
        f"{key} {value:.3g}" if isinstance(value, float) else f"{key} {value}" for key, value in data.items()
    )
