"""What a training's folder says, as the data of a page: its curves, and what it was made from."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rudc.errors import InputError, SweepError
from rudc.evaluation.metrics import numbers
from rudc.training.log import BEFORE, OUTCOMES, read_log
from rudc.training.log_curves import BIN, RATE_COLUMNS, read_training

LOGS = ("progress.csv", "evaluation.csv")
_MOST = 600
"""points of a curve"""


def is_training(folder: Path) -> bool:
    """Whether a folder holds the log of a training."""
    return (folder / LOGS[0]).is_file()


def training_content(folder: Path) -> dict[str, Any]:
    """`data` for the page's script and what its template asks for. Raises InputError for damaged files."""
    rows = read_log(folder / LOGS[0])
    if not rows:
        raise SweepError(f"{folder / LOGS[0]} has no row yet; there is nothing to report")
    curves = [
        {
            "source": source, "scenario": scenario, "priority": priority, "metric": metric,
            "points": [[step, _rounded(measured.value)] for step, measured in sorted(series.items())],
        }
        for (source, scenario, priority, metric), series in read_training(folder).items()
    ]  # fmt: skip
    own = [name for name in rows[0] if name not in BEFORE]
    path = next((folder / n for n in ("config.json", "agent.json") if (folder / n).is_file()), None)
    settings = _settings(path) if path else {}
    return {
        "data": {
            "curves": curves,
            "metrics": [*RATE_COLUMNS, "reward"],
            "statistics": [_statistic(rows, name) for name in (*OUTCOMES, "episode_reward", *own)],
        },
        "steps": rows[-1]["steps"],
        "wall": _duration(rows[-1].get("wall_s", "")),
        "last": _last(curves),
        "names": [*RATE_COLUMNS, "reward"],
        "bin": BIN,
        "settings": json.dumps(settings, indent=1) if settings else "",
        "settings_name": path.name if path else "",
        "algorithm": settings.get("algorithm", ""),
    }


def _settings(path: Path) -> dict[str, Any]:
    try:
        settings = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise InputError(f"{path}: cannot be read: {error}") from error
    if not isinstance(settings, dict):
        raise InputError(f"{path}: does not hold the settings of a training")
    return settings


def _statistic(rows: Sequence[dict[str, str]], name: str) -> dict[str, Any]:
    """A column of progress.csv over the decisions, thinned out where there are very many."""
    steps, values = numbers(rows, "steps"), numbers(rows, name)
    every = -(-len(rows) // _MOST)
    points = [[int(s), _rounded(v)] for s, v in zip(steps[::every], values[::every], strict=True)]
    return {"name": name, "points": points}


def _last(curves: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """Where the held-out episodes ended up: a line for each scenario and priority."""
    lines: dict[tuple[str, str], dict[str, Any]] = {}
    for curve in curves:
        if curve["source"] == "evaluation" and curve["points"]:
            step, value = curve["points"][-1]
            key = (curve["scenario"], curve["priority"])
            line = lines.setdefault(
                key, {"scenario": key[0], "priority": key[1], "steps": step, "values": {}}
            )
            line["values"][curve["metric"]] = "–" if value is None else f"{value:.1f}"
    return list(lines.values())


def _duration(text: str) -> str:
    wall = float(text or "nan")
    if not math.isfinite(wall):
        return ""
    minutes, seconds = divmod(round(wall), 60)
    return f"{minutes} min {seconds} s"


def _rounded(value: float) -> float | None:
    return None if math.isnan(value) else float(f"{value:.5g}")
