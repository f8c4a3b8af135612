"""Describes in words when each event of an episode began, or why it has not begun."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rudc.scenario.plan import EpisodePlan
    from rudc.world.events.script import Happening


def event_lines(plan: EpisodePlan, happenings: Sequence[Happening]) -> list[str]:
    """`2 (events.1) hard_brake: not there, ...`, a line for each event of the scenario's file."""
    pairs = zip(plan.event_numbers, happenings, strict=True)
    lines = {number: _line(number, happening) for number, happening in pairs}
    for number, kind in enumerate(plan.scripted, start=1):
        if number not in lines:
            lines[number] = f"{numbered(number, kind)}: not in this episode, its probability decided so"
    return [lines[number] for number in sorted(lines)]


def numbered(number: int, kind: str) -> str:
    """`2 (events.1) hard_brake`: an event's number as pictures show it, its key in the file, and its kind."""
    return f"{number} (events.{number - 1}) {kind}"


def _line(number: int, happening: Happening) -> str:
    head = numbered(number, happening.event.kind)
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
    conditions = event.when.conditions if event.when and not happening.refused else {}
    parts = [f"{name} {_words(condition)}" for name, condition in conditions.items()]
    who = getattr(event, "vehicle", None)
    if who is not None:
        parts.append(f"a vehicle to act on ({who})")
    return " and ".join(parts) or ("something to act on" if happening.refused else "the first decision")


def _words(condition: Any) -> str:
    data = condition.model_dump(mode="json", exclude_none=True)
    data = {key: data[key] for key in ("event", "state") if key in data} | data  # first which, then how long
    return " ".join(
        f"{key} {value:.3g}" if isinstance(value, float) else f"{key} {value}" for key, value in data.items()
    )
