"""`pause` of events whose things move across an arm."""

from __future__ import annotations

from typing import Literal

from rudc.scenario.base import FileModel
from rudc.scenario.events.event import Duration
from rudc.scenario.events.stage import Halt
from rudc.scenario.triggers import Metre


class Pause(FileModel, frozen=True):
    """They stop on their way, all at once, and go on later: who hesitates, or has dropped something."""

    after: Metre
    """m from where the first starts, 1.5 m beside the road, to where it stops, or begins to brake"""
    duration: Duration
    """s that they stand"""


class WalkersPause(Pause, frozen=True):
    """As `Pause`, of people, who may think better of it."""

    then: Literal["back"] | None = None
    """`back`: they then go back to where they came from; by default on, to the other side"""


def halt_of(pause: Pause | None) -> Halt | None:
    """Where those stop and for how long, once both are drawn; None where there is no pause."""
    if pause is None:
        return None
    turns_back = isinstance(pause, WalkersPause) and pause.then == "back"
    return Halt(float(pause.after), float(pause.duration), turns_back)
