"""A sweep's rows as arrays, and what stands beside them: errors, events, worst episodes."""

from __future__ import annotations

import hashlib
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from rudc.arrays import Array, Flags, Index
from rudc.env.outcome import Outcome
from rudc.evaluation.folder import TRACEBACK
from rudc.evaluation.metrics import numbers
from rudc.evaluation.store import format_row
from rudc.files import file_name

OUTCOMES = tuple(map(str, Outcome))
FAULTS = ("ego", "other", "shared")
WORST_SHOWN = 600
"""episodes listed at most"""
WORST_EACH = 3
"""episodes listed at most of each scenario and agent"""


@dataclass(frozen=True)
class Episodes:
    """All rows of a sweep."""

    rows: Sequence[dict[str, str]]
    parameters: tuple[str, ...]
    """swept keys"""
    scenarios: tuple[str, ...]
    agents: tuple[str, ...]
    scenario: Index
    """(n,) into scenarios"""
    agent: Index
    """(n,) into agents"""
    done: Flags
    """(n,) whether it ran to an end"""
    _columns: dict[str, Array] = field(default_factory=dict)

    @classmethod
    def of(cls, rows: Sequence[dict[str, str]], parameters: tuple[str, ...]) -> Episodes:
        """The rows of `read_sweep`."""
        scenarios = tuple(dict.fromkeys(row["scenario"] for row in rows))
        agents = tuple(dict.fromkeys(row["agent"] for row in rows))
        at_scenario, at_agent = _places(scenarios), _places(agents)
        return cls(
            rows,
            parameters,
            scenarios,
            agents,
            np.array([at_scenario[row["scenario"]] for row in rows], dtype=int),
            np.array([at_agent[row["agent"]] for row in rows], dtype=int),
            np.array([not row["error"] for row in rows], dtype=bool),
        )

    def number(self, column: str) -> Array:
        """(n,) a column's numbers, nan where it is empty."""
        if column not in self._columns:
            self._columns[column] = numbers(self.rows, column)
        return self._columns[column]

    def is_one_of(self, column: str, values: Sequence[str]) -> Flags:
        """(n,) whether a column says one of these."""
        return np.array([row[column] in values for row in self.rows], dtype=bool)

    def counts(self, chosen: Flags) -> Index:
        """(scenarios, agents) how many of the chosen there are."""
        shape = (len(self.scenarios), len(self.agents))
        flat = self.scenario[chosen] * shape[1] + self.agent[chosen]
        return np.bincount(flat, minlength=shape[0] * shape[1]).reshape(shape)


def outcome_counts(episodes: Episodes) -> dict[str, Any]:
    """How the episodes of each scenario and agent ended, and whose fault collisions were: name -> counts."""
    found = {name: episodes.counts(episodes.is_one_of("outcome", (name,))).tolist() for name in OUTCOMES}
    faults = {name: episodes.counts(episodes.is_one_of("fault", (name,))).tolist() for name in FAULTS}
    return {"outcomes": found, "errors": episodes.counts(~episodes.done).tolist(), "faults": faults}


def error_kinds(episodes: Episodes) -> list[dict[str, Any]]:
    """What went wrong in episodes that could not be run, the most frequent first."""
    found: dict[str, dict[str, Any]] = {}
    for number, row in enumerate(episodes.rows, 1):
        if row["error"]:
            text, _, file = row["error"].partition(TRACEBACK)
            kind = found.setdefault(text, {"text": text, "count": 0, "first": number, "file": file})
            kind["count"] += 1
    return sorted(found.values(), key=lambda kind: -kind["count"])


def event_counts(episodes: Episodes, scripted: Mapping[str, Sequence[str]]) -> list[dict[str, Any]]:
    """For each scenario with events: `kinds`, and for each agent [number of episodes that state their events;
    in how many of them some event happened; in how many all did, None where `kinds` are not known; in how
    many the ego's sensors showed one; mean of when the first began (s)].
    """
    fired, first = episodes.number("events_fired"), episodes.number("first_event_s")
    seen = ~np.isnan(episodes.number("first_event_visible_s"))
    found = []
    for k, name in enumerate(episodes.scenarios):
        there = (episodes.scenario == k) & ~np.isnan(fired) & episodes.done
        kinds = list(scripted.get(name, ()))
        if not (kinds or there.any()):
            continue
        lines = []
        for j in range(len(episodes.agents)):
            mine = np.flatnonzero(there & (episodes.agent == j))
            some = fired[mine] > 0
            begun = first[mine][~np.isnan(first[mine])]
            lines.append([
                len(mine), int(some.sum()), int((fired[mine] >= len(kinds)).sum()) if kinds else None,
                int((some & seen[mine]).sum()), round(float(begun.mean()), 1) if len(begun) else None,
            ])  # fmt: skip
        found.append({"scenario": k, "kinds": kinds, "agents": lines})
    return found


def worst(episodes: Episodes) -> list[int]:
    """Index of the worst episodes: first those that went wrong by the ego's own doing, then the others that
    went wrong, then frozen ones, then the closest calls; at most `WORST_EACH` of a scenario and agent.
    """
    gap, way = episodes.number("min_dtc_m"), episodes.number("route_completion")
    order = sorted(
        np.flatnonzero(episodes.done).tolist(),
        key=lambda i: (
            _badness(episodes.rows[i]),
            np.inf if np.isnan(gap[i]) else gap[i],
            2.0 if np.isnan(way[i]) else way[i],
            i,
        ),
    )
    groups = max(int((episodes.counts(episodes.done) > 0).sum()), 1)
    each = max(min(WORST_EACH, WORST_SHOWN // groups), 1)
    taken: dict[tuple[int, int], int] = {}
    found = []
    for i in order:
        group = (int(episodes.scenario[i]), int(episodes.agent[i]))
        taken[group] = taken.get(group, 0) + 1
        if taken[group] <= each:
            found.append(i)
    return found[:WORST_SHOWN]


def _badness(row: Mapping[str, str]) -> int:
    """0 the worst."""
    outcome, fault = row["outcome"], row["fault"]
    if outcome in (Outcome.SUCCESS, Outcome.FROZEN):
        return 5 if outcome == Outcome.SUCCESS else 4
    if outcome == Outcome.COLLISION:
        return {"ego": 0, "shared": 1, "other": 3}.get(fault, 1)
    return 2


def which(episodes: Episodes, i: int) -> str:
    """How `rudc replay --episode` calls an episode: by name where that is enough, else by row."""
    row = episodes.rows[i]
    if episodes.parameters:
        return str(i + 1)
    return shlex.quote(f"{row['scenario']}:{row['agent']}:{row['seed']}")


def replay_name(episodes: Episodes, i: int) -> str:
    """Name of the page that replays an episode. It ends in a digest of the whole row, times taken included:
    a page of another sweep, or of what stood in the folder before, never has it.
    """
    row = episodes.rows[i]
    parts = [row["scenario"], row["agent"], *(row[name] for name in episodes.parameters), row["seed"]]
    digest = hashlib.sha256(format_row(list(row.values())).encode()).hexdigest()[:12]
    return f"{file_name('-'.join(parts))}-{digest}.html"


def worst_lines(episodes: Episodes, replays: Sequence[str]) -> list[list[Any]]:
    """[row, scenario, agent, seed, swept values, outcome, fault, smallest gap (m), route completion (%),
    first event (s), --episode, page] of each; `replays`: names of pages that are there.
    """
    found = []
    for i in worst(episodes):
        row, name = episodes.rows[i], replay_name(episodes, i)
        found.append([
            i + 1, int(episodes.scenario[i]), int(episodes.agent[i]), row["seed"],
            ", ".join(f"{key}={row[key]}" for key in episodes.parameters), row["outcome"], row["fault"],
            _rounded(episodes.number("min_dtc_m")[i], 2),
            _rounded(100.0 * episodes.number("route_completion")[i], 0),
            _rounded(episodes.number("first_event_s")[i], 1), which(episodes, i),
            name if name in replays else "",
        ])  # fmt: skip
    return found


def _rounded(value: float, decimals: int) -> float | None:
    return None if np.isnan(value) else round(float(value), decimals)


def _places(names: Sequence[str]) -> dict[str, int]:
    return {name: i for i, name in enumerate(names)}
