"""What the parts of RUDC do in one and the same dense left turn, and when the filter corrects (paper, Fig.
"ablution_case": ways, uncertainty against correction, controls and sigma).

The variants are one agent with parts taken away, so that they differ in nothing else: without CBF; a fixed
filter, without slack, residual and last resort; and that filter with all vehicles constrained, as the paper's
Only-TTCBF. Agents that were trained without those parts are named with --agent. Which episode, and what h is:
rudc/studies/case.py; the turning point: rudc/studies/turning.py.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from rudc.agents.base import Agent, Decision
from rudc.arrays import Array, Index
from rudc.env.episode import Episode, StepResult
from rudc.errors import InputError
from rudc.evaluation.metrics import group_metrics
from rudc.evaluation.sweep import Progress, run_sweep
from rudc.evaluation.tasks import SweepPlan
from rudc.evaluation.text import csv_text, interval_of, markdown, number
from rudc.files import make_folder, past_links
from rudc.reporting.case import draw_cases
from rudc.reporting.density import Cloud, density
from rudc.scenario import find_scenarios
from rudc.studies.base import Order, Report, kinds_of_errors, write
from rudc.studies.case import Driver, case_lines, chosen_seed, drive, drivers, scaled_correction, seeds_note
from rudc.studies.page import OF_RATES, page
from rudc.studies.step_files import StepRunner, read_steps
from rudc.studies.turning import bins, turning_point
from rudc.world.scene import Scene

SCENARIO = "dense_left_turn"
_FIXED = "rudc-t:correction.slack.gain=0,correction.residual=off,correction.last_resort=off"
_ALL = f"{_FIXED},correction.constrained=all"
DRIVERS = {
    "quick": (Driver("RUDC-T", "rudc-t"), Driver("fixed, all SVs", _ALL)),
    "full": (
        Driver("RUDC-T", "rudc-t"),
        Driver("w/o CBF", "rudc-t:correction.kind=none"),
        Driver("fixed TTCBF", _FIXED),
        Driver("fixed, all SVs", _ALL),
    ),
}
"""shown when no agents are named, by budget"""
EPISODES = {"quick": 4, "full": 60}
"""by budget: decisions are counted in all of them, and the episode shown is chosen from them"""
ROWS = ("map", "density", "acceleration", "steering", "sigma")
WORDS = {
    **OF_RATES,
    "decisions": "of all episodes, of agents that state sigma",
    "corrected": "share of them that the filter changed by more than 0.01, both numbers scaled to [-1, 1]",
    "turning point": "sigma_total from which on the median of the correction, or its 90th percentile, is "
    "clearly above 0.01; – where there is none",
}
RATES = ("SR", "VR", "FR")


class CorrectionLog:
    """sigma_total and the correction of each decision."""

    columns: tuple[str, ...] = ("sigma_total", "correction")

    def __init__(self, episode: Episode, agent: Agent) -> None:
        self._rows: list[list[float]] = []

    def watch(self, scene: Scene, decision: Decision, result: StepResult) -> None:
        """Keep a decision."""
        sigma = np.nan if decision.uncertainty is None else float(decision.uncertainty.total)
        self._rows.append([sigma, scaled_correction(decision, scene)])

    def steps(self) -> Array:
        """(steps, 2)."""
        return np.array(self._rows).reshape(len(self._rows), 2)


def run(order: Order, progress: Callable[[str], Progress]) -> Report:
    """Drive all seeds with all variants, choose one seed, and drive that again in full."""
    shown = drivers(order.agents, DRIVERS[order.budget])
    (scenario,) = find_scenarios([SCENARIO])
    make_folder(order.out)
    steps, names = past_links(order.out) / "steps", tuple(driver.agent for driver in shown)
    plan = SweepPlan((scenario,), names, order.episodes or EPISODES[order.budget], order.seed)
    result = run_sweep(
        plan, order.out / "sweep", partial(StepRunner, steps, CorrectionLog), workers=order.workers,
        resume=order.resume, progress=progress("ablation-case"),
    )  # fmt: skip
    seed = chosen_seed(result.rows, names)
    if seed is None:
        raise InputError("no episode was driven by all agents; the sweep's folder says why")
    cases = [drive(scenario, driver, seed) for driver in shown]
    stated: dict[str, list[Array]] = {name: [] for name in names}
    for row, found in read_steps(steps, result.rows, CorrectionLog.columns):
        stated[row["agent"]].append(found)
    clouds = {driver.label: cloud_of(stated[driver.agent]) for driver in shown}
    lines = summaries(shown, clouds, result.rows)
    binned = [{"agent": label, **b._asdict()} for label, cloud in clouds.items() for b in cloud.bins]
    said = (
        f"Each variant drove {plan.episodes} episode(s) of {SCENARIO}; the one shown was driven again. "
        f"{seeds_note(result.rows, seed, shown)}"
    )
    table = page("ablation-case", order, said, [as_markdown(lines)], WORDS)
    files = (
        write(order.out / "ablation_case.csv", csv_text([m for case in cases for m in case_lines(case)])),
        write(order.out / "ablation_case_agents.csv", csv_text(lines)),
        *([write(order.out / "ablation_case_sigma.csv", csv_text(binned))] if binned else []),
        write(order.out / "ablation_case.md", table),
        draw_cases(cases, order.out / "ablation_case.png", ROWS, {"density": density(clouds)}),
    )
    return Report(table, files, errors=kinds_of_errors(result.rows))


def cloud_of(episodes: Sequence[Array]) -> Cloud:
    """The cloud of the decisions of several episodes, (steps, 2) each: sigma and correction. Empty where no
    sigma is stated, without bins where nothing is corrected.
    """
    known = [steps for steps in episodes if np.isfinite(steps).all()]
    if not known:
        return Cloud(np.zeros(0), np.zeros(0))
    sigma, correction = np.concatenate(known).T
    episode: Index = np.repeat(np.arange(len(known)), [len(steps) for steps in known])
    if not correction.any():
        return Cloud(sigma, correction)
    found = bins(sigma, correction, episode)
    return Cloud(sigma, correction, tuple(found), turning_point(found), turning_point(found, "p90"))


def summaries(
    shown: Sequence[Driver], clouds: Mapping[str, Cloud], rows: Sequence[Mapping[str, str]]
) -> list[dict[str, Any]]:
    """A line for each variant: how its episodes ended, and where its corrections begin."""
    groups = {group.key[0]: group for group in group_metrics(rows, ("agent",))}
    lines = []
    for driver in shown:
        group, cloud = groups[driver.agent], clouds[driver.label]
        line: dict[str, Any] = {"agent": driver.label, "settings": driver.agent, "episodes": group.episodes}
        for rate in RATES:
            value = group.metrics[rate]
            line |= {rate: value.mean, f"{rate}_low": value.low, f"{rate}_high": value.high}
        line |= {
            "decisions": len(cloud.sigma),
            "corrected_percent": 100.0 * float((cloud.correction > 0.01).mean())
            if len(cloud.sigma)
            else np.nan,
            "turning_point": cloud.turning,
            "turning_point_p90": cloud.turning_p90,
        }
        lines.append(line)
    return lines


def as_markdown(lines: Sequence[Mapping[str, Any]]) -> str:
    """The lines, to read."""
    headings = [
        "agent", "settings", "episodes", *(f"{rate} (%)" for rate in RATES), "decisions", "corrected (%)",
        "turning point of the median", "of the 90th percentile",
    ]  # fmt: skip
    rows = [
        [
            line["agent"],
            line["settings"],
            str(line["episodes"]),
            *(interval_of(line, rate) for rate in RATES),
            str(line["decisions"]),
            *(number(line[k], 2) for k in ("corrected_percent", "turning_point", "turning_point_p90")),
        ]
        for line in lines
    ]
    return markdown(headings, rows, left=2)
