"""What a sweep's folder says, as the data of a page."""

from __future__ import annotations

import json
import math
import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from rudc.errors import SweepError
from rudc.evaluation.columns import COLUMNS, DECISION_MS, METRICS, Metric
from rudc.evaluation.folder import read_sweep
from rudc.evaluation.manifest import read_manifest, version_changes
from rudc.evaluation.metrics import Group, group_metrics, in_order
from rudc.evaluation.statistics import NORMAL_FROM, STUDENT_BELOW
from rudc.evaluation.tables import best_of, cell, heading
from rudc.evaluation.unfinished import asked
from rudc.imports import rudc_command
from rudc.reporting.report.densities import densities
from rudc.reporting.report.episodes import (
    Episodes,
    error_kinds,
    event_counts,
    outcome_counts,
    worst_lines,
)
from rudc.reporting.report.findings import findings
from rudc.reporting.report.pairs import differences

SHOWN = (*METRICS, DECISION_MS)
MOST_GROUPS = 3_000
"""lines of a table; more are left to `rudc table`"""
REPLAYS = "replays"
"""folder beside a report, with pages of its worst episodes"""

_Cell = list[float | None]


def sweep_content(folder: Path, page: Path) -> dict[str, Any]:
    """`data` for the page's script and what its template asks for. `page`: where it will stand, replays in a
    folder beside it. Raises SweepError when there is no finished episode, or no sweep.
    """
    rows, parameters = read_sweep(folder)
    if not rows:
        raise SweepError(f"{folder} has no finished episode yet; there is nothing to report")
    episodes = Episodes.of(rows, parameters)
    try:
        known, lacking = read_manifest(folder), ""
    except SweepError as error:
        known, lacking = {}, str(error)
    configuration = known.get("configuration", {})
    scenarios = {name: entry["values"] for name, entry in configuration.get("scenarios", {}).items()}
    scripted = {name: [event["kind"] for event in v.get("events", ())] for name, v in scenarios.items()}
    tables = [_table(folder, rows, by) for by in _groupings(episodes)]
    made = sorted(path.name for path in (page.parent / REPLAYS).glob("*.html"))
    rudc = rudc_command()
    data = {
        "rudc": rudc,
        "replayed": "" if lacking else shlex.quote(str(folder)),
        "scenarios": episodes.scenarios,
        "agents": episodes.agents,
        "metrics": [_described(metric) for metric in SHOWN],
        "tables": [table for table, _ in tables],
        "heat": _heat(group_metrics(rows, ("scenario", "agent"), METRICS), episodes),
        "counts": outcome_counts(episodes),
        "pairs": differences(episodes),
        "densities": densities(episodes),
        "events": event_counts(episodes, scripted),
        "worst": worst_lines(episodes, made),
        "replays": REPLAYS,
    }
    wanted = asked(configuration)
    by_agent = next(groups for table, groups in tables if table["by"] == ["agent"])
    return {
        "data": data,
        "findings": findings(episodes, by_agent, data, wanted),
        "rudc": rudc,
        "source": shlex.quote(str(folder)),
        "data_agents": len(episodes.agents),
        "by_scenario": data["pairs"]["by_scenario"] or len(episodes.scenarios) == 1,
        "has_densities": bool(data["densities"]),
        "has_events": bool(data["events"]),
        "columns": list(COLUMNS.values()),
        "metrics": SHOWN,
        "student_below": STUDENT_BELOW,
        "normal_from": NORMAL_FROM,
        "errors": error_kinds(episodes),
        "setup": _setup(known, scenarios),
        "there": len(rows),
        "of": wanted.episodes if wanted else len(rows),
        "lacking": lacking,
    }


def _groupings(episodes: Episodes) -> list[tuple[str, ...]]:
    """What tables are grouped by, the one of `rudc table` first."""
    first = ("scenario", *episodes.parameters, "agent")
    told = [name for name in ("priority", "turn") if any(row[name] for row in episodes.rows)]
    more = [("agent", name) for name in (*episodes.parameters, *told)]
    return [first, ("agent",), *([("scenario", "agent")] if episodes.parameters else []), *more]


def _table(
    folder: Path, rows: Sequence[dict[str, str]], by: tuple[str, ...]
) -> tuple[dict[str, Any], list[Group]]:
    """The same texts as `rudc table`, and which of them are best."""
    groups = in_order(group_metrics(rows, by, SHOWN))
    best = best_of(groups, by, SHOWN)
    lines = [
        [
            list(group.key),
            group.episodes,
            group.errors,
            [cell(metric, group.metrics[metric.name]) for metric in SHOWN],
            [k for k, metric in enumerate(SHOWN) if (i, metric.name) in best],
        ]
        for i, group in enumerate(groups[:MOST_GROUPS])
    ]
    command = rudc_command("table", str(folder), "--by", ",".join(by))
    return {"by": list(by), "lines": lines, "left_out": len(groups) - len(lines), "command": command}, groups


def _described(metric: Metric) -> dict[str, Any]:
    return {
        "name": metric.name, "heading": heading(metric), "better": metric.better, "text": metric.text,
        "decimals": metric.decimals, "is_rate": bool(metric.outcomes),
    }  # fmt: skip


def _heat(groups: Sequence[Group], episodes: Episodes) -> dict[str, list[list[_Cell | None]]]:
    """metric -> scenarios x agents: [mean, low, high], the ends None where there is no interval; or None."""
    found: dict[str, list[list[_Cell | None]]] = {
        metric.name: [[None] * len(episodes.agents) for _ in episodes.scenarios] for metric in METRICS
    }
    at = {name: i for i, name in enumerate(episodes.scenarios)}
    to = {name: i for i, name in enumerate(episodes.agents)}
    for group in groups:
        scenario, agent = group.key
        for metric in METRICS:
            value = group.metrics[metric.name]
            if not math.isnan(value.mean):
                ends = (None if math.isnan(end) else round(end, 3) for end in (value.low, value.high))
                found[metric.name][at[scenario]][to[agent]] = [round(value.mean, 3), *ends]
    return found


def _setup(known: Mapping[str, Any], scenarios: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    """What the rows were made from, as text."""
    if not known:
        return {}
    configuration = known["configuration"]
    return {
        "command": rudc_command("sweep", "--verify", "DIR", "--share", "1"),
        "versions": known["versions"],
        "changes": version_changes(known),
        "scenarios": [
            {
                "name": name,
                "text": values.get("description", ""),
                "why": values.get("out_of_distribution", ""),
                "digest": configuration["scenarios"][name]["digest"],
                "values": json.dumps(values, indent=1),
            }
            for name, values in scenarios.items()
        ],
        "agents": [
            {"name": name, "values": json.dumps(settings, indent=1)}
            for name, settings in configuration["agents"].items()
        ],
        "episodes": configuration["episodes"],
        "seeds": f"{configuration['seed']} to {configuration['seed'] + configuration['episodes'] - 1}",
    }
