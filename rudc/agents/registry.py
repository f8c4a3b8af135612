"""Names of drivers and what they stand for: `sumo`, `follower`, `gap-acceptance`, a checkpoint's folder, and
`NAME+FILTER`.

What a learnt agent needs besides is imported when one is made.
"""

from __future__ import annotations

import difflib
from collections.abc import Callable
from pathlib import Path
from typing import Any

from rudc.agents.base import Agent
from rudc.agents.checkpoint import (
    DESCRIPTION,
    find_checkpoint,
    learnt_settings,
    learnt_summary,
    shipped_checkpoints,
)
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
    """Every name that `make_agent` knows; it takes folders of learnt agents too, with filters or without."""
    filtered = (f"{name}+{suffix}" for name in _DRIVERS if name != "sumo" for suffix in FILTERS)
    return (*_DRIVERS, *filtered, *shipped_checkpoints())


def make_agent(name: str) -> Agent:
    """The driver of that name, or of the checkpoint in that folder, new. Raises AgentError, with a
    suggestion, when there is none.
    """
    base, suffix = _parts(name)
    driver = _DRIVERS[base]() if base in _DRIVERS else _learnt(base)
    return FilteredAgent(driver, suffix) if suffix else driver


def agent_summary(name: str) -> str:
    """What a driver does, in a sentence."""
    base, suffix = _parts(name)
    if base in _DRIVERS:
        summary = (_DRIVERS[base].__doc__ or "").partition("\n")[0]
    else:
        summary = learnt_summary(_folder(base))
    return f"{summary} {FILTERS[suffix]}" if suffix else summary


def agent_settings(name: str) -> dict[str, Any]:
    """Everything besides its name that decides what a driver does; of what can be written as JSON."""
    base, suffix = _parts(name)
    driver = {"driver": base} if base in _DRIVERS else learnt_settings(_folder(base))
    return {**driver, **({"filter": filter_settings(suffix)} if suffix else {})}


def _learnt(name: str) -> Agent:
    from rudc.agents.learned import load_learned

    return load_learned(name, _folder(name))


def _folder(name: str) -> Path:
    folder = find_checkpoint(name)
    if folder is None:
        raise AgentError(f"no checkpoint in {name}")
    return folder


def _parts(name: str) -> tuple[str, str]:
    """Driver or folder, and suffix of the filter behind it (empty for none)."""
    if name.partition("+")[0] not in _DRIVERS:
        if find_checkpoint(name) is not None:
            return name, ""
        base, _, suffix = name.rpartition("+")
        if suffix in FILTERS and find_checkpoint(base) is not None:
            return base, suffix
    base, _, suffix = _checked(name).partition("+")
    return base, suffix


def _checked(name: str) -> str:
    known = agent_names()
    if name in known:
        return name
    base, _, suffix = name.partition("+")
    if base == "sumo" and suffix:
        raise AgentError(f"no agent {name!r}: no filter can be put behind `sumo`, which SUMO itself drives")
    if Path(name).is_dir():
        raise AgentError(f"no agent in {name}: it holds no {DESCRIPTION}")
    close = difflib.get_close_matches(name, known, n=1, cutoff=0.5)
    hint = f" (did you mean {close[0]!r}?)" if close else ""
    raise AgentError(f"no agent {name!r}{hint}; there are: {', '.join(known)}")
