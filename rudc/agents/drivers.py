"""Drivers that need no checkpoint, by name: RUDC's own, those of installed packages, those registered.

A package offers agents by entry points of the group `rudc.agents` (rudc/imports.py): a class or function for
each name. A script or notebook registers them: `rudc.register_agent("careful", Careful)`. Without either, an
agent is named by the place of its class, `my_agents.py:Careful(speed=6)`: see rudc/agents/own.py.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Mapping
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from types import MappingProxyType
from typing import Any

from rudc.agents.base import Agent
from rudc.agents.checkpoint import shipped_checkpoints
from rudc.agents.follower import Follower
from rudc.agents.gap_acceptance import GapAcceptance, Planner
from rudc.agents.guarded import GuardedAgent
from rudc.agents.own import OwnAgent, construct, imports_beside, named_apart, parse_own, source_digest
from rudc.agents.own_files import files_of
from rudc.agents.sumo import SumoDriver
from rudc.errors import AgentError, InputError
from rudc.imports import load_entry

MakeAgent = Callable[[], Agent]

GROUP = "rudc.agents"
"""group of the entry points of agents"""
SHIPPED: Mapping[str, MakeAgent] = MappingProxyType(
    {"sumo": SumoDriver, "follower": Follower, "gap-acceptance": GapAcceptance, "planner": Planner}
)

_registered: dict[str, MakeAgent] = {}


def register_agent(name: str, make: MakeAgent) -> None:
    """Give a name to an agent: `--agent NAME` and `make_agent(NAME)` then mean the agent that `make()` (a
    class or a function) returns.

    A sweep's workers know the name too if they can import `make`. Raises InputError if the name belongs to
    RUDC's own agents or is no valid name. An agent registered before with this name is replaced.
    """
    if not re.fullmatch(r"[A-Za-z]\w*([.-]\w+)*", name):
        raise InputError(
            f"{name!r} can be no agent's name: letters, digits, '_', and '-' or '.' between them"
        )
    if _is_ours(name):
        raise InputError(f"there is an agent {name!r} already, and it is RUDC's own; take another name")
    if not callable(make):
        raise InputError(f"agent {name!r}: register its class, or a function that makes it, not {make!r}")
    _registered[name] = make


def registered_agents() -> dict[str, MakeAgent]:
    """Name -> `make` of all agents that `register_agent` was given in this process."""
    return dict(_registered)


def driver_names() -> tuple[str, ...]:
    """Names of all drivers: RUDC's, those of packages, those registered."""
    return tuple(dict.fromkeys([*SHIPPED, *_installed(), *_registered]))


def find_own(name: str) -> tuple[str, str] | None:
    """For a name that begins with the place of a class: that part, and the rest; None for other names."""
    if name.partition(":")[0] in driver_names():
        return None
    found = parse_own(name)
    return None if found is None else (found[0].text, found[1])


def is_driver(name: str) -> bool:
    """Whether `name` is the name of a driver, or the place of a class."""
    return name in driver_names() or find_own(name) is not None


def make_driver(name: str) -> Agent:
    """A new driver. Raises AgentError."""
    if name in SHIPPED:
        return SHIPPED[name]()
    own = _own(name)
    return GuardedAgent(own.make() if own else construct(_find(name), name), name)


def driver_summary(name: str) -> str:
    """What the driver does, in a sentence: the first line of its docstring."""
    own = _own(name)
    first = ((own.find() if own else _find(name)).__doc__ or "").strip().partition("\n")[0]
    return first or "Says nothing of itself."


def driver_settings(name: str) -> dict[str, Any]:
    """Everything besides its name that decides what the driver does; it can be written as JSON. Raises
    AgentError if one that is not RUDC's cannot be made.
    """
    if name in SHIPPED:
        return {"driver": name}
    if own := _own(name):
        return own.settings()
    found = _find(name)
    beside = {}
    if name not in _registered:
        beside = imports_beside(found) | named_apart(sys.modules[_installed()[name].module], found)
    known: dict[str, Any] = {"driver": name, "source": source_digest(found)}
    if reads := files_of(name, found, lambda: construct(found, name)):
        known["reads"] = reads
    return known | ({"imports": beside} if beside else {})


def _own(name: str) -> OwnAgent | None:
    found = None if name in driver_names() else parse_own(name)
    return found[0] if found else None


def _find(name: str) -> MakeAgent:
    if name in SHIPPED:
        return SHIPPED[name]
    if name in _registered:
        return _registered[name]
    return load_entry(_installed()[name], AgentError)


def offered_in_vain() -> list[str]:
    """A line for each agent of an installed package that cannot be used because its name means another agent:
    RUDC's own, or one of a package that is found after it.
    """
    found = []
    for entry in entry_points(group=GROUP):
        package = _package(entry)
        what = f"the agent {entry.name!r} of the installed package {package} is not used"
        if _is_ours(entry.name):
            found.append(f"{what}: it is RUDC's own")
        elif (used := _package(_installed()[entry.name])) != package:
            found.append(f"{what}: {used} offers one, too")
    return found


def _is_ours(name: str) -> bool:
    """Whether a name means one of RUDC's own agents, rule-based or learnt."""
    return name in SHIPPED or name in shipped_checkpoints()


def _package(entry: EntryPoint) -> str:
    return entry.dist.name if entry.dist else "?"


@cache
def _installed() -> dict[str, EntryPoint]:
    """Name -> entry point of each agent that installed packages offer under a name that is not one of
    RUDC's own."""
    return {entry.name: entry for entry in entry_points(group=GROUP) if not _is_ours(entry.name)}
