"""How long a decision takes, and where the time goes (paper, Sec. "Case Studies in OOD Scenarios", Fig.
"ood_case" d: HOCBF 43.8 %, critics 40.7 %, policy 15.5 % of 21.88 ms, peak below 60 ms).

Of each agent: mean, 99th percentile and peak (ms) of a decision and of each of its parts, and the parts'
shares of the mean, in processor time, to which other programs do not add; and the same of a whole decision in
wall time, to which other programs do add. A decision is one call of `act`; `PLACES` says which functions are
which part, by a stopwatch that is there only while the study runs (rudc/studies/stopwatch.py). Agents drive
one after the other in one process, whatever the number of workers asked for; the first episode that an agent
drives of a scenario warms it up and is not counted.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from rudc.agents.base import Agent, Decision
from rudc.agents.registry import make_agent
from rudc.arrays import Array
from rudc.env.episode import Episode, StepResult
from rudc.errors import InputError
from rudc.evaluation.record import EpisodeRecord
from rudc.evaluation.sweep import Progress, run_sweep
from rudc.evaluation.tasks import SweepPlan, Task
from rudc.evaluation.text import MISSING, csv_text, markdown
from rudc.files import make_folder, past_links
from rudc.reporting.latency import Cost, draw_latency
from rudc.scenario import find_scenarios
from rudc.studies.base import Order, Report, kinds_of_errors, write
from rudc.studies.page import page
from rudc.studies.step_files import StepRunner, read_steps
from rudc.studies.stopwatch import Stopwatch, timing
from rudc.world.scene import Scene

SCENARIOS = ("dense_left_turn", "blocked_left_turn")
"""the paper measures in the second"""
AGENTS = {
    "quick": ("rudc-t", "rudc-wo-cbf"),
    "full": ("rudc-t", "rudc-e", "rudc-wo-cbf", "sac", "planner", "gap-acceptance+ttcbf"),
}
"""agents that drive when none are named, by budget"""
EPISODES = {"quick": 2, "full": 20}
"""for each scenario and agent, by budget"""
PLACES = {
    "rudc.agents.learned:observe_flat": "observation",
    "rudc.learning.inference:Decider.action": "policy",
    "rudc.learning.inference:Decider.uncertainty": "critics",
    "rudc.agents.route_sigma:RouteSigma.of": "critics",
    "rudc.safety.residual:ResidualPredictor.__call__": "residual",
    "rudc.safety.constraints:ConstraintBuilder.build": "constraints",
    "rudc.safety.filter:SafetyFilter.filter": "rows",
    "rudc.safety.qp:PlanarSolver.solve": "QP",
    "rudc.safety.qp:NamedSolver.solve": "QP",
    "rudc.safety.last_resort:LastResort.instead_of": "last resort",
    "rudc.agents.of_actions:OfActions.correct": "correction",
    "rudc.agents.adaptation:Adaptation.see": "plant",
    "rudc.agents.adaptation:Adaptation.govern": "plant",
    "rudc.agents.courses:Courses.see": "course",
    "rudc.agents.courses:Courses.govern": "course",
}
"""function -> the part of a decision that it is. `constraints`: whom and which edges the filter keeps clear
of, with its gate; `rows`: their derivatives, and what the filter does besides solving; `correction`: all of a
baseline's but its QP
"""
REST = "rest"
"""what is in none of them; all of a decision, of drivers that have no such parts"""
ALL = "both"
WALL = "by the wall's clock"
PARTS = tuple(dict.fromkeys((*PLACES.values(), REST)))
CBF = ("residual", "constraints", "rows", "QP", "last resort")
"""parts that the paper calls HOCBF"""

WORDS = {
    "both": "the two scenarios together",
    "mean, p99, peak": "of all decisions, in the processor's time, to which other programs do not add; p99: "
    "99 of 100 decisions take less",
    "wall": "the same by the wall's clock, to which other programs do add",
    "observation": "what the policy sees is computed",
    "policy": "it chooses an action",
    "critics": "sigma is computed",
    "residual": "w, what the filter's model leaves out",
    "constraints": "whom and which edges the filter keeps clear of",
    "rows": "the filter's inequalities, and what it does besides solving",
    "QP": "solving them",
    "last resort": "a way to stop or to go on is looked for",
    "correction": "all of a baseline's correction but its QP",
    "plant": "the plant monitor",
    "course": "a line round what blocks the route, and the speeds on it",
    "rest": "what is in none of these parts; the whole decision of drivers without them",
    "HOCBF": "residual, constraints, rows, QP and last resort together, as in the paper",
}


class LatencyLog:
    """ms of the parts of each decision, by the wall's clock of the whole, and whether it counts."""

    columns = (*PARTS, WALL, "counts")

    def __init__(self, stopwatch: Stopwatch, wall: Stopwatch, *, counts: bool) -> None:
        self._stopwatch, self._wall, self._counts = stopwatch, wall, counts
        self._rows: list[list[float]] = []
        for clock in (stopwatch, wall):
            clock.take()

    def watch(self, scene: Scene, decision: Decision, result: StepResult) -> None:
        """Keep a decision."""
        spent = self._stopwatch.take()
        wall = self._wall.take().get(WALL, 0.0)
        self._rows.append([*(spent.get(part, 0.0) for part in PARTS), wall, float(self._counts)])

    def steps(self) -> Array:
        """(steps, parts + 2)."""
        return np.array(self._rows).reshape(len(self._rows), len(PARTS) + 2)


class LatencyRunner:
    """Runs episodes with a stopwatch in their decisions."""

    def __init__(self, folder: Path) -> None:
        self._stopwatch, self._wall = Stopwatch(), Stopwatch(time.perf_counter)
        self._warm: set[tuple[str, str]] = set()
        self._run = StepRunner(folder, self._begin)

    def _begin(self, episode: Episode, agent: Agent) -> LatencyLog:
        own = type(agent).act.__get__(agent)
        timed = self._wall.timed(WALL, self._stopwatch.timed(REST, own))
        setattr(agent, "act", timed)  # noqa: B010 -- to a checker, `act` is a method
        return LatencyLog(self._stopwatch, self._wall, counts=self._drives in self._warm)

    def __call__(self, task: Task) -> EpisodeRecord:
        """Run the task's episode."""
        self._drives = (task.agent, task.scenario.name)
        with timing(self._stopwatch, PLACES):
            record = self._run(task)
        if record.error:  # the runner makes all agents anew after it
            self._warm.clear()
        else:
            self._warm.add(self._drives)
        return record


def run(order: Order, progress: Callable[[str], Progress]) -> Report:
    """Drive and measure."""
    agents = order.agents or AGENTS[order.budget]
    for name in agents:
        make_agent(name)
    with timing(Stopwatch(), PLACES):  # fails here rather than in every episode
        make_folder(order.out)
    steps = past_links(order.out) / "steps"
    episodes = 1 + (order.episodes or EPISODES[order.budget])
    plan = SweepPlan(
        tuple(find_scenarios(list(SCENARIOS))), tuple(dict.fromkeys(agents)), episodes, order.seed
    )
    result = run_sweep(
        plan,
        order.out / "sweep",
        partial(LatencyRunner, steps),
        resume=order.resume,
        progress=progress("latency"),
    )
    spent: dict[tuple[str, str], list[Array]] = {}
    for row, found in read_steps(steps, result.rows, LatencyLog.columns):
        for scenario in (row["scenario"], ALL):
            spent.setdefault((row["agent"], scenario), []).append(found[found[:, -1] > 0, :-1])
    lines = [
        line
        for key in sorted(spent, key=_place(plan.agents))
        for line in lines_of(*key, np.concatenate(spent[key]))
    ]
    if not lines:
        raise InputError("no episode could be run to be timed; its folder says why")
    said = (
        f"Each agent drove {episodes - 1} episode(s) of each scenario, one after the other in one process, "
        "after one that is not counted. How long a decision takes, and which share of the mean each of its "
        "parts takes (%)."
    )
    table = page("latency", order, said, [as_markdown(lines)], WORDS)
    files = (
        write(order.out / "latency.csv", csv_text(lines)),
        write(order.out / "latency.md", table),
        draw_latency(costs(lines), ALL, order.out / "latency.png"),
    )
    return Report(table, files, errors=kinds_of_errors(result.rows))


def _place(agents: Sequence[str]) -> Callable[[tuple[str, str]], tuple[int, int]]:
    """Where an agent and a scenario stand in the table."""
    scenarios = (*SCENARIOS, ALL)
    return lambda key: (agents.index(key[0]), scenarios.index(key[1]))


def lines_of(agent: str, scenario: str, spent: Array) -> list[dict[str, Any]]:
    """Lines of `latency.csv`: the whole decision, each part that took any time, and the parts that the paper
    calls HOCBF together. `spent`: (decisions, parts + 1) ms, the last by the wall's clock.
    """
    if not len(spent):
        return []
    whole = spent[:, :-1].sum(axis=1)
    parts = {part: spent[:, k] for k, part in enumerate(PARTS) if spent[:, k].any()}
    cbf = spent[:, [PARTS.index(part) for part in CBF]].sum(axis=1)
    found = {"all": whole, **parts, **({"HOCBF": cbf} if cbf.any() else {}), WALL: spent[:, -1]}
    return [
        {
            "agent": agent,
            "scenario": scenario,
            "part": part,
            "decisions": len(ms),
            "mean_ms": float(ms.mean()),
            "p99_ms": float(np.percentile(ms, 99)),
            "peak_ms": float(ms.max()),
            "share_percent": math.nan if part == WALL else 100.0 * float(ms.sum() / whole.sum()),
        }
        for part, ms in found.items()
    ]


def as_markdown(lines: Sequence[Mapping[str, Any]]) -> str:
    """The decisions of each agent and scenario, and the parts' shares of their mean."""
    agents: dict[tuple[str, str], dict[str, Mapping[str, Any]]] = {}
    for line in lines:
        agents.setdefault((line["agent"], line["scenario"]), {})[line["part"]] = line
    parts = [part for part in (*PARTS, "HOCBF") if any(part in found for found in agents.values())]
    keys = ("mean_ms", "p99_ms", "peak_ms")
    times = [f"{of}{clock} (ms)" for clock in ("", ", wall") for of in ("mean", "p99", "peak")]
    headings = ["agent", "scenario", "decisions", *times]
    rows = [
        [
            *key,
            str(found["all"]["decisions"]),
            *(f"{found[clock][ms]:.2f}" for clock in ("all", WALL) for ms in keys),
            *(f"{found[part]['share_percent']:.1f}" if part in found else MISSING for part in parts),
        ]
        for key, found in agents.items()
    ]
    return markdown([*headings, *(f"{part} (%)" for part in parts)], rows, left=2)


def costs(lines: Sequence[Mapping[str, Any]]) -> list[Cost]:
    """What the figure shows."""
    return [
        Cost(line["agent"], line["scenario"], line["part"], line["mean_ms"], line["p99_ms"], line["peak_ms"])
        for line in lines
        if line["part"] not in ("HOCBF", WALL)
    ]
