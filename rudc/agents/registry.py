"""Names of drivers and what they stand for: `sumo`, `follower`, `gap-acceptance`, a checkpoint's folder, and
`NAME+FILTER`; with settings behind it as in rudc/agents/variation.py.

What a learnt agent needs besides is imported when one is made.
"""

from __future__ import annotations

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
from rudc.agents.filtered import FILTERS, FilteredAgent
from rudc.agents.follower import Follower
from rudc.agents.gap_acceptance import GapAcceptance
from rudc.agents.sumo import SumoDriver
from rudc.agents.variation import Settings, filter_settings, parse, split
from rudc.errors import AgentError
from rudc.hints import there_are
from rudc.learning.parameters import fingerprint
from rudc.safety.residual import shipped_predictor

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
    base, suffix, settings = _parts(name)
    if base in _DRIVERS:
        driver = _DRIVERS[base]()
    else:
        from rudc.agents.learned import load_learned

        driver = load_learned(name, _folder(base), {} if suffix else settings)
    if not suffix:
        return driver
    return FilteredAgent(driver, name, filter_settings(suffix, settings).make({}))


def agent_summary(name: str) -> str:
    """What a driver does, in a sentence."""
    base, suffix, _ = _parts(name)
    if base in _DRIVERS:
        summary = (_DRIVERS[base].__doc__ or "").partition("\n")[0]
    else:
        summary = learnt_summary(_folder(base))
    return f"{summary} {FILTERS[suffix]}" if suffix else summary


def agent_settings(name: str) -> dict[str, Any]:
    """Everything besides its name that decides what a driver does; of what can be written as JSON."""
    base, suffix, settings = _parts(name)
    if base in _DRIVERS:
        driver: dict[str, Any] = {"driver": base}
    else:
        driver = learnt_settings(_folder(base), {} if suffix else settings)
    if not suffix:
        return driver
    residual = fingerprint(shipped_predictor().arrays) if settings.get("residual") else None
    return {
        **driver,
        "correction": filter_settings(suffix, settings).model_dump(mode="json"),
        "predictor": residual,
    }


def _folder(name: str) -> Path:
    folder = find_checkpoint(name)
    if folder is None:
        raise AgentError(f"no checkpoint in {name}")
    return folder


def _parts(name: str) -> tuple[str, str, Settings]:
    """Driver or folder, suffix of the filter behind it (empty for none), and settings."""
    whole, text = (name, "") if find_checkpoint(name) is not None else split(name)
    base, suffix = _base(whole)
    if not text:
        return base, suffix, {}
    if base in _DRIVERS and not suffix:
        raise AgentError(f"{whole!r} has no filter, and nothing that {text!r} could set")
    return base, suffix, parse(text, learnt=not suffix)


def _base(name: str) -> tuple[str, str]:
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
    raise AgentError(f"no agent {name!r}{there_are(name, known)}")
