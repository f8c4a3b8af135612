"""Does sigma mean something?

    ood         does it tell decisions in an out-of-distribution scenario from those in the two tasks?
                Positives: all decisions of the scenario's episodes, also those before anything unusual shows
    violation   does it announce a violation? Positives: decisions at most HORIZON steps before an episode's
                violation; negatives: all others of the same scenarios

Each for sigma_epi, sigma_ale and sigma_total as AUROC (rudc/studies/auroc.py), agent by agent, since critics
of different agents have scales of their own, and as the mean of the agents that differ only in their training
seed. Sigmas are kept as they are stated, an array (steps, 3) for each episode in `sigmas/`.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from rudc.agents.base import Agent, Decision, EgoDriver
from rudc.agents.checkpoint import find_checkpoint
from rudc.agents.registry import make_agent
from rudc.agents.variation import split
from rudc.arrays import Array, Flags, Index
from rudc.errors import InputError, StorageError
from rudc.evaluation.columns import happened
from rudc.evaluation.record import EpisodeRecord
from rudc.evaluation.runner import EpisodeRunner
from rudc.evaluation.sweep import Progress, run_sweep
from rudc.evaluation.tasks import SweepPlan, Task
from rudc.files import make_folder, replacing
from rudc.reporting.separation import Mark, draw_separation
from rudc.reporting.text import csv_text, interval, markdown
from rudc.studies.auroc import auroc, auroc_draws, percentile_interval
from rudc.studies.base import (
    IN_DISTRIBUTION,
    Order,
    Report,
    chosen_agents,
    family,
    in_distribution,
    kinds_of_errors,
    out_of_distribution,
    write,
)
from rudc.world.scene import Scene

HORIZON = 20
"""decisions, 2 s"""
EPISODES = {"quick": 10, "full": 100}
"""for each scenario and agent, by budget"""
SIGMAS = ("epistemic", "aleatoric", "total")
INSIDE, OUTSIDE, ALL = "in distribution", "all out of distribution", "all scenarios"


class Drive(NamedTuple):
    """What one episode says."""

    scenario: str
    violated: bool
    """whether it ended in a violation"""
    sigmas: Array
    """(steps, 3) epistemic, aleatoric, total, reward units"""


class Listener:
    """An agent, and what it said of its uncertainty since it was reset."""

    def __init__(self, agent: Agent) -> None:
        self.inner = agent
        self.name = agent.name
        self.ego_driver: EgoDriver = agent.ego_driver
        self.heard: list[tuple[float, ...]] = []

    def reset(self, scene: Scene, seed: int) -> None:
        """Reset the agent and forget."""
        self.heard = []
        self.inner.reset(scene, seed)

    def act(self, scene: Scene) -> Decision:
        """The agent's decision."""
        decision = self.inner.act(scene)
        stated = decision.uncertainty
        self.heard.append((math.nan,) * 3 if stated is None else tuple(float(value) for value in stated))
        return decision


class ListeningRunner:
    """Runs episodes and writes the sigmas of each into a folder, before its row is written."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._listeners: dict[str, Listener] = {}
        self._run = EpisodeRunner(self._make)

    def _make(self, name: str) -> Listener:
        self._listeners[name] = Listener(make_agent(name))
        return self._listeners[name]

    def __call__(self, task: Task) -> EpisodeRecord:
        """Run the task's episode."""
        record = self._run(task)
        if record.error:
            return record
        path = sigma_file(self._folder, task.agent, task.scenario.name, task.seed)
        try:
            make_folder(path.parent)
            with replacing(path) as file:
                np.save(file, np.array(self._listeners[task.agent].heard, dtype=np.float32))
        except (InputError, StorageError) as error:
            return EpisodeRecord.failed(record.scenario, record.agent, record.seed, str(error))
        return record


def sigma_file(folder: Path, agent: str, scenario: str, seed: int) -> Path:
    """Where an episode's sigmas are."""
    return folder / re.sub(r"[^\w.+=,-]", "_", agent) / scenario / f"{seed}.npy"


def run(order: Order, progress: Callable[[str], Progress]) -> Report:
    """Drive, listen, and see what the sigmas separate."""
    agents = chosen_agents(order)
    for name in agents:
        _must_state_sigma(name)
    scenarios = (*in_distribution(), *out_of_distribution(order.budget))
    make_folder(order.out)
    sigmas = order.out.resolve() / "sigmas"
    plan = SweepPlan(scenarios, agents, order.episodes or EPISODES[order.budget], order.seed)
    runner = partial(ListeningRunner, sigmas)
    result = run_sweep(
        plan,
        order.out / "sweep",
        runner,
        workers=order.workers,
        resume=order.resume,
        progress=progress("sigma"),
    )
    drives = {name: _drives([row for row in result.rows if row["agent"] == name], sigmas) for name in agents}
    lines = measure(drives)
    table = as_markdown(lines)
    files = (
        write(order.out / "sigma.csv", csv_text(lines)),
        write(order.out / "sigma.md", table),
        draw_separation(marks(lines), order.out / "sigma.png"),
    )
    return Report(table, files, errors=kinds_of_errors(result.rows))


def _must_state_sigma(name: str) -> None:
    base = split(name)[0].partition("+")[0]
    if find_checkpoint(name) is None and find_checkpoint(base) is None:
        make_agent(name)
        raise InputError(f"{name} states no uncertainty, so there is nothing to study")


def _drives(rows: Sequence[Mapping[str, str]], folder: Path) -> list[Drive]:
    """Raises StorageError when what the runner wrote is gone."""
    found = []
    for row in rows:
        if row["error"]:
            continue
        path = sigma_file(folder, row["agent"], row["scenario"], int(row["seed"]))
        try:
            stated = np.load(path).astype(float)
        except OSError as error:
            raise StorageError(
                f"{path} cannot be read ({error.strerror}); its episode is finished, so give another --out"
            ) from None
        if not np.isfinite(stated).all():
            raise InputError(f"{row['agent']} states no uncertainty, so there is nothing to study")
        found.append(Drive(row["scenario"], happened("VR", row["outcome"]), stated))
    return found


@dataclass(frozen=True)
class Question:
    """Which decisions are to be told from which."""

    task: str
    """ood or violation"""
    scenarios: str
    """as shown"""
    positive: frozenset[str]
    """scenarios whose decisions are (ood) or may be (violation) positive"""
    negative: frozenset[str]


def questions(scenarios: Sequence[str]) -> list[Question]:
    """Everything that is asked of an agent that drove these scenarios."""
    inside = frozenset(IN_DISTRIBUTION)
    outside = [name for name in scenarios if name not in inside]
    whole = frozenset(outside)
    everything = whole | inside
    found = [Question("ood", OUTSIDE, whole, inside)]
    found += [Question("ood", name, frozenset({name}), inside) for name in outside]
    found += [
        Question("violation", ALL, everything, everything),
        Question("violation", INSIDE, inside, inside),
        Question("violation", OUTSIDE, whole, whole),
    ]
    found += [Question("violation", name, frozenset({name}), frozenset({name})) for name in scenarios]
    return found


def measure(drives: Mapping[str, Sequence[Drive]]) -> list[dict[str, object]]:
    """Lines of `sigma.csv`: every question and sigma, for each agent and for each family of several."""
    families: dict[str, list[str]] = {}
    for name in drives:
        families.setdefault(family(name), []).append(name)
    scenarios = list(dict.fromkeys(drive.scenario for members in drives.values() for drive in members))
    lines = []
    for shared, members in families.items():
        for question in questions(scenarios):
            cases = {name: _case(question, drives[name]) for name in members}
            for k, sigma in enumerate(SIGMAS):
                measured = {name: _answer(case, k) for name, case in cases.items()}
                one = len(members) == 1
                if not one:
                    value = float(np.mean([value for value, _ in measured.values()]))
                    draws = np.mean([draws for _, draws in measured.values()], axis=0)
                    lines.append(_line(question, sigma, shared, cases.values(), value, draws))
                for name, (value, draws) in measured.items():
                    row = _line(question, sigma, name, [cases[name]], value, draws)
                    lines.append(row | {"family": shared, "mean_of_seeds": one})
    return lines


class _Case(NamedTuple):
    """The decisions that a question is about."""

    sigmas: Array
    """(n, 3)"""
    positive: Flags
    """(n,)"""
    episode: Index
    """(n,)"""
    stratum: Index
    """(E,) scenario of each episode"""


def _case(question: Question, drives: Sequence[Drive]) -> _Case:
    taken = [d for d in drives if d.scenario in question.positive | question.negative and len(d.sigmas)]
    names = sorted({drive.scenario for drive in taken})
    positive = []
    for drive in taken:
        steps = len(drive.sigmas)
        if question.task == "ood":
            flags = np.full(steps, drive.scenario in question.positive)
        else:
            flags = np.arange(steps) >= steps - HORIZON if drive.violated else np.zeros(steps, dtype=bool)
        positive.append(flags)
    episode = np.repeat(np.arange(len(taken)), [len(d.sigmas) for d in taken])
    return _Case(
        np.concatenate([np.zeros((0, 3)), *(d.sigmas for d in taken)]),
        np.concatenate([np.zeros(0, dtype=bool), *positive]),
        episode.astype(np.int64),
        np.array([names.index(d.scenario) for d in taken], dtype=np.int64),
    )


def _answer(case: _Case, sigma: int) -> tuple[float, Array]:
    """AUROC of one sigma, and its bootstrap's draws."""
    scores = np.ascontiguousarray(case.sigmas[:, sigma])
    value = auroc(scores, case.positive)
    if math.isnan(value):
        return value, np.array([math.nan])
    return value, auroc_draws(scores, case.positive, case.episode, case.stratum)


def _line(question: Question, sigma: str, agent: str, cases, value: float, draws: Array) -> dict[str, object]:
    low, high = percentile_interval(value, draws)[1:]
    cases = list(cases)
    return {
        "agent": agent,
        "family": agent,
        "mean_of_seeds": True,
        "task": question.task,
        "scenarios": question.scenarios,
        "sigma": sigma,
        "auroc": value,
        "auroc_low": low,
        "auroc_high": high,
        "episodes": sum(len(case.stratum) for case in cases),
        "positive_episodes": sum(len(np.unique(case.episode[case.positive])) for case in cases),
        "decisions": sum(len(case.positive) for case in cases),
        "positive_decisions": sum(int(case.positive.sum()) for case in cases),
    }


def as_markdown(lines: Sequence[Mapping]) -> str:
    """One line for each question, the three sigmas beside each other; families rather than single agents."""
    headings = ["agent", "task", "scenarios", "episodes", "positive", *(f"sigma {name}" for name in SIGMAS)]
    grouped: dict[tuple[str, str, str], list[Mapping]] = {}
    for line in lines:
        if line["mean_of_seeds"]:
            grouped.setdefault((line["family"], line["task"], line["scenarios"]), []).append(line)
    rows = []
    for key, members in grouped.items():
        values = [interval(m["auroc"], m["auroc_low"], m["auroc_high"], 3) for m in members]
        rows.append([*key, str(members[0]["episodes"]), str(members[0]["positive_episodes"]), *values])
    return markdown(headings, rows, left=3)


def marks(lines: Sequence[Mapping]) -> list[Mark]:
    """What the figure shows."""
    return [
        Mark(
            m["family"], m["task"], m["scenarios"], m["sigma"], (m["auroc"], m["auroc_low"], m["auroc_high"])
        )
        for m in lines
        if m["mean_of_seeds"]
    ]
