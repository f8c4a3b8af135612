"""What a shell offers when the user presses tab: `rudc --install-completion` sets it up."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path

import typer


def complete_scenarios(incomplete: str) -> list[str]:
    """Shipped names, scenario files and folders."""
    from rudc.scenario.library import SUFFIXES, shipped_scenarios

    return [*_starting(incomplete, shipped_scenarios()), *_paths(incomplete, SUFFIXES)]


def complete_agents(incomplete: str) -> list[str]:
    """Names of agents, and folders, which may be checkpoints."""
    from rudc.agents.registry import agent_names

    return [*_starting(incomplete, agent_names()), *_paths(incomplete, (".py",))]


def complete_columns(ctx: typer.Context, incomplete: str) -> list[str]:
    """Columns of the folder given, or all there are, after a comma too."""
    from rudc.evaluation.columns import COLUMNS
    from rudc.evaluation.store import read_header

    folder = ctx.params.get("folder")
    header = read_header(Path(folder) / "episodes.csv") if folder else []
    return _next_in_list(incomplete, [*COLUMNS, *(name for name in header if name not in COLUMNS)])


def complete_metrics(incomplete: str) -> list[str]:
    """Metrics and columns that have a mean, after a comma too."""
    from rudc.evaluation.columns import metric_names

    return _next_in_list(incomplete, metric_names())


def _paths(incomplete: str, suffixes: tuple[str, ...]) -> list[str]:
    """Folders, and files with these suffixes, that begin so; hidden ones only if asked for."""
    folder, slash, start = incomplete.rpartition("/")
    here = Path(os.path.expanduser(folder + slash or "."))
    try:
        inside = sorted(here.iterdir())
    except OSError:
        return []
    found = [p for p in inside if p.name.startswith(start) and (start or not p.name.startswith("."))]
    return [
        f"{folder}{slash}{path.name}{'/' * path.is_dir()}"
        for path in found
        if path.is_dir() or path.suffix in suffixes
    ]


def _starting(incomplete: str, names: Iterable[str]) -> list[str]:
    return [name for name in names if name.startswith(incomplete)]


def _next_in_list(incomplete: str, names: Iterable[str]) -> list[str]:
    before, comma, last = incomplete.rpartition(",")
    given = before.split(",")
    return [before + comma + name for name in _starting(last, names) if name not in given]
