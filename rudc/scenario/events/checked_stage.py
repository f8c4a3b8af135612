"""The stage as an event of one's own is given it: it refuses numbers that no scenario file could give.

What a file says is checked as it is read; what an effect computes is not. A road without friction would keep
SUMO busy for ever, and a number that is not finite would go into results.
"""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable
from typing import Any, cast

import numpy as np

from rudc.scenario.events.stage import Stage

LEAST, MOST = 0.03, 1.2
"""least and largest coefficient of friction that a road may have"""
FINITE = -1e6, 1e6
"""of numbers that have no other bounds"""
LIMITS = {
    "friction": (LEAST, MOST),
    "deceleration": (0.0, 1e3),
    "least": (0.0, 40.0),
    "speed": (0.0, 40.0),
    "factor": (0.01, 4.0),
    "density": (0.0, 150.0),
    "length": (0.0, 500.0),
    "position": (0.0, 20.0),
    "acceleration": (0.0, 5.0),
    "probability": (0.0, 1.0),
    "range_m": (0.0, math.inf),
    "delay_s": (0.0, 2.0),
    "lag_s": (0.0, 3.0),
}
"""argument of a method of Stage -> least and largest value"""


class CheckedStage:
    """A stage with the methods of another one. They raise ValueError for numbers beyond LIMITS, or FINITE."""

    def __init__(self, stage: Stage) -> None:
        self._stage = stage

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(name)
        part = getattr(self._stage, name)
        return _checking(name, part) if callable(part) else part


def checked(stage: Stage) -> Stage:
    """The same stage, which checks the numbers that it is given."""
    return cast(Stage, CheckedStage(stage))


def _checking(name: str, call: Callable[..., Any]) -> Callable[..., Any]:
    def checking(*args: Any, **named: Any) -> Any:
        given = inspect.signature(call).bind(*args, **named).arguments
        for key, value in given.items():
            low, high = LIMITS.get(key, FINITE)
            numbers = np.array(_numbers_in(value))
            if not ((numbers >= low) & (numbers <= high)).all():
                raise ValueError(f"{name}({key}={value}): expected {_between(low, high)}")
        return call(*args, **named)

    return checking


def _numbers_in(value: Any) -> list[float]:
    """A number, or those of a list, tuple or array of numbers."""
    if isinstance(value, np.ndarray | list | tuple):
        return [number for part in value for number in _numbers_in(part)]
    return [float(value)] if isinstance(value, int | float | np.number) else []


def _between(low: float, high: float) -> str:
    if (low, high) == FINITE:
        return "finite numbers"
    return f"{low:g} to {high:g}" if math.isfinite(high) else f"at least {low:g}"
