"""All agents that can drive, and all algorithms that can be trained: what `rudc agent list` shows.

An algorithm's entry (rudc/learning/algorithms.py) says what the paper calls it and how it differs from
rudc-t. Further differences between an agent and the shipped rudc-t are found by comparing their settings.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from rudc.agents.checkpoint import Learnt, load_learnt, shipped_checkpoints
from rudc.agents.drivers import SHIPPED, driver_names, driver_summary
from rudc.errors import AgentError
from rudc.imports import leave_out
from rudc.learning.algorithms import ALGORITHMS, Algorithm

REFERENCE = "rudc-t"
"""agent with which the others are compared"""
NAMED = 3
"""settings that are named at most; of the others only the number is given"""
Status = Literal["rule-based", "added", "shipped", "trainable"]


@dataclass(frozen=True)
class Entry:
    """An agent, or an algorithm of which no trained agent is shipped."""

    name: str
    status: Status
    """`rule-based`: drives by rules; `added`: by a package or a call of `register_agent`; `shipped`: a
    trained agent; `trainable`: must be trained first"""
    summary: str
    """what it is, in a sentence"""
    differs: tuple[str, ...] = ()
    """differences between a learnt agent and the shipped rudc-t"""
    algorithm: str = ""
    """algorithm by which it learnt, or would learn; empty for others"""
    paper: str = ""
    """what the paper's tables call it; empty if they do not contain it"""
    seed: int | None = None
    """seed of its training"""
    steps: int | None = None
    """decisions it was trained for"""
    checkpoint: Path | None = None
    """its folder"""

    @property
    def text(self) -> str:
        """What it is, in short: its differences from rudc-t if it has any, else its summary."""
        if self.differs:
            return f"as {REFERENCE}, but: {'; '.join(self.differs)}"
        return self.summary


def entries() -> list[Entry]:
    """Drivers, then for each algorithm its shipped agents, or the algorithm itself if none is shipped. Raises
    InputError if something cannot be imported; in a block of `leaving_out` it is left out instead.
    """
    learnt = {name: (folder, load_learnt(folder)) for name, folder in shipped_checkpoints().items()}
    _, reference = learnt.get(REFERENCE, (None, None))
    shipped = [_shipped(name, folder, agent, reference) for name, (folder, agent) in learnt.items()]
    return [
        *_drivers(),
        *(
            entry
            for name, algorithm in ALGORITHMS.items()
            for entry in [e for e in shipped if e.algorithm == name] or [_trainable(name, algorithm)]
        ),
    ]


def _drivers() -> Iterator[Entry]:
    for name in driver_names():
        try:
            yield Entry(name, "rule-based" if name in SHIPPED else "added", driver_summary(name))
        except AgentError as error:
            leave_out(error)


def _trainable(name: str, algorithm: Algorithm) -> Entry:
    differs = (algorithm.differs,) if algorithm.differs else ()
    return Entry(name, "trainable", algorithm.summary, differs, name, algorithm.paper)


def _shipped(name: str, folder: Path, learnt: Learnt, against: Learnt | None) -> Entry:
    entry, seed = learnt.config.entry, int(learnt.training["seed"])
    differs = [entry.differs] if entry.differs else []
    if against is not None and learnt is not against:
        if seed != against.training["seed"]:
            differs.append(f"training seed {seed}")
        own = {*entry.defaults, *against.config.entry.defaults} if entry.differs else set()
        settings = _otherwise(learnt.config.model_dump(), against.config.model_dump(), own)
        more = f" and {len(settings) - NAMED} more settings" if len(settings) > NAMED else ""
        differs += [", ".join(settings[:NAMED]) + more] if settings else []
    return Entry(
        name,
        "shipped",
        entry.summary,
        tuple(differs),
        learnt.config.algorithm,
        entry.paper,
        seed,
        int(learnt.trained["steps"]),
        folder,
    )


def _otherwise(ours: Mapping[str, Any], theirs: Mapping[str, Any], but: set[str]) -> list[str]:
    """`key=value`, from `ours`, of each setting that both have with different values; without the sections
    in `but`.
    """
    there = dict(_flat(theirs))
    return [
        f"{key}={value}"
        for key, value in _flat(ours)
        if key in there and there[key] != value and key.partition(".")[0] not in {"algorithm", *but}
    ]


def _flat(tree: Any, prefix: str = "") -> Iterator[tuple[str, Any]]:
    if isinstance(tree, Mapping):
        for key, value in tree.items():
            yield from _flat(value, f"{prefix}.{key}" if prefix else str(key))
    else:
        yield prefix, tree
