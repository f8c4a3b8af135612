"""What the paper says, one by one: held, not held or not measured, by the rule that the claim names.

All rules look at changes in the same episodes, driven by trainings of the same seed, and their 95 % intervals
(rudc/evaluation/seeds.py). `Clear` means: the interval does not contain 0.

more, less   held if the row has more (less) of the metric than each row named, every one of them clear
first        held if the row's mean is the best and the change against every other row is clear. Rows that
             freeze in more than FROZEN % of the episodes do not count: who stands still is safe
gap          the row's lead over the mean of the rows named, in each episode: held if it is larger in the
             second place than in the first, the difference clear. With the means m1 and m2 of the two places
             and their intervals [l1, u1] and [l2, u2] (over training seeds, and at least as wide as the
             normal one of all episodes), taken for independent, its interval is (Zou and Donner) from
                 m2 - m1 - sqrt((m2 - l2)^2 + (u1 - m1)^2) to m2 - m1 + sqrt((u2 - m2)^2 + (m1 - l1)^2)

What is not held may be the other way round, or not told apart from chance: the figures say which. Where a row
that the rule needs has no episodes, the claim is not measured there. With trainings of a single seed all of
this is about these trainings, not about the algorithms; the number of seeds stands beside.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from rudc.evaluation.columns import Metric
from rudc.evaluation.seeds import Cells, Paired, over_seeds
from rudc.evaluation.statistics import Z
from rudc.evaluation.tables import decimals_of
from rudc.evaluation.text import interval, markdown
from rudc.studies.campaign import METRIC, Campaign, Claim
from rudc.studies.outcomes import Outcomes

FROZEN = 20.0
"""%, rate of frozen episodes above which a row does not count among those that drive"""
HELD, NOT_HELD, NOT_MEASURED = "held", "not held", "not measured"


class Verdict(NamedTuple):
    """Whether a claim holds in one place."""

    says: str
    source: str
    where: str
    verdict: str
    figures: str
    seeds: int
    """training seeds that it rests on"""


def judge(campaign: Campaign, outcomes: Outcomes, places: Mapping[str, Sequence[str]]) -> list[Verdict]:
    """Every claim in every place. places: what a claim's `where` may name -> its scenarios."""
    titles = {row.name: row.heading for row in campaign.rows}
    found = []
    for claim in campaign.claims:
        if claim.rule == "gap":
            found.append(_gap(claim, outcomes, places, titles))
            continue
        rule = _first if claim.rule == "first" else _compared
        for where in claim.where:
            verdict, figures, against = rule(claim, outcomes, places.get(where, ()), titles)
            seeds = _seeds(outcomes, (claim.row, *against)) if verdict != NOT_MEASURED else 0
            found.append(Verdict(claim.says, claim.source, where, verdict, figures, seeds))
    return found


def claims_markdown(verdicts: Sequence[Verdict]) -> str:
    """A table, and how the verdicts are reached."""
    rows = [[v.says, v.source, v.where, v.verdict, str(v.seeds or "–"), v.figures] for v in verdicts]
    table = markdown(["claim", "paper", "where", "here", "training seeds", "figures"], rows, left=6)
    rules = (__doc__ or "").partition("\n")[2].strip().replace("FROZEN", f"{FROZEN:g}")
    return f"{table}\nHow it is decided:\n\n```\n{rules}\n```\n"


def _compared(
    claim: Claim, outcomes: Outcomes, scenarios: Sequence[str], titles: Mapping[str, str]
) -> tuple[str, str, tuple[str, ...]]:
    metric = METRIC[claim.metric]
    sign = 1.0 if claim.rule == "more" else -1.0
    held, figures = True, []
    for other in claim.than:
        pair = outcomes.paired(claim.row, other, metric, scenarios)
        if pair is None:
            missing = [titles[r] for r in (claim.row, other) if r not in outcomes.rows()]
            return NOT_MEASURED, f"no episodes of {' and '.join(missing) or 'both'}", ()
        held &= _side(pair) == sign
        figures.append(f"{metric.name} {_change(pair, metric)} against {titles[other]}")
    return (HELD if held else NOT_HELD), "; ".join(figures), claim.than


def _first(
    claim: Claim, outcomes: Outcomes, scenarios: Sequence[str], titles: Mapping[str, str]
) -> tuple[str, str, tuple[str, ...]]:
    """Against every other row that is there and does not freeze."""
    metric = METRIC[claim.metric]
    sign = -1.0 if metric.better == "lower" else 1.0
    pairs: dict[str, Paired] = {}
    frozen, absent, apart = [], [], []
    for other in claim.than or titles:
        if other == claim.row or other in claim.without:
            continue
        pair = outcomes.paired(claim.row, other, metric, scenarios)
        if pair is None:
            (apart if other in outcomes.rows() else absent).append(titles[other])
        elif outcomes.over_seeds(other, METRIC["FR"], scenarios).mean > FROZEN:
            frozen.append(titles[other])
        else:
            pairs[other] = pair
    if not pairs:
        return NOT_MEASURED, "no episodes to compare", ()
    own = outcomes.over_seeds(claim.row, METRIC["FR"], scenarios).mean
    held = all(_side(pair) == sign for pair in pairs.values()) and own <= FROZEN
    nearest = min(pairs, key=lambda other: sign * pairs[other].change)
    behind = [titles[o] for o, pair in pairs.items() if sign * pair.change < 0]
    level = [titles[o] for o, p in pairs.items() if titles[o] not in behind and _side(p) != sign]
    figures = [f"{metric.name} {_change(pairs[nearest], metric)} against {titles[nearest]}, the nearest"]
    figures += [f"behind {', '.join(behind)}"] if behind else []
    figures += [f"not clearly apart from {', '.join(level)}"] if level else []
    figures += [f"not counted, they freeze: {', '.join(frozen)}"] if frozen else []
    figures += [f"without {', '.join(absent)}, which did not drive"] if absent else []
    figures += [f"without {', '.join(apart)}, which finished none of the same episodes"] if apart else []
    figures += [f"freezes itself in {own:.0f} %"] if own > FROZEN else []
    return (HELD if held else NOT_HELD), "; ".join(figures), tuple(pairs)


def _gap(
    claim: Claim, outcomes: Outcomes, places: Mapping[str, Sequence[str]], titles: Mapping[str, str]
) -> Verdict:
    metric, where = METRIC[claim.metric], " < ".join(claim.where)
    there = [name for name in claim.than if name in outcomes.rows()]
    measured = [places.get(place, ()) for place in claim.where if there]
    leads = [outcomes.lead(claim.row, there, metric, scenarios) for scenarios in measured]
    if min((sum(map(len, lead.values())) for lead in leads), default=0) < 2:
        return Verdict(claim.says, claim.source, where, NOT_MEASURED, "no episodes to compare", 0)
    (first, down, up), (second, below, above) = map(_mean_and_reach, leads)
    change = second - first
    low, high = change - math.hypot(below, up), change + math.hypot(above, down)
    shown = interval(change, low, high)
    figures = f"lead in {metric.name} {first:.1f} and {second:.1f}, change {shown}, over {len(there)} rows"
    left = [titles[name] for name in claim.than if name not in there]
    figures += f"; without {', '.join(left)}, which did not drive" if left else ""
    verdict = HELD if low > 0 else NOT_HELD
    return Verdict(claim.says, claim.source, where, verdict, figures, _seeds(outcomes, (claim.row, *there)))


def _mean_and_reach(lead: Cells) -> tuple[float, float, float]:
    """The mean of a lead, and how far its 95 % interval reaches below and above."""
    over, values = over_seeds(lead), np.concatenate(list(lead.values()))
    half = Z * float(np.nanstd(values, ddof=1)) / math.sqrt(over.episodes)
    return over.mean, float(np.fmax(half, over.mean - over.low)), float(np.fmax(half, over.high - over.mean))


def _seeds(outcomes: Outcomes, rows: Sequence[str]) -> int:
    """Training seeds that all rows have."""
    return len(set.intersection(*(set(outcomes.training_seeds(row)) for row in rows)))


def _side(pair: Paired) -> float:
    """1 where it is clear that there is more, -1 where it is clear that there is less, else 0."""
    return 1.0 if pair.low > 0 else -1.0 if pair.high < 0 else 0.0


def _change(pair: Paired, metric: Metric) -> str:
    """`+2.0 [0.5, 3.5], p 0.01, n 200`."""
    text = interval(pair.change, pair.low, pair.high, decimals_of(metric, pair.change))
    p = "" if math.isnan(pair.p) else f", p {pair.p:.2g}"
    return f"{'+' if pair.change > 0 else ''}{text}{p}, n {pair.pairs}"
