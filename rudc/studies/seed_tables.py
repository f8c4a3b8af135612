"""Tables of a comparison of trainings: its rows over training seeds, in pairs, and beside the paper's."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import combinations
from typing import Any

from rudc.evaluation.columns import METRICS, Metric
from rudc.evaluation.paper import paper_groups
from rudc.evaluation.statistics import Summary
from rudc.evaluation.tables import cell, decimals_of, heading
from rudc.evaluation.text import MISSING, interval, interval_of, markdown
from rudc.studies.campaign import Campaign, Row
from rudc.studies.outcomes import Outcomes

Line = dict[str, Any]
Places = Mapping[str, Sequence[str]]
"""task, `out of distribution`, or a scenario -> its scenarios"""
TESTED = ("SR", "VR", "FR", "AER", "AES", "min_DTC")
"""metrics whose changes in pairs are shown, in this order"""
RATES = 3
"""the first so many of them are rates"""


def lines_of(rows: Sequence[Row], outcomes: Outcomes, places: Places) -> list[Line]:
    """Each row's metrics in each place; of a row without episodes all metrics are nan."""
    found = []
    for place, scenarios in places.items():
        for row in rows:
            values = {m.name: outcomes.over_seeds(row.name, m, scenarios) for m in METRICS}
            line: Line = {
                "place": place,
                "row": row.name,
                "title": row.heading,
                "algorithm": row.algorithm,
                "training_seeds": values["SR"].seeds,
                "episodes": values["SR"].episodes,
                "errors": outcomes.errors(row.name, scenarios),
            }
            for name, value in values.items():
                parts = value._asdict()
                line |= {f"{name}_{part}": parts[part] for part in parts if part not in ("seeds", "episodes")}
            found.append(line)
    return found


def pair_lines(rows: Sequence[Row], reference: str, outcomes: Outcomes, places: Places) -> list[Line]:
    """Each two rows in the same episodes by trainings of the same seed: rates of any two, and against the
    reference the means of `TESTED`, too.
    """
    by_name = {metric.name: metric for metric in METRICS}
    titles = {row.name: row.heading for row in rows}
    others = [(name, reference, TESTED) for name in titles if name != reference]
    rest = [name for name in titles if name != reference]
    others += [(name, than, TESTED[:RATES]) for name, than in combinations(rest, 2)]
    found = []
    for place, scenarios in places.items():
        for row, than, metrics in others:
            for name in metrics:
                pair = outcomes.paired(row, than, by_name[name], scenarios)
                if pair is not None:
                    head = {"place": place, "row": row, "title": titles[row], "against": than}
                    found.append({**head, "metric": name, **pair._asdict()})
    return found


def metrics_markdown(lines: Sequence[Line]) -> str:
    """`mean (std) [low, high]` of each metric: the mean over training seeds and scenarios."""
    rows = [
        [
            line["title"],
            str(line["training_seeds"] or MISSING),
            str(line["episodes"] or MISSING) + (f" (+{line['errors']} failed)" if line["errors"] else ""),
            *(_cell(line, metric) for metric in METRICS),
        ]
        for line in lines
    ]
    return markdown(["", "training seeds", "episodes", *map(heading, METRICS)], rows)


def iqm_markdown(lines: Sequence[Line]) -> str:
    """Interquartile means of the three rates and the reward."""
    shown = [metric for metric in METRICS if metric.name in ("SR", "FR", "VR", "AER")]
    rows = [
        [
            line["title"],
            *(interval_of(line, f"{metric.name}_iqm") for metric in shown),
        ]
        for line in lines
    ]
    return markdown(["", *(f"IQM of {heading(metric)}" for metric in shown)], rows)


def pairs_markdown(lines: Sequence[Line]) -> str:
    """Changes of the tested metrics, a row each; lines are those against one row."""
    by_name = {metric.name: metric for metric in METRICS}
    found: dict[str, dict[str, Line]] = {}
    for line in lines:
        found.setdefault(line["title"], {})[line["metric"]] = line
    rows = []
    for title, metrics in found.items():
        cells = []
        for name in TESTED:
            line = metrics[name]
            decimals = decimals_of(by_name[name], line["change"])
            text = interval(line["change"], line["low"], line["high"], decimals)
            cells.append(text if math.isnan(line["p"]) else f"{text}, p {line['p']:.2g}")
        rows.append([title, str(metrics["SR"]["pairs"]), *cells])
    return markdown(["", "pairs", *TESTED], rows)


def paper_lines(campaign: Campaign, rows: Sequence[Row], lines: Sequence[Line]) -> list[Line]:
    """Ours and the paper's, one after the other; the paper's say so in `source`. Its spread is over training
    runs, like ours; its simulator and traffic are different.
    """
    theirs = {group.key: group for group in paper_groups(campaign.paper, ("scenario", "agent"))}
    by_name = {row.name: row for row in rows}
    found: list[Line] = []
    for line in lines:
        title = by_name[line["row"]].in_paper
        group = theirs.get((line["place"], f"{title} (paper)"))
        if group is None:
            continue
        head = {"place": line["place"], "title": title}
        ours = {m.name: (line[f"{m.name}_mean"], line[f"{m.name}_std"]) for m in METRICS}
        printed = {m.name: group.metrics[m.name][:2] for m in METRICS}
        for source, values in (("ours", ours), ("paper", printed)):
            parts = {
                f"{n}_{p}": v
                for n, pair in values.items()
                for p, v in zip(("mean", "std"), pair, strict=True)
            }
            found.append({**head, "source": source, **parts})
    return found


def paper_markdown(lines: Sequence[Line]) -> str:
    """`mean (std)`, ours above the paper's."""
    rows = [
        [
            line["title"] if line["source"] == "ours" else f"{line['title']} (paper)",
            *(_short(metric, line) for metric in METRICS),
        ]
        for line in lines
    ]
    return markdown(["", *map(heading, METRICS)], rows)


def _short(metric: Metric, line: Line) -> str:
    return cell(metric, Summary(line[f"{metric.name}_mean"], line[f"{metric.name}_std"], math.nan, math.nan))


def _cell(line: Line, metric: Metric) -> str:
    text, n = _short(metric, line), decimals_of(metric, line[f"{metric.name}_mean"])
    low, high = line[f"{metric.name}_low"], line[f"{metric.name}_high"]
    return text if math.isnan(low) else f"{text} [{low:.{n}f}, {high:.{n}f}]"
