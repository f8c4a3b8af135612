"""Does the safety filter make the same trained agents safer, what does it cost in standstill, and does slack
that follows sigma beat every constant one?

Variants: rudc/studies/filter_variants.py. Every variant drives the same episodes, so a change is one of
pairs (`paired_change` in rudc/evaluation/statistics.py): `filter.csv` has changes against `off`,
`filter_pairs.csv` those of each adaptive variant against each constant one (rudc/studies/filter_pairs.py).
The row `oracle` cannot be driven: it is `residual` with the filter taken away in every episode that succeeds
without it, the most that any slack could gain by relaxing.

Rates have Wilson intervals. All intervals are about episodes of these agents, and take episodes of different
training seeds for independent, although they have the same traffic; the spread over training seeds stands
beside them as least and largest. The out-of-distribution scenarios together get about as many
episodes as the two tasks, the same for each.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from rudc.agents.registry import make_agent
from rudc.errors import InputError
from rudc.evaluation.columns import happened, metric_of
from rudc.evaluation.metrics import average, numbers
from rudc.evaluation.runner import EpisodeRunner
from rudc.evaluation.statistics import paired_change, summarise_rate
from rudc.evaluation.sweep import Progress, run_sweep
from rudc.evaluation.tasks import SweepPlan
from rudc.evaluation.text import MISSING, csv_text, interval_of, markdown, number
from rudc.files import make_folder
from rudc.reporting.tradeoff import DRAWN, OFF, Point, draw_tradeoff
from rudc.studies.base import (
    Order,
    Report,
    chosen_agents,
    in_distribution,
    kinds_of_errors,
    out_of_distribution,
    write,
)
from rudc.studies.filter_pairs import Row, episode_of, oracle, pairs, pairs_markdown
from rudc.studies.filter_variants import Variant, variants_of
from rudc.studies.page import OF_CONSTRAINED, OF_RATES, page

D_SAFE = {"quick": (0.1, 0.5), "full": (0.1, 0.5, 0.8)}
"""m, by budget"""
EPISODES = {"quick": 3, "full": 84}
"""for each task and agent, by budget; full: 504 for two tasks and three training seeds"""
INSIDE, OUTSIDE = "in distribution", "out of distribution"
RATES = ("SR", "VR", "FR")
WORDS = {
    **OF_RATES,
    **OF_CONSTRAINED,
    "off": "the agent without filter",
    "fixed": "the filter without residual and slack",
    "residual": "the filter with what its model of one step leaves out, w",
    "slack": "the filter with the slack delta(sigma), sigma as in the paper",
    "both": "the filter with residual and slack, as in the paper",
    "last_resort": "the same, and the last resort; all other variants are without",
    "level_route": "residual, and slack by the sigma by route",
    "rate_route": "the same slack as a factor: exp(slack) times the weight of h",
    "level C": "residual, and C m² as slack, whatever sigma is",
    "rate C": "residual, and exp(C) times the weight of h, whatever sigma is: `rate -0.5` is stricter, "
    "`rate 0.5` gives way",
    "oracle": "`residual`, and no filter in each episode that succeeds without: nobody can drive so",
    "d_safe": "the gap to vehicles that the filter adds to the bodies",
    "points": "percentage points: from 95 to 97 % is 2 points; in brackets the 95 % interval",
    "VR − off, FR − off": "change against `off` in the same episodes",
    "interventions": "share of decisions that were clearly changed, by the filter or for course and grip",
    "engaged": "share of decisions that the filter did not pass on at once",
    "infeasible": "share of decisions for which no action satisfies all of the filter's rows",
}
OF_PAIRS = {
    "adaptive, constant": "variants whose slack follows sigma, and whose slack does not",
    "VR change, FR change, speed change": "the adaptive variant's less the constant one's",
    "dominates": "`yes` if the adaptive variant has clearly fewer violations, and neither freezes more nor "
    "is clearly slower; or freezes clearly less, and does not violate more. Clearly: the interval does not "
    "contain 0",
}


def run(order: Order, progress: Callable[[str], Progress]) -> Report:
    """Sweep all variants and put them side by side."""
    variants = [v for name in chosen_agents(order) for v in variants_of(name, D_SAFE[order.budget])]
    trained: dict[str, str] = {}
    for variant in variants:
        make_agent(variant.agent)
        if (first := trained.setdefault(variant.agent, variant.trained)) != variant.trained:
            raise InputError(
                f"{first} and {variant.trained} have the variant {variant.agent} in common, whose episodes "
                "would count for one of them only: study them one by one, each with its own --out"
            )
    domains = {INSIDE: in_distribution(), OUTSIDE: out_of_distribution(order.budget)}
    episodes = order.episodes or EPISODES[order.budget]
    shares = {INSIDE: episodes, OUTSIDE: -(-len(domains[INSIDE]) * episodes // len(domains[OUTSIDE]))}
    make_folder(order.out)
    names = tuple(v.agent for v in variants)
    rows: dict[str, list[dict[str, str]]] = {}
    for domain, scenarios in domains.items():
        plan = SweepPlan(scenarios, names, shares[domain], order.seed)
        folder = order.out / domain.replace(" ", "_")
        rows[domain] = run_sweep(
            plan, folder, EpisodeRunner, workers=order.workers, resume=order.resume, progress=progress(domain)
        ).rows
    lines, compared = aggregate(rows, variants), pairs(rows, variants)
    said = (
        f"Each variant of the filter drove {shares[INSIDE]} episode(s) of each of the two tasks and "
        f"{shares[OUTSIDE]} of each of {len(domains[OUTSIDE])} scenarios out of distribution, the same for "
        "all, with each training seed of an agent."
    )
    tables, words = [as_markdown(lines)], WORDS
    if compared:
        said += " The second table: each adaptive variant against each constant one in the same episodes."
        tables.append(pairs_markdown(compared))
        words = {**WORDS, **OF_PAIRS}
    table = page("filter", order, said, tables, words)
    files = (
        write(order.out / "filter.csv", csv_text(lines)),
        *([write(order.out / "filter_pairs.csv", csv_text(compared))] if compared else []),
        write(order.out / "filter.md", table),
        draw_tradeoff(points(lines), order.out / "filter.png"),
    )
    return Report(table, files, errors=kinds_of_errors([row for part in rows.values() for row in part]))


def aggregate(rows: Mapping[str, Sequence[Row]], variants: Sequence[Variant]) -> list[dict[str, Any]]:
    """Lines of `filter.csv`: each variant in each domain and in its scenarios, training seeds pooled."""
    by_name = {variant.agent: variant for variant in variants}
    lines = []
    for domain, driven in rows.items():
        added, oracles = oracle(driven, by_name)
        by_name |= oracles
        members = [*driven, *added]
        scenarios = list(dict.fromkeys(row["scenario"] for row in members))
        for scope in (domain, *scenarios):
            inside = [row for row in members if scope in (domain, row["scenario"])]
            lines += _scope(domain, scope, inside, by_name)
    return lines


def _scope(
    domain: str, scope: str, rows: Iterable[Row], by_name: Mapping[str, Variant]
) -> list[dict[str, Any]]:
    groups: dict[tuple, list[Row]] = {}
    without: dict[tuple[str, ...], Row] = {}
    for row in rows:
        variant = by_name[row["agent"]]
        groups.setdefault(variant.setting, []).append(row)
        if variant.kind == "off" and not row["error"]:
            without[episode_of(row, by_name)] = row
    lines: list[dict[str, Any]] = []
    for members in groups.values():
        first = by_name[members[0]["agent"]]
        done = [row for row in members if not row["error"]]
        line: dict[str, Any] = {
            "domain": domain,
            "scenario": "all" if scope == domain else scope,
            "agent": first.family,
            "variant": first.kind,
            "constrained": first.constrained,
            "d_safe_m": first.d_safe,
            "training_seeds": len({by_name[row["agent"]].trained for row in members}),
            "episodes": len(done),
            "errors": len(members) - len(done),
        }
        for rate in RATES:
            line |= _rate(rate, done, by_name)
        compared = {} if first.kind == "off" else without
        for rate in ("VR", "FR"):
            line |= _change(rate, done, compared, by_name)
        lines.append(line | _effort(done))
    return lines


def _rate(rate: str, rows: Sequence[Row], by_name: Mapping[str, Variant]) -> dict[str, float]:
    """A rate in percent with its interval, and its least and largest value among the training seeds."""
    pooled = summarise_rate(np.array([happened(rate, row["outcome"]) for row in rows], dtype=bool))
    seeds: dict[str, list[bool]] = {}
    for row in rows:
        seeds.setdefault(by_name[row["agent"]].trained, []).append(happened(rate, row["outcome"]))
    each = [100.0 * float(np.mean(values)) for values in seeds.values()] or [math.nan]
    return {
        rate: pooled.mean,
        f"{rate}_low": pooled.low,
        f"{rate}_high": pooled.high,
        f"{rate}_least_seed": min(each),
        f"{rate}_largest_seed": max(each),
    }


def _change(
    rate: str, rows: Sequence[Row], without: Mapping[tuple[str, ...], Row], by_name: Mapping[str, Variant]
) -> dict[str, float]:
    """Percentage points more than with the filter off, in the same episodes, and the interval."""
    pairs = [(row, without.get(episode_of(row, by_name))) for row in rows]
    pair = [(happened(rate, a["outcome"]), happened(rate, b["outcome"])) for a, b in pairs if b is not None]
    change, low, high = paired_change(len(pair), pair.count((True, False)), pair.count((False, True)))
    return {f"{rate}_change": change, f"{rate}_change_low": low, f"{rate}_change_high": high}


def _effort(rows: Sequence[Row]) -> dict[str, float | int]:
    """How much the filter had to do, over all decisions."""
    found = {}
    for column in ("interventions", "engaged_steps", "mean_correction", "infeasible_steps"):
        metric = metric_of(column)
        assert metric is not None
        found[column] = average(metric, rows)
    return {
        "interventions_percent": found["interventions"],
        "engaged_percent": found["engaged_steps"],
        "mean_correction": found["mean_correction"],
        "infeasible_steps": int(numbers(rows, "infeasible_steps").sum()),
        "infeasible_percent": found["infeasible_steps"],
    }


def as_markdown(lines: Sequence[Mapping]) -> str:
    """The pooled lines, most telling columns. `mean_correction` is none of them: it counts changes for course
    and grip, too, but not those of `off`, so that the two cannot be compared.
    """
    headings = [
        "agent", "scenarios", "constrained", "variant", "d_safe (m)", "episodes",
        *(f"{rate} (%)" for rate in RATES), "VR − off (points)",
        "FR − off (points)",
        "interventions (%)", "engaged (%)", "infeasible (%)",
    ]  # fmt: skip
    rows = []
    for line in lines:
        if line["scenario"] != "all":
            continue
        rates = [interval_of(line, rate) for rate in RATES]
        changes = [
            MISSING if line["variant"] == "off" else interval_of(line, f"{rate}_change")
            for rate in ("VR", "FR")
        ]
        d_safe = MISSING if math.isnan(line["d_safe_m"]) else f"{line['d_safe_m']:g}"
        where = [line["agent"], line["domain"], line["constrained"] or MISSING, line["variant"], d_safe]
        effort = [
            number(line["interventions_percent"]),
            number(line["engaged_percent"]),
            number(line["infeasible_percent"], 2),
        ]
        rows.append([*where, str(line["episodes"]), *rates, *changes, *effort])
    return markdown(headings, rows, left=4)


def points(lines: Sequence[Mapping]) -> list[Point]:
    """What the figure shows: the pooled lines."""
    return [
        Point(
            agent=line["agent"],
            domain=line["domain"],
            constrained=line["constrained"],
            variant=line["variant"],
            d_safe=line["d_safe_m"],
            fr=(line["FR"], line["FR_low"], line["FR_high"]),
            vr=(line["VR"], line["VR_low"], line["VR_high"]),
        )
        for line in lines
        if line["scenario"] == "all" and line["variant"] in (OFF, *DRAWN)
    ]
