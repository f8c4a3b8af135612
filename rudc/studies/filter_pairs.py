"""Pairs of the filter study: the same episodes by two variants, and the oracle that takes the better one."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from rudc.evaluation.columns import happened
from rudc.evaluation.statistics import Z, paired_change
from rudc.evaluation.text import interval, markdown, rate_decimals
from rudc.studies.filter_variants import ADAPTIVE, CONSTANT, Variant

Row = Mapping[str, str]
Key = tuple[str, ...]
OF_ORACLE = "residual"
"""variant whose filter the oracle takes away"""


def episode_of(row: Row, by_name: Mapping[str, Variant]) -> Key:
    """What two variants must share to be compared: training, scenario and seed."""
    return by_name[row["agent"]].trained, row["scenario"], row["seed"]


def oracle(rows: Sequence[Row], by_name: Mapping[str, Variant]) -> tuple[list[Row], dict[str, Variant]]:
    """Rows of the oracle, which has no filter in each episode that succeeds without, and its variants."""
    off = (row for row in rows if by_name[row["agent"]].kind == "off" and not row["error"])
    without = {episode_of(row, by_name): row for row in off}
    found: list[Row] = []
    variants: dict[str, Variant] = {}
    for row in rows:
        variant, free = by_name[row["agent"]], without.get(episode_of(row, by_name))
        if variant.kind != OF_ORACLE or free is None:
            continue
        name = f"oracle of {variant.agent}"
        variants[name] = replace(variant, agent=name, kind="oracle")
        found.append({**(free if happened("SR", free["outcome"]) else row), "agent": name})
    return found, variants


def pairs(rows: Mapping[str, Sequence[Row]], variants: Sequence[Variant]) -> list[dict[str, Any]]:
    """Lines of `filter_pairs.csv`: each adaptive variant against each constant one, percentage points (VR,
    FR) and m/s, in the same episodes; training seeds pooled.
    """
    by_name = {variant.agent: variant for variant in variants}
    lines = []
    for domain, members in rows.items():
        groups: dict[tuple[str, str, float], dict[str, dict[Key, Row]]] = {}
        for row in members:
            v = by_name[row["agent"]]
            if not row["error"] and v.kind in (*ADAPTIVE, *CONSTANT):
                kinds = groups.setdefault((v.family, v.constrained, v.d_safe), {})
                kinds.setdefault(v.kind, {})[episode_of(row, by_name)] = row
        for (agent, constrained, d_safe), kinds in groups.items():
            head = {"domain": domain, "agent": agent, "constrained": constrained, "d_safe_m": d_safe}
            for adaptive in ADAPTIVE:
                for constant in CONSTANT:
                    if adaptive in kinds and constant in kinds:
                        compared = compare(kinds[adaptive], kinds[constant])
                        lines.append(head | {"adaptive": adaptive, "constant": constant} | compared)
    return lines


def compare(new: Mapping[Key, Row], old: Mapping[Key, Row]) -> dict[str, Any]:
    """Changes from old to new in the episodes that both have. New dominates with
    clearly fewer violations, if it does not freeze more and is not clearly slower; or with clearly less
    freezing, if it does not violate more. Clearly: the interval of the change does not contain 0.
    """
    both = [(new[key], old[key]) for key in new if key in old]
    line: dict[str, Any] = {"episodes": len(both)}
    for rate in ("VR", "FR"):
        ends = [(happened(rate, a["outcome"]), happened(rate, b["outcome"])) for a, b in both]
        change = paired_change(len(both), ends.count((True, False)), ends.count((False, True)))
        line |= dict(zip((f"{rate}_change", f"{rate}_low", f"{rate}_high"), change, strict=True))
    faster = np.array([float(a["mean_speed_mps"]) - float(b["mean_speed_mps"]) for a, b in both])
    half = Z * float(faster.std(ddof=1)) / math.sqrt(len(both)) if len(both) > 1 else math.nan
    mean = float(faster.mean()) if len(both) else math.nan
    line |= {"speed_change": mean, "speed_low": mean - half, "speed_high": mean + half}
    fewer = line["VR_high"] < 0 and line["FR_change"] <= 0 and line["speed_high"] >= 0
    freer = line["FR_high"] < 0 and line["VR_change"] <= 0
    return line | {"dominates": fewer or freer}


def pairs_markdown(lines: Sequence[Mapping[str, Any]]) -> str:
    """The pairs, to read."""
    headings = [
        "agent", "scenarios", "constrained", "adaptive", "constant", "d_safe (m)", "episodes",
        "VR change (points)", "FR change (points)", "speed change (m/s)", "dominates",
    ]  # fmt: skip
    rows = [
        [
            *(line[key] for key in ("agent", "domain", "constrained", "adaptive", "constant")),
            f"{line['d_safe_m']:g}",
            str(line["episodes"]),
            *(_change(line, rate) for rate in ("VR", "FR")),
            interval(line["speed_change"], line["speed_low"], line["speed_high"], 2),
            "yes" if line["dominates"] else "no",
        ]
        for line in lines
    ]
    return markdown(headings, rows, left=5)


def _change(line: Mapping[str, Any], rate: str) -> str:
    """The change of a rate with its interval."""
    change = line[f"{rate}_change"]
    return interval(change, line[f"{rate}_low"], line[f"{rate}_high"], rate_decimals(change))
