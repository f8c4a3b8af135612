"""What a sweep consists of: one task an episode, in one order that depends on nothing but the inputs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from rudc.agents.named import refuse_object
from rudc.errors import SweepError
from rudc.evaluation.record import as_text
from rudc.imports import shortened
from rudc.scenario.dotted import value_text

if TYPE_CHECKING:
    from rudc.scenario.model import Scalar, Scenario

Key = tuple[str, ...]
"""what tells one episode of a sweep from the others, as text: scenario, agent, seed, swept values"""
MOST = 10_000_000
"""episodes of a sweep: their tasks are kept in memory, 0.5 kB each"""


@dataclass(frozen=True, slots=True)
class Task:
    """One episode to be run."""

    scenario: Scenario
    """with the swept values in it"""
    swept: Mapping[str, Scalar]
    """dotted key -> value, of its scenario's `sweep`"""
    agent: str
    seed: int
    agent_digest: str = ""
    """digest of the agent's settings and weights when the sweep began; empty: not compared"""
    agent_reads: Mapping[str, str] = field(default_factory=dict)
    """name -> digest of each data file that an agent of one's own read when the sweep began"""

    def cells(self, parameters: Sequence[str]) -> list[str]:
        """Its swept values as text, one for each of the sweep's parameters, empty for those it has not."""
        return [as_text(self.swept.get(name)) for name in parameters]

    def key(self, parameters: Sequence[str]) -> Key:
        """What tells it from the sweep's other tasks, as its row says it."""
        return (self.scenario.name, as_text(self.agent), str(self.seed), *self.cells(parameters))

    def __str__(self) -> str:
        values = "".join(f", {name}={value_text(value)}" for name, value in self.swept.items())
        return f"{self.scenario.name}{values}, {self.agent}, seed {self.seed}"


def refuse_twice(what: str, names: Sequence[str]) -> None:
    """Raise SweepError if two of them are the same; the message calls them `what`."""
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise SweepError(f"{what} {twice[0]!r} is given more than once; give each a name of its own")


def _refuse_single(what: str, given: object, instead: str) -> None:
    """Raise SweepError for one thing where several are wanted; `instead`: what should be given."""
    if isinstance(given, str) or not isinstance(given, Sequence):
        raise SweepError(f"`{what}` of a sweep is a tuple of them, not {shortened(given)}: {instead}")


@dataclass(frozen=True)
class SweepPlan:
    """Everything that decides a sweep's rows."""

    scenarios: tuple[Scenario, ...]
    agents: tuple[str, ...]
    episodes: int
    """for each scenario, swept value and agent"""
    seed: int
    """seed of the first episode; the others follow, the same for each agent, so that agents compare in
    pairs"""

    def __post_init__(self) -> None:
        _refuse_single("scenarios", self.scenarios, "find_scenarios([NAME, ...]) gives them")
        _refuse_single("agents", self.agents, f"({self.agents!r},)")
        for agent in self.agents:
            refuse_object(agent)
        if wrong := [s for s in self.scenarios if not hasattr(s, "grid")]:
            raise SweepError(
                f"{shortened(wrong[0])} is no scenario: find_scenarios([NAME, ...]) gives a list of them"
            )
        for what, names in (
            ("scenario", [s.name for s in self.scenarios]),
            ("agent", list(map(as_text, self.agents))),
        ):
            if not names:
                raise SweepError(f"a sweep needs at least one {what}")
            refuse_twice(what, names)
        if self.episodes < 1:
            raise SweepError(f"a sweep needs at least one episode, not {self.episodes}")
        count = sum(len(s.points()) for s in self.scenarios) * len(self.agents) * self.episodes
        if count > MOST:
            raise SweepError(
                f"a sweep of {count} episodes is more than one folder takes ({MOST}); "
                "split it by --seed and --episodes over several"
            )
        if not self.seed + self.episodes < 2**63:
            raise SweepError(
                "a seed beyond 2^63 - 2 cannot be told from others in tables, and the last one of this "
                f"sweep is {self.seed + self.episodes - 1}"
            )
        if self.seed < 0:
            raise SweepError(f"a seed cannot be negative, got {self.seed}")

    @property
    def parameters(self) -> tuple[str, ...]:
        """Dotted keys that any of the scenarios sweeps, in order of first appearance."""
        return tuple(dict.fromkeys(key for scenario in self.scenarios for key in scenario.sweep))

    def tasks(self) -> list[Task]:
        """All episodes in the canonical order: scenario, swept values, agent, seed."""
        return [
            Task(scenario, swept, agent, self.seed + i)
            for family in self.scenarios
            for swept, scenario in family.grid()
            for agent in self.agents
            for i in range(self.episodes)
        ]
