"""Does the safety filter make the same trained agents safer, and what does it cost in standstill?

Variants, for both choices of vehicles that are constrained (`gated`, `all`) and each d_safe (that of the
agent's name alone, where it gives one):

    off        no filter                                     w = 0, no rows
    fixed      the filter as such                            w = 0, delta = 0
    residual   with what its prediction lacks                w,     delta = 0
    slack      with the uncertainty-embedded slack           w = 0, delta(sigma)
    both       as in the paper                               w,     delta(sigma)
    last_resort  and the last resort (rudc/safety/last_resort.py)  w,  delta(sigma)

Those before the last have none, so that they show what the rows alone do.

Every variant drives the same episodes. A change against `off` is therefore one of pairs: of n episodes, b
only with the filter and c only without it end so, and (Bonett and Price 2012)

    change   = (b - c) / n
    interval = p - q +- 1.96 sqrt((p + q - (p - q)^2) / (n + 2))
               with p = (b + 1) / (n + 2), q = (c + 1) / (n + 2)

Rates have Wilson intervals. All intervals are about episodes, for these agents, and take those of different
training seeds, which meet the same traffic, for independent; the spread over training seeds stands beside as
least and largest. The out-of-distribution scenarios together get about as many
episodes as the two tasks, the same for each.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from rudc.agents.checkpoint import find_checkpoint, load_learnt
from rudc.agents.correction import CbfSettings
from rudc.agents.registry import make_agent
from rudc.agents.variation import split
from rudc.errors import InputError
from rudc.evaluation.columns import happened, metric_of
from rudc.evaluation.metrics import average, numbers
from rudc.evaluation.runner import EpisodeRunner
from rudc.evaluation.statistics import paired_change, summarise_rate
from rudc.evaluation.sweep import Progress, run_sweep
from rudc.evaluation.tasks import SweepPlan
from rudc.files import make_folder
from rudc.reporting.text import MISSING, csv_text, interval, markdown
from rudc.reporting.tradeoff import Point, draw_tradeoff
from rudc.studies.base import (
    Order,
    Report,
    chosen_agents,
    family,
    in_distribution,
    kinds_of_errors,
    out_of_distribution,
    write,
)

VARIANTS = {
    "fixed": (False, False, False),
    "residual": (True, False, False),
    "slack": (False, True, False),
    "both": (True, True, False),
    "last_resort": (True, True, True),
}
"""name -> whether residuals, slack and the last resort are at work"""
D_SAFE = {"quick": (0.1, 0.5), "full": (0.1, 0.5, 0.8)}
"""m, by budget"""
CONSTRAINED = ("gated", "all")
EPISODES = {"quick": 3, "full": 84}
"""for each task and agent, by budget; full: 504 for two tasks and three training seeds"""
INSIDE, OUTSIDE = "in distribution", "out of distribution"
RATES = ("SR", "VR", "FR")
_VARIED = tuple(f"correction.{key}" for key in ("kind", "residual", "last_resort", "constrained"))

Row = Mapping[str, str]


@dataclass(frozen=True)
class Variant:
    """An agent with its filter set in one way."""

    agent: str
    """full name, as in `episodes.csv`"""
    trained: str
    """the agent that is varied"""
    family: str
    """the same without its training seed"""
    kind: str
    """off, or of `VARIANTS`"""
    constrained: str = ""
    d_safe: float = math.nan
    """m"""

    @property
    def setting(self) -> tuple[str, str, str, float]:
        """What the agents have in common that are pooled."""
        return self.family, self.kind, self.constrained, -1.0 if math.isnan(self.d_safe) else self.d_safe


def run(order: Order, progress: Callable[[str], Progress]) -> Report:
    """Sweep all variants and put them side by side."""
    variants = [v for name in chosen_agents(order) for v in variants_of(name, D_SAFE[order.budget])]
    for variant in variants:
        make_agent(variant.agent)
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
    lines = aggregate(rows, variants)
    table = as_markdown(lines)
    files = (
        write(order.out / "filter.csv", csv_text(lines)),
        write(order.out / "filter.md", table),
        draw_tradeoff(points(lines), order.out / "filter.png"),
    )
    return Report(table, files, errors=kinds_of_errors([row for part in rows.values() for row in part]))


def variants_of(name: str, distances: Sequence[float]) -> list[Variant]:
    """All variants of an agent, with the d_safe of its name, else the given ones. Raises AgentError if there
    is no such agent, InputError if it cannot be varied.
    """
    make_agent(name)
    whole, text = split(name)
    settings = dict(part.split("=", 1) for part in text.split(",")) if text else {}
    settings = {key.strip(): value.strip() for key, value in settings.items()}
    taken = [key for key in _VARIED if key in settings]
    if taken:
        raise InputError(f"{name}: the study itself sets {', '.join(taken)}; leave that out")
    gain = _gain(whole, settings.pop("correction.slack.gain", ""))
    if "correction.d_safe" in settings:
        distances = (float(settings.pop("correction.d_safe")),)
    off = whole.rpartition("+")[0] if gain is None else _named(whole, {"correction.kind": "none"})
    found = [Variant(off, name, family(name), "off")]
    for constrained in CONSTRAINED:
        for kind, (residual, slack, last_resort) in VARIANTS.items():
            if slack and gain is None:
                continue
            for d_safe in distances:
                own = {
                    "correction.constrained": constrained,
                    "correction.d_safe": f"{d_safe:g}",
                    "correction.residual": "on" if residual else "off",
                    "correction.last_resort": "on" if last_resort else "off",
                }
                if gain is not None:
                    own |= {"correction.slack.gain": gain if slack else "0"}
                varied = _named(whole, settings | own)
                found.append(Variant(varied, name, family(name), kind, constrained, d_safe))
    return found


def _gain(whole: str, wanted: str) -> str | None:
    """The slack's gain: the one wanted, the agent's own, or that of its algorithm; None where a filter stands
    behind a driver, which has no slack. Raises InputError if there is no filter, or no gain.
    """
    folder = find_checkpoint(whole)
    if folder is None and "+" in whole:
        return None
    learnt = None if folder is None else load_learnt(folder)
    if learnt is None or not isinstance(learnt.config.correction, CbfSettings):
        raise InputError(f"{whole} has no safety filter to study; put one behind it: {whole}+ttcbf")
    if learnt.percentiles is None:
        raise InputError(f"{whole} does not say what sigma is usual, so there is no slack to study")
    usual = learnt.config.entry.defaults.get("correction", {}).get("slack", {}).get("gain", 0.0)
    own = learnt.config.correction.slack.gain or usual
    if not (wanted or own):
        hint = f"--agent {whole}:correction.slack.gain=0.5"
        raise InputError(f"{whole} has no gain of its slack; give one: {hint}")
    return wanted or f"{own:g}"


def _named(whole: str, settings: Mapping[str, str]) -> str:
    return f"{whole}:{','.join(f'{key}={value}' for key, value in settings.items())}"


def aggregate(rows: Mapping[str, Sequence[Row]], variants: Sequence[Variant]) -> list[dict[str, object]]:
    """Lines of `filter.csv`: each variant in each domain and in its scenarios, training seeds pooled."""
    by_name = {variant.agent: variant for variant in variants}
    lines = []
    for domain, members in rows.items():
        scenarios = list(dict.fromkeys(row["scenario"] for row in members))
        for scope in (domain, *scenarios):
            inside = [row for row in members if scope in (domain, row["scenario"])]
            lines += _scope(domain, scope, inside, by_name)
    return lines


def _scope(
    domain: str, scope: str, rows: Iterable[Row], by_name: Mapping[str, Variant]
) -> list[dict[str, object]]:
    groups: dict[tuple, list[Row]] = {}
    without: dict[tuple[str, ...], Row] = {}
    for row in rows:
        variant = by_name[row["agent"]]
        groups.setdefault(variant.setting, []).append(row)
        if variant.kind == "off" and not row["error"]:
            without[_episode(row, by_name)] = row
    lines: list[dict[str, object]] = []
    for members in groups.values():
        first = by_name[members[0]["agent"]]
        done = [row for row in members if not row["error"]]
        line: dict[str, object] = {
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


def _episode(row: Row, by_name: Mapping[str, Variant]) -> tuple[str, ...]:
    return by_name[row["agent"]].trained, row["scenario"], row["seed"]


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
    pairs = [(row, without.get(_episode(row, by_name))) for row in rows]
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
    """The pooled lines, most telling columns."""
    headings = [
        "agent", "scenarios", "constrained", "variant", "d_safe (m)", "episodes",
        *(f"{rate} (%)" for rate in RATES), "VR − off", "FR − off",
        "interventions (%)", "engaged (%)", "mean correction", "infeasible (%)",
    ]  # fmt: skip
    rows = []
    for line in lines:
        if line["scenario"] != "all":
            continue
        rates = [interval(line[r], line[f"{r}_low"], line[f"{r}_high"]) for r in RATES]
        changes = [
            MISSING
            if line["variant"] == "off"
            else interval(*(line[f"{r}_change{end}"] for end in ("", "_low", "_high")))
            for r in ("VR", "FR")
        ]
        d_safe = MISSING if math.isnan(line["d_safe_m"]) else f"{line['d_safe_m']:g}"
        where = [line["agent"], line["domain"], line["constrained"] or MISSING, line["variant"], d_safe]
        effort = [
            interval(line["interventions_percent"], math.nan, math.nan),
            interval(line["engaged_percent"], math.nan, math.nan),
            interval(line["mean_correction"], math.nan, math.nan, 3),
            interval(line["infeasible_percent"], math.nan, math.nan, 2),
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
        if line["scenario"] == "all"
    ]
