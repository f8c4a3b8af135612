"""Does sigma mean something?

Asked of decisions, answered by AUROC (rudc/studies/auroc.py):

    violation         does it announce a violation? Positives: decisions at most HORIZON steps before one
    violation seen    the same, of those whose cause could be seen (rudc/studies/sigma_steps.py)
    violation hidden  the same, of the others: an icy road, late actuators, a vehicle that could not be seen
    exposed           does it notice what is unusual? Positives: decisions with an event in sight, ahead,
                      within 40 m

Negatives are undisturbed decisions of the same scenarios: no event has begun and been shown yet, and no
violation follows within HORIZON. The scores are
  - sigma_epi, sigma_ale and sigma_total, as in the paper and by route (rudc/agents/route_sigma.py);
  - what the plant monitor finds wrong with the car;
  - sigma by route with that monitor: a car that is not ordinary ranks above all sigma;
  - sigma by route with both monitors: somebody unusual (rudc/agents/conduct.py) ahead within 40 m also ranks
    above all sigma.
They are computed for each agent, since critics of different agents have scales of their own, and as the mean
of the agents that differ only in their training seed.

For the slack, by either kind of sigma, of agents whose sigma_l is known: the share of decisions in
distribution above sigma_l, which should be 5 %; and the share of the decisions within HORIZON before a
violation in which sigma was below sigma_l, so that delta > 0 relaxed the filter.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from rudc.agents.checkpoint import find_checkpoint, load_learnt
from rudc.agents.drivers import SHIPPED
from rudc.agents.registry import make_agent
from rudc.agents.route_sigma import RouteSigma
from rudc.agents.variation import split
from rudc.arrays import Array, Flags, Index
from rudc.errors import InputError
from rudc.evaluation.columns import happened
from rudc.evaluation.sweep import Progress, run_sweep
from rudc.evaluation.tasks import SweepPlan
from rudc.evaluation.text import csv_text, interval_of, markdown, number
from rudc.files import make_folder, past_links
from rudc.reporting.separation import Mark, draw_separation
from rudc.studies.auroc import RESAMPLES, auroc, auroc_draws, percentile_interval
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
from rudc.studies.page import page
from rudc.studies.sigma_steps import AT, HORIZON, SigmaLog
from rudc.studies.step_files import StepRunner, read_steps

EPISODES = {"quick": 10, "full": 100}
"""for each scenario and agent, by budget"""
SCORES = (
    "epistemic", "aleatoric", "total", "route_epistemic", "route_aleatoric", "route", "mismatch",
    "route_or_mismatch", "route_or_monitors",
)  # fmt: skip
SHOWN = ("total", "route", "route_or_mismatch", "route_or_monitors")
"""those that stand in the table and the figure"""
WORDS = {
    "violation": f"decisions at most {HORIZON} steps before a violation",
    "violation seen": "of these, those before a violation whose cause the EV could see",
    "violation hidden": "the others: an icy road, late actuators, a vehicle that could not be seen",
    "exposed": "decisions with an event in sight, ahead, within 40 m",
    "positive": "episodes with such decisions",
    "total": "sigma_total, as in the paper",
    "route": "sigma by route",
    "route_or_mismatch": "sigma by route; above all sigma where the plant monitor finds the car unusual",
    "route_or_monitors": "the same, and where somebody unusual is ahead within 40 m",
}
OF_SLACK = {
    "above sigma_l": "share of decisions in distribution with sigma above sigma_l, its 95th percentile in "
    "training: should be 5 %",
    "relaxed before a violation": "share of the decisions before a violation in which sigma was below "
    "sigma_l, so that the slack relaxed the filter: of all, and by whether the cause could be seen",
}
INSIDE, OUTSIDE, ALL = "in distribution", "all out of distribution", "all scenarios"


class Drive(NamedTuple):
    """What one episode says."""

    scenario: str
    violated: bool
    """whether it ended in a violation"""
    steps: Array
    """(steps, columns), see rudc/studies/sigma_steps.py"""

    def of(self, column: str) -> Array:
        """(steps,) a column."""
        return self.steps[:, AT[column]]

    def scores(self) -> Array:
        """(steps, scores) of `SCORES`."""
        route, wrong, odd = self.of("route"), self.of("mismatch"), self.of("unusual")
        car = np.where(wrong > 0, FIRST + wrong, route)
        monitors = np.where((wrong > 0) | (odd > 0), FIRST + route, route)
        return np.column_stack([*(self.of(name) for name in SCORES[:-2]), car, monitors])

    def before_violation(self) -> Flags:
        """(steps,) whether a violation follows within HORIZON."""
        steps = len(self.steps)
        return np.arange(steps) >= steps - HORIZON if self.violated else np.zeros(steps, dtype=bool)


FIRST = 1e6
"""reward units, above all sigma"""


def run(order: Order, progress: Callable[[str], Progress]) -> Report:
    """Drive, keep the sigmas, and measure what they separate."""
    agents = chosen_agents(order)
    for name in agents:
        _must_state_sigma(name)
    scenarios = (*in_distribution(), *out_of_distribution(order.budget))
    make_folder(order.out)
    steps = past_links(order.out) / "steps"
    plan = SweepPlan(scenarios, agents, order.episodes or EPISODES[order.budget], order.seed)
    runner = partial(StepRunner, steps, SigmaLog)
    result = run_sweep(
        plan,
        order.out / "sweep",
        runner,
        workers=order.workers,
        resume=order.resume,
        progress=progress("sigma"),
    )
    drives = {name: _drives([row for row in result.rows if row["agent"] == name], steps) for name in agents}
    lines = measure(drives)
    slack = [line for name in agents for line in slack_lines(name, limits_of(name), drives[name])]
    if not slack:
        (order.out / "sigma_slack.csv").unlink(missing_ok=True)  # of an earlier run
    said = (
        f"Each agent drove {plan.episodes} episode(s) of each of {len(scenarios)} scenarios. How well sigma "
        "tells the decisions that `task` names from undisturbed ones of the same scenarios: AUROC, in "
        "brackets its 95 % interval; – where there are none of either."
    )
    tables = [as_markdown(lines), *([slack_markdown(slack)] if slack else [])]
    table = page("sigma", order, said, tables, {**WORDS, **(OF_SLACK if slack else {})})
    files = (
        write(order.out / "sigma.csv", csv_text(lines)),
        *([write(order.out / "sigma_slack.csv", csv_text(slack))] if slack else []),
        write(order.out / "sigma.md", table),
        draw_separation(marks(lines), order.out / "sigma.png"),
    )
    return Report(table, files, errors=kinds_of_errors(result.rows))


def _must_state_sigma(name: str) -> None:
    """Raise InputError for an agent that is known to state no uncertainty; of an agent of one's own that is
    found out as it drives.
    """
    make_agent(name)
    folder = _folder(name)
    if folder is not None:
        silent = "sigma" not in load_learnt(folder).config.learner.offers
    else:
        silent = _base(name) in SHIPPED
    if silent:
        raise InputError(f"{name} states no uncertainty, so there is nothing to study")


def _folder(name: str) -> Path | None:
    """Folder of an agent's checkpoint; None for drivers that did not learn."""
    return find_checkpoint(name) or find_checkpoint(split(name)[0]) or find_checkpoint(_base(name))


def _base(name: str) -> str:
    """An agent's name without settings and filter."""
    return split(name)[0].partition("+")[0]


def _drives(rows: Sequence[Mapping[str, str]], folder: Path) -> list[Drive]:
    """Raises StorageError when what the runner wrote is gone, or has other columns."""
    found = []
    for row, stated in read_steps(folder, rows, SigmaLog.columns):
        if not np.isfinite(stated[:, AT["total"]]).all():
            raise InputError(f"{row['agent']} states no uncertainty, so there is nothing to study")
        found.append(Drive(row["scenario"], happened("VR", row["outcome"]), stated))
    return found


TASKS = ("violation", "violation seen", "violation hidden", "exposed")


@dataclass(frozen=True)
class Question:
    """Which decisions are to be told from which."""

    task: str
    """one of `TASKS`"""
    scenarios: str
    """as shown"""
    among: frozenset[str]
    """scenarios whose decisions it is about"""

    def positive(self, drive: Drive) -> Flags:
        """(steps,) the decisions that should stand out."""
        if self.task == "exposed":
            return drive.of("exposed") > 0
        seen = drive.of("seen")  # nan without a violation
        wanted = {"violation": ~np.isnan(seen), "violation seen": seen == 1, "violation hidden": seen == 0}
        return drive.before_violation() & wanted[self.task]

    def negative(self, drive: Drive) -> Flags:
        """(steps,) the undisturbed ones."""
        return (drive.of("disturbed") == 0) & ~drive.before_violation()


def questions(scenarios: Sequence[str]) -> list[Question]:
    """Everything that is asked of an agent that drove these scenarios."""
    inside = frozenset(scenarios) & frozenset(IN_DISTRIBUTION)
    outside = frozenset(scenarios) - inside
    pooled = ((ALL, inside | outside), (INSIDE, inside), (OUTSIDE, outside))
    scopes = [*pooled, *((name, frozenset({name})) for name in scenarios)]
    return [
        Question(task, name, among)
        for task in TASKS
        for name, among in scopes
        if task != "exposed" or among - inside
    ]


def measure(drives: Mapping[str, Sequence[Drive]]) -> list[dict[str, Any]]:
    """Lines of `sigma.csv`: every question and sigma, for each agent and for each family of several. A mean
    over training seeds is of all of them: nan where one has no AUROC.
    """
    families: dict[str, list[str]] = {}
    for name in drives:
        families.setdefault(family(name), []).append(name)
    scenarios = list(dict.fromkeys(drive.scenario for members in drives.values() for drive in members))
    lines = []
    for shared, members in families.items():
        for question in questions(scenarios):
            cases = {name: _case(question, drives[name]) for name in members}
            for k, sigma in enumerate(SCORES):
                measured = {name: _answer(case, k) for name, case in cases.items()}
                one = len(members) == 1
                if not one:
                    value = float(np.mean([value for value, _ in measured.values()]))
                    draws = np.mean([draws for _, draws in measured.values()], axis=0)
                    lines.append(_line(question, sigma, shared, list(cases.values()), value, draws))
                for name, (value, draws) in measured.items():
                    row = _line(question, sigma, name, [cases[name]], value, draws)
                    lines.append(row | {"family": shared, "mean_of_seeds": one})
    return lines


class _Case(NamedTuple):
    """The decisions that a question is about."""

    scores: Array
    """(n, scores)"""
    positive: Flags
    """(n,)"""
    episode: Index
    """(n,)"""
    stratum: Index
    """(E,) scenario of each episode"""


def _case(question: Question, drives: Sequence[Drive]) -> _Case:
    taken = [drive for drive in drives if drive.scenario in question.among and len(drive.steps)]
    names = sorted({drive.scenario for drive in taken})
    scores, positive, episode = [np.zeros((0, len(SCORES)))], [np.zeros(0, dtype=bool)], []
    for drive in taken:
        yes = question.positive(drive)
        asked = yes | question.negative(drive)
        scores.append(drive.scores()[asked])
        positive.append(yes[asked])
        episode.append(int(asked.sum()))
    return _Case(
        np.concatenate(scores),
        np.concatenate(positive),
        np.repeat(np.arange(len(taken)), episode).astype(np.int64),
        np.array([names.index(drive.scenario) for drive in taken], dtype=np.int64),
    )


def _answer(case: _Case, sigma: int) -> tuple[float, Array]:
    """AUROC of one sigma, and its bootstrap's draws (RESAMPLES,); nan where there is none."""
    scores = np.ascontiguousarray(case.scores[:, sigma])
    known = np.isfinite(scores).all()  # sigma by route may not be known
    value = auroc(scores, case.positive) if known else math.nan
    if math.isnan(value):
        return value, np.full(RESAMPLES, math.nan)
    return value, auroc_draws(scores, case.positive, case.episode, case.stratum)


def _line(
    question: Question, sigma: str, agent: str, cases: Sequence[_Case], value: float, draws: Array
) -> dict[str, Any]:
    low, high = percentile_interval(value, draws)[1:]
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
    """One line for each question, `SHOWN` beside each other; families rather than single agents."""
    headings = ["agent", "task", "scenarios", "episodes", "positive", *SHOWN]
    grouped: dict[tuple[str, str, str], list[Mapping]] = {}
    for line in lines:
        if line["mean_of_seeds"] and line["sigma"] in SHOWN:
            grouped.setdefault((line["family"], line["task"], line["scenarios"]), []).append(line)
    rows = []
    for key, members in grouped.items():
        values = [interval_of(m, "auroc", 3) for m in members]
        rows.append([*key, str(members[0]["episodes"]), str(members[0]["positive_episodes"]), *values])
    return markdown(headings, rows, left=3)


def marks(lines: Sequence[Mapping]) -> list[Mark]:
    """What the figure shows."""
    return [
        Mark(
            m["family"], m["task"], m["scenarios"], m["sigma"], (m["auroc"], m["auroc_low"], m["auroc_high"])
        )
        for m in lines
        if m["mean_of_seeds"] and m["sigma"] in SHOWN
    ]


def limits_of(agent: str) -> dict[str, float]:
    """sigma_l of an agent, reward units: `total`, and `route` where it is known."""
    folder = _folder(agent)
    if folder is None:
        return {}
    learnt = load_learnt(folder)
    by_route = RouteSigma.among(learnt.arrays)
    found = {"total": learnt.percentiles, "route": None if by_route is None else by_route.percentiles}
    return {kind: limits[0] for kind, limits in found.items() if limits is not None}


def slack_lines(agent: str, limits: Mapping[str, float], drives: Sequence[Drive]) -> list[dict[str, Any]]:
    """Lines of `sigma_slack.csv`: shares in percent, of decisions."""
    inside = [drive for drive in drives if drive.scenario in IN_DISTRIBUTION]
    lines = []
    for kind, limit in limits.items():
        line: dict[str, Any] = {"agent": agent, "sigma": kind, "sigma_l": limit}
        line |= _share("above_inside", [drive.of(kind) > limit for drive in inside])
        for task in TASKS[:3]:
            asked = Question(task, ALL, frozenset())
            below = [drive.of(kind)[asked.positive(drive)] < limit for drive in drives]
            line |= _share(f"relaxed_{task.replace(' ', '_')}", below)
        lines.append(line)
    return lines


def _share(name: str, flags: Sequence[Flags]) -> dict[str, Any]:
    every = np.concatenate([np.zeros(0, dtype=bool), *flags])
    return {name: 100.0 * float(every.mean()) if every.size else math.nan, f"{name}_decisions": every.size}


def slack_markdown(lines: Sequence[Mapping]) -> str:
    """The shares, to read."""
    shares = [
        ("above_inside", "above sigma_l in distribution (%)"),
        ("relaxed_violation", "relaxed before a violation (%)"),
        ("relaxed_violation_seen", "… cause seen (%)"),
        ("relaxed_violation_hidden", "… cause hidden (%)"),
    ]
    rows = [[line["agent"], line["sigma"], *(number(line[key]) for key, _ in shares)] for line in lines]
    return markdown(["agent", "sigma", *(text for _, text in shares)], rows, left=2)
