"""Names of drivers and what they stand for: `sumo`, `follower`, `gap-acceptance`, and `NAME+FILTER`."""

from __future__ import annotations

import difflib
from collections.abc import Callable
from typing import Any

from rudc.agents.base import Agent
from rudc.agents.filtered import FILTERS, FilteredAgent, filter_settings
from rudc.agents.follower import Follower
from rudc.agents.gap_acceptance import GapAcceptance
from rudc.agents.sumo import SumoDriver
from rudc.errors import AgentError

_DRIVERS: dict[str, Callable[[], Agent]] = {
    "sumo": SumoDriver,
    "follower": Follower,
    "gap-acceptance": GapAcceptance,
}


def agent_names() -> tuple[str, ...]:
    """Every name that `make_agent` knows."""
    filtered = (f"{name}+{suffix}" for name in _DRIVERS if name != "sumo" for suffix in FILTERS)
    return (*_DRIVERS, *filtered)


def make_agent(name: str) -> Agent:
    """The driver of that name, new. Raises AgentError, with a suggestion, when there is none."""
    base, _, suffix = _checked(name).partition("+")
    driver = _DRIVERS[base]()
    return FilteredAgent(driver, suffix) if suffix else driver


def agent_summary(name: str) -> str:
    """What a driver does, in a sentence."""
    base, _, suffix = _checked(name).partition("+")
    summary = (_DRIVERS[base].__doc__ or "").partition("\n")[0]
    return f"{summary} {FILTERS[suffix]}" if suffix else summary


def agent_settings(name: str) -> dict[str, Any]:
    """Everything besides its name that decides what a driver does; of what can be written as JSON."""
    base, _, suffix = _checked(name).partition("+")
    return {"driver": base, **({"filter": filter_settings(suffix)} if suffix else {})}


def _checked(name: str) -> str:
    known = agent_names()
    if name in known:
        return name
    base, _, suffix = name.partition("+")
    if base == "sumo" and suffix:
        raise AgentError(f"no agent {name!r}: no filter can be put behind `sumo`, which SUMO itself drives")
    close = difflib.get_close_matches(name, known, n=1, cutoff=0.5)
    hint = f" (did you mean {close[0]!r}?)" if close else ""
    raise AgentError(f"no agent {name!r}{hint}; there are: {', '.join(known)}")
