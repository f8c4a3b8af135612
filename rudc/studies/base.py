"""What every study is given and what it answers; scenarios and agents that several of them share."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from rudc.agents.checkpoint import shipped_checkpoints
from rudc.errors import InputError
from rudc.evaluation.sweep import Progress
from rudc.files import write_atomically
from rudc.scenario import find_scenarios, shipped_scenarios
from rudc.scenario.model import Scenario

Budget = Literal["quick", "full", "paper"]
Given = Literal["folders", "agents", "episodes", "seed", "workers", "resume", "budget", "seeds", "trainings"]
OPTIONS: Mapping[Given, str] = {
    "folders": "folders of trainings",
    "agents": "--agent",
    "episodes": "--episodes",
    "seed": "--seed",
    "workers": "--workers",
    "resume": "--resume",
    "budget": "--budget",
    "seeds": "--seeds",
    "trainings": "--trainings",
}
"""what the command line calls them"""
DRIVES: frozenset[Given] = frozenset(("agents", "episodes", "seed", "workers", "resume", "budget"))
"""options that take effect in studies that drive existing agents"""

IN_DISTRIBUTION = ("random_destination", "dense_left_turn")
"""the paper's two tasks, which agents are trained for"""
QUICK_OOD = ("blocked_left_turn", "ignored_priority")
"""out-of-distribution scenarios of the quick budget"""
TRAINED = re.compile(r"rudc-[te](-seed\d+)?$")
"""shipped agents that are studied when none are named"""


@dataclass(frozen=True)
class Order:
    """What a user asks of a study."""

    out: Path
    """folder for everything it writes"""
    agents: tuple[str, ...] = ()
    """names; empty for the shipped trained ones"""
    folders: tuple[Path, ...] = ()
    """folders of trainings"""
    episodes: int | None = None
    """for each scenario and agent; None for what the budget says"""
    seed: int = 0
    """seed of the first episode"""
    workers: int = 1
    resume: bool = False
    budget: Budget = "full"
    training_seeds: tuple[int, ...] = ()
    """seeds of the trainings compared; empty for what the budget says"""
    trainings: Path | None = None
    """folder of trainings made before, NAME-seedN each; None: agents that do not exist yet are trained"""


@dataclass(frozen=True)
class Report:
    """What a study found."""

    table: str
    """Markdown, for reading"""
    files: tuple[Path, ...]
    notes: tuple[str, ...] = ()
    """what a reader should know"""
    errors: tuple[str, ...] = field(default=())
    """why episodes could not be run, once each"""


@dataclass(frozen=True)
class Study:
    """An experiment by name."""

    name: str
    summary: str
    run: Callable[[Order, Callable[[str], Progress]], Report]
    """second argument: a new progress for each of its sweeps, which are named"""
    takes: frozenset[Given] = DRIVES
    """options of an order that take effect in it"""
    budgets: tuple[Budget, ...] = ("quick", "full")

    @property
    def options(self) -> str:
        """What it takes, as the command line calls it."""
        return ", ".join(name for given, name in OPTIONS.items() if given in self.takes)


def chosen_agents(order: Order) -> tuple[str, ...]:
    """The agents named, or the shipped trained ones; of those only the first for the quick budget. Raises
    InputError when there are none.
    """
    if order.agents:
        return tuple(dict.fromkeys(order.agents))
    shipped = [name for name in shipped_checkpoints() if TRAINED.match(name)]
    if order.budget == "quick":
        shipped = [name for name in shipped if family(name) == name][:1] or shipped[:1]
    if not shipped:
        raise InputError("which agents? none of rudc-t and rudc-e is shipped: give at least one --agent NAME")
    return tuple(shipped)


def family(agent: str) -> str:
    """What agents that differ only in their training seed have in common: the name without `-seedN`."""
    name, colon, settings = agent.partition(":")
    base, plus, suffix = name.partition("+")
    return re.sub(r"-seed\d+$", "", base.rstrip("/")) + plus + suffix + colon + settings


def in_distribution() -> tuple[Scenario, ...]:
    """The tasks that agents are trained for."""
    return tuple(find_scenarios(list(IN_DISTRIBUTION)))


def out_of_distribution(budget: Budget) -> tuple[Scenario, ...]:
    """All shipped scenarios except the two tasks and except sweeps, whose points may lie on either side."""
    names = QUICK_OOD if budget == "quick" else [n for n in shipped_scenarios() if n not in IN_DISTRIBUTION]
    return tuple(scenario for scenario in find_scenarios(list(names)) if not scenario.sweep)


def write(path: Path, text: str) -> Path:
    """A file's whole content. Raises StorageError."""
    write_atomically(path, text)
    return path


def kinds_of_errors(rows: Sequence[dict[str, str]]) -> tuple[str, ...]:
    """Why episodes could not be run, once each."""
    return tuple(dict.fromkeys(row["error"] for row in rows if row["error"]))
