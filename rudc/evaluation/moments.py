"""What in an episode is worth a look: the largest correction, the closest approach, events, the end.

Only what the correction itself changed counts here, not what was changed for course and grip; the column
`mean_correction` counts both.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from rudc.vehicle import EgoVehicle


class Step(NamedTuple):
    """What is known of a decision."""

    series: Mapping[str, float]
    """numbers by name, nan where there is none"""
    status: str
    """status of its correction; empty without one"""
    infeasible: bool
    """whether no action kept all constraints, as far as the correction could tell"""
    outcome: str
    """how the episode ended with it; empty while it goes on"""
    bounded: tuple[float, float] = (0.0, 0.0)
    """m/s2 and rad, the part of the change that is not the correction's: see `Decision.bounded`"""


def moments(
    steps: Sequence[Step], events: Sequence[Mapping[str, Any]], body: EgoVehicle,
    hit: str = "", fault: str = "",
) -> list[dict[str, Any]]:  # fmt: skip
    """`frame`, `kind` and `text` of each, in the order of time.

    `events`: with `number`, `kind`, `begun_s`, `visible_s` (s). `body`: whose limits scale corrections.
    `hit`, `fault`: what the ego collided with, and whose fault it was.
    """
    found = [*_of_events(steps, events)]
    frame, size = _extreme(steps, lambda s: _correction(s, body), max)
    if frame is not None and size > 0.01:
        text = f"largest correction: {_in_words(steps[frame])}"
        found.append({"frame": frame, "kind": "correction", "text": text})
    none = [k for k, step in enumerate(steps) if step.infeasible]
    if none:
        more = f" (first of {len(none)})" if len(none) > 1 else ""
        text = f"no action keeps all constraints{more}"
        found.append({"frame": none[0], "kind": "infeasible", "text": text})
    for name, kind, best, text in (
        ("gap_m", "gap", min, "closest approach: {:.2f} m"),
        ("least_h_m2", "h", min, "least h: {:.2f} m2"),
        ("sigma", "sigma", max, "largest sigma: {:.2f}"),
    ):
        frame, value = _extreme(steps, lambda s, name=name: s.series[name], best)
        if frame is not None:
            found.append({"frame": frame, "kind": kind, "text": text.format(value)})
    if steps and steps[-1].outcome:
        blamed = f", fault: {fault}" if fault else ""
        met = f" ({hit})" if hit else ""
        text = f"end: {steps[-1].outcome.replace('_', ' ')}{met}{blamed}"
        found.append({"frame": len(steps) - 1, "kind": "end", "text": text})
    return sorted(found, key=lambda moment: moment["frame"])


def _of_events(steps: Sequence[Step], events: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    found = []
    for event in events:
        name = f"event {event['number']}, {event['kind'].replace('_', ' ')}"
        begun, seen = (_frame_at(steps, event[key]) for key in ("begun_s", "visible_s"))
        first = "begins" if event["begun_s"] else "there from the start"
        met = "first reached by the ego" if event["patch"] else "first seen by the ego"
        for frame, what in ((begun, first), (seen if seen != begun else None, met)):
            if frame is not None:
                found.append({"frame": frame, "kind": "event", "text": f"{name}: {what}"})
    return found


def _frame_at(steps: Sequence[Step], time_s: float | None) -> int | None:
    """The first frame not before a time; None without one."""
    if time_s is None:
        return None
    return next((k for k, s in enumerate(steps) if s.series["time_s"] >= time_s - 1e-6), len(steps) - 1)


def _change(step: Step) -> tuple[float, float]:
    """m/s2 and rad, by which the correction changed an action, 0 without one; changes for course and grip
    left out.
    """
    if not step.status:
        return 0.0, 0.0
    names = "acceleration_mps2", "steering_rad"
    a, delta = (step.series[f"safe_{name}"] - step.series[f"nominal_{name}"] for name in names)
    return a - step.bounded[0], delta - step.bounded[1]


def _in_words(step: Step) -> str:
    """By how much the action was corrected; what would read as 0.0 is left out."""
    a, delta = _change(step)
    delta = math.degrees(delta)
    parts = [f"{v:+.1f} {unit}" for v, unit in ((a, "m/s2"), (delta, "deg")) if abs(v) >= 0.05]
    return ", ".join(parts) or "less than 0.05 m/s2 and 0.05 deg"


def _correction(step: Step, body: EgoVehicle) -> float:
    """Size of a correction, both parts scaled to [-1, 1]."""
    return body.scaled(*_change(step))


def _extreme(
    steps: Sequence[Step], value: Callable[[Step], float], best: Callable[..., int]
) -> tuple[int | None, float]:
    """The frame with the least or largest finite value, and that; None if there is none."""
    known = {k: value(step) for k, step in enumerate(steps) if math.isfinite(value(step))}
    if not known:
        return None, math.nan
    frame = best(known, key=lambda k: known[k])
    return frame, known[frame]
