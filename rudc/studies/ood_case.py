"""An out-of-distribution episode in full: the left turn that three accident vehicles block (paper, Sec. "Case
Studies in OOD Scenarios", Fig. "ood_case": ways over time coloured by h, controls and corrections, sigma,
time cost). Which episode, and what h is: rudc/studies/case.py.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from rudc.errors import InputError
from rudc.evaluation.runner import EpisodeRunner
from rudc.evaluation.sweep import Progress, run_sweep
from rudc.evaluation.tasks import SweepPlan
from rudc.evaluation.text import csv_text, markdown, number
from rudc.files import make_folder
from rudc.reporting.case import Case, draw_cases
from rudc.scenario import find_scenarios
from rudc.studies.base import Order, Report, kinds_of_errors, write
from rudc.studies.case import MS, Driver, case_lines, chosen_seed, drive, drivers, seeds_note
from rudc.studies.page import page

SCENARIO = "blocked_left_turn"
DRIVERS = {
    "quick": (Driver("RUDC-T", "rudc-t"), Driver("w/o course", "rudc-t:outlook.course=off")),
    "full": (
        Driver("RUDC-T", "rudc-t"),
        Driver("RUDC-E", "rudc-e"),
        Driver("w/o course", "rudc-t:outlook.course=off"),
        Driver("w/o CBF, course", "rudc-wo-cbf:outlook.course=off"),
    ),
}
"""shown when no agents are named, by budget; without courses nobody leads the agent round the accident, as in
the paper
"""
EPISODES = {"quick": 2, "full": 20}
"""episodes from which the one shown is chosen, by budget"""
WORDS = {
    "least h": "smallest barrier towards a vehicle in the episode shown; below 0 it is nearer than the "
    "filter allows",
    "largest correction": "the most that the correction changed an action, both numbers scaled to [-1, 1]",
    "σ at first, peak, at": "sigma_total in the first second, its largest value, and when that was",
    "mean, peak (ms)": "processor's time of a decision",
    "SR of all": "share of successes in all episodes driven",
}
ROWS = ("map", "way", "acceleration", "steering", "sigma", "time")


def run(order: Order, progress: Callable[[str], Progress]) -> Report:
    """Drive all seeds, choose one, and drive that again in full."""
    shown = drivers(order.agents, DRIVERS[order.budget])
    (scenario,) = find_scenarios([SCENARIO])
    make_folder(order.out)
    names = tuple(driver.agent for driver in shown)
    plan = SweepPlan((scenario,), names, order.episodes or EPISODES[order.budget], order.seed)
    result = run_sweep(
        plan, order.out / "sweep", EpisodeRunner, workers=order.workers, resume=order.resume,
        progress=progress("ood-case"),
    )  # fmt: skip
    seed = chosen_seed(result.rows, names)
    if seed is None:
        raise InputError("no episode was driven by all agents; the sweep's folder says why")
    cases = [drive(scenario, driver, seed) for driver in shown]
    lines = [summary(driver, case, result.rows) for driver, case in zip(shown, cases, strict=True)]
    said = (
        f"Each agent drove {plan.episodes} episode(s) of {SCENARIO}; the one shown was driven again. "
        f"{seeds_note(result.rows, seed, shown)}"
    )
    table = page("ood-case", order, said, [as_markdown(lines)], WORDS)
    files = (
        write(order.out / "ood_case.csv", csv_text([line for case in cases for line in case_lines(case)])),
        write(order.out / "ood_case_agents.csv", csv_text(lines)),
        write(order.out / "ood_case.md", table),
        draw_cases(cases, order.out / "ood_case.png", ROWS),
    )
    return Report(table, files, errors=kinds_of_errors(result.rows))


def summary(driver: Driver, case: Case, rows: Sequence[Mapping[str, str]]) -> dict[str, Any]:
    """A line about the episode that is shown, beside how often the agent succeeds in all of them. Times are
    the processor's.
    """
    own = [row for row in rows if row["agent"] == driver.agent and not row["error"]]
    ego = case.ego
    spent = np.sum([ego[f"{part}_ms"] for part in MS], axis=0)
    sigma = ego["sigma_total"]
    peak = None if np.isnan(sigma).all() else int(np.nanargmax(sigma))
    return {
        "agent": driver.label,
        "settings": driver.agent,
        "outcome": case.outcome,
        "duration_s": case.duration_s,
        "least_h_m2": case.least_h_m2,
        "largest_correction": float(ego["correction"].max()),
        "sigma_first_second": float(np.mean(sigma[:10])),
        "sigma_peak": math.nan if peak is None else float(sigma[peak]),
        "sigma_peak_at_s": math.nan if peak is None else float(ego["time_s"][peak]),
        "decision_mean_ms": float(spent.mean()),
        "decision_peak_ms": float(spent.max()),
        "episodes": len(own),
        "SR": 100.0 * sum(row["outcome"] == "success" for row in own) / max(len(own), 1),
    }


def as_markdown(lines: Sequence[Mapping[str, Any]]) -> str:
    """The lines, to read."""
    headings = [
        "agent", "settings", "outcome", "duration (s)", "least h (m²)", "largest correction", "σ at first",
        "σ peak", "at (s)", "mean (ms)", "peak (ms)", "SR of all (%)",
    ]  # fmt: skip
    rows = []
    for line in lines:
        told = [number(value, 2) for value in list(line.values())[3:11]]
        of_all = f"{line['SR']:.0f} ({line['episodes']} episodes)"
        rows.append([line["agent"], line["settings"], line["outcome"], *told, of_all])
    return markdown(headings, rows, left=3)
