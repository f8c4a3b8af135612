"""What a sweep says, in sentences made of the numbers that the page shows."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

from rudc.evaluation.columns import METRICS
from rudc.evaluation.metrics import Group, group_metrics
from rudc.evaluation.tables import cell
from rudc.evaluation.text import rate_decimals
from rudc.evaluation.unfinished import Asked, none_yet
from rudc.hints import listed
from rudc.reporting.report.episodes import Episodes

_RATES = [metric for metric in METRICS if metric.outcomes]
_NAMED = 3
"""scenarios named at most in a sentence"""
_LISTED = 8
"""scenarios listed at most, where no order says which matter"""
_SURE = 0.05
"""McNemar's p from which on a difference may be chance"""
_SELDOM = 0.5
"""an event that happens in fewer of the episodes is worth a sentence"""


def findings(
    episodes: Episodes, agents: Sequence[Group], data: Mapping[str, Any], wanted: Asked | None
) -> list[str]:
    """Sentences, the most important first. `agents`: metrics of each agent over all scenarios; `data`: the
    page's; `wanted`: what the sweep has when it is finished, if that is known.
    """
    so_far = wanted is not None and len(episodes.rows) < wanted.episodes
    comparable, where = _comparable(episodes, agents, so_far)
    ranked = sorted(comparable, key=lambda g: -g.metrics["SR"].mean)
    said = [_size_so_far(episodes, wanted) if so_far and wanted else _size(episodes)]
    if ranked:
        said += _best(ranked, where, episodes, data)
        said += _hard(ranked[0].key[0], data, so_far)
    elif any(group.episodes for group in agents):
        said.append("The agents have finished none of the same episodes yet, so they are not ranked.")
    return [*said, *_events(data, so_far)]


def _size(episodes: Episodes) -> str:
    seeds = len({row["seed"] for row in episodes.rows})
    size = _product(len(episodes.scenarios), len(episodes.agents), seeds, episodes.parameters)
    return f"{_counted(len(episodes.rows), 'episode')}: {size}{_errors(episodes)}."


def _size_so_far(episodes: Episodes, wanted: Asked) -> str:
    """Of an unfinished sweep: what was asked for, and of what there is nothing yet."""
    size = _product(len(wanted.scenarios), len(wanted.agents), len(wanted.seeds), wanted.swept)
    said = f"{len(episodes.rows)} of {wanted.episodes} episodes so far, of {size}{_errors(episodes)}"
    return "; ".join((said, *none_yet(wanted, episodes.scenarios, episodes.agents))) + "."


def _product(scenarios: int, agents: int, seeds: int, swept: Sequence[str]) -> str:
    parts = (_counted(scenarios, "scenario"), _counted(agents, "agent"), _counted(seeds, "seed"))
    return " × ".join(parts) + (f", swept over {', '.join(swept)}" if swept else "")


def _errors(episodes: Episodes) -> str:
    failed = int((~episodes.done).sum())
    return f"; {failed} could not be run" if failed else ""


def _comparable(episodes: Episodes, agents: Sequence[Group], so_far: bool) -> tuple[Sequence[Group], str]:
    """Metrics of each agent that finished any, over the episodes that all of these finished; and which those
    are, in words. `so_far`: whether the sweep is not finished.
    """
    there = [group for group in agents if group.episodes]
    known = {group.key[0] for group in there}
    rows = [row for row in episodes.rows if row["agent"] in known and not row["error"]]
    keys = [tuple(row[name] for name in ("scenario", "seed", *episodes.parameters)) for row in rows]
    times = Counter(keys)
    shared = [row for row, key in zip(rows, keys, strict=True) if times[key] == len(there)]
    if len(shared) == len(rows):
        return there, "over all episodes so far" if so_far else "over all scenarios"
    each = _counted(len(shared) // len(there), "episode")
    return group_metrics(shared, ("agent",), METRICS), f"in the {each} that all finished"


def _best(ranked: Sequence[Group], where: str, episodes: Episodes, data: Mapping[str, Any]) -> list[str]:
    """Who succeeds most often, and how it compares with the next. `where`: in which episodes, in words."""
    first = ranked[0]
    level = [g.key[0] for g in ranked if g.metrics["SR"].mean == first.metrics["SR"].mean]
    if len(level) > 1:
        rate = f"{_rate(first.metrics['SR'].mean)} %"
        said = [f"{listed(level, _LISTED)} succeed equally often {where}, none more often: SR {rate}."]
    else:
        rates = ", ".join(f"{m.name} {cell(m, first.metrics[m.name])}" for m in _RATES)
        place = " succeeds most often" if len(ranked) > 1 else ""
        said = [f"{first.key[0]}{place} {where}: {rates} %."]
    at = {name: i for i, name in enumerate(episodes.agents)}
    for other in ranked[1 : 1 + _NAMED]:
        if told := _against(at[first.key[0]], at[other.key[0]], data):
            said.append(f"{first.key[0]} against {other.key[0]}, in the same episodes: {told}.")
    return said


def _against(first: int, other: int, data: Mapping[str, Any]) -> str:
    """The first agent's rates less the other's, over all scenarios."""
    wanted = [p for p in data["pairs"]["pairs"] if {p["a"], p["b"]} == {first, other}]
    if not wanted:
        return ""
    _, values = wanted[0]["lines"][0]
    sign = 1.0 if wanted[0]["b"] == first else -1.0
    parts = []
    for name, value in zip(data["pairs"]["metrics"], values, strict=True):
        if name not in [m.name for m in _RATES]:
            continue
        change, low, high = sign * value[3] + 0.0, *sorted((sign * value[4], sign * value[5]))
        clear = (low > 0.0 or high < 0.0) and value[8] < _SURE
        chance = "" if clear else f", which may be chance (McNemar's p = {value[8]:.2g})"
        n = rate_decimals(change)
        parts.append(f"{name} {change:+.{n}f} points [{low:+.{n}f}, {high:+.{n}f}]{chance}")
    return f"{'; '.join(parts)} (n = {max(value[0] for value in values)})"


def _hard(agent: str, data: Mapping[str, Any], so_far: bool) -> list[str]:
    """Where the best agent succeeds least."""
    if len(data["scenarios"]) < 2:
        return []
    column = data["agents"].index(agent)
    known = [
        (values[column][0], name)
        for name, values in zip(data["scenarios"], data["heat"]["SR"], strict=True)
        if values[column] is not None
    ]
    hard = [f"{name} ({_rate(rate)} %)" for rate, name in sorted(known)[:_NAMED] if rate < 100.0]
    if not hard:
        everywhere = len(known) == len(data["scenarios"]) and not so_far
        driven = "every scenario" if everywhere else "all scenarios that it drove"
        return [f"{agent} succeeds in every episode of {driven}."]
    return [f"The hardest scenarios for {agent}, by SR: {', '.join(hard)}."]


def _rate(percent: float) -> str:
    return f"{percent:.{rate_decimals(percent)}f}"


def _events(data: Mapping[str, Any], so_far: bool) -> list[str]:
    """Scenarios whose events seldom happen: there the episodes are ordinary ones."""
    seldom, all_known = [], bool(data["events"])
    for entry in data["events"]:
        known = sum(line[0] for line in entry["agents"])
        some = sum(line[1] for line in entry["agents"])
        all_known &= known > 0
        if known and some < _SELDOM * known:
            seldom.append(f"{data['scenarios'][entry['scenario']]} ({100 * some / known:.0f} %)")
    if seldom:
        return [f"In fewer than half of the episodes anything scripted happened: {listed(seldom, _LISTED)}."]
    them = "every scenario with events" + " that was driven so far" * so_far
    return [f"In {them}, they happened in at least half of the episodes."] * all_known


def _counted(n: int, name: str) -> str:
    return f"{n:,} {name}{'s' * (n != 1)}"
