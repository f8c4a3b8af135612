"""`extends`: what a file says on top of what its parent says.

Sections are merged key by key; every other value (list, route, mix, distribution, sweep) is replaced whole.
A value that the child gives to a key that the parent sweeps, or to the whole that it is part of, ends that
sweep. An empty value (`sweep:` or `junction: null`) takes back what the parent says. A scenario's name and
remarks are its own.
"""

from __future__ import annotations

from copy import deepcopy
from typing import Any

from rudc.scenario.dotted import Path
from rudc.scenario.yaml_text import Mark, Sheet

SECTIONS: frozenset[Path] = frozenset(
    {(), ("ego",), ("traffic",), ("traffic", "idm"), ("shared",), ("episode",)}
)
"""mappings that are merged rather than replaced"""
OWN = ("name", "description", "out_of_distribution", "extends")
"""keys that are not inherited"""


def inherit(child: Sheet, parent: Sheet) -> Sheet:
    """Both together."""
    kept = {key: value for key, value in parent.data.items() if key not in OWN}
    marks = {path: mark for path, mark in parent.marks.items() if path and path[0] not in OWN}
    merged = Sheet(deepcopy(kept), {**marks, (): child.marks[()]})
    _merge(child.data, child.marks, merged.data, merged.marks, ())
    if "sweep" not in child.data and isinstance(merged.data.get("sweep"), dict):
        for key in [key for key in merged.data["sweep"] if gives(child.data, str(key))]:
            del merged.data["sweep"][key]
    return merged


def gives(data: dict[str, Any], key: str) -> bool:
    """Whether data have a value at a dotted key, or replace whole something that it is part of."""
    path, here = tuple(key.split(".")), data
    for i, part in enumerate(path):
        if path[:i] not in SECTIONS or not isinstance(here, dict):
            return True
        if part not in here:
            return False
        here = here[part]
    return True


def _merge(
    child: dict[str, Any],
    child_marks: dict[Path, Mark],
    here: dict[str, Any],
    marks: dict[Path, Mark],
    path: Path,
) -> None:
    for key, value in child.items():
        below = (*path, key)
        if below in SECTIONS and isinstance(value, dict) and isinstance(here.get(key, {}), dict):
            marks[below] = child_marks[below]
            _merge(value, child_marks, here.setdefault(key, {}), marks, below)
            continue
        for known in [known for known in marks if known[: len(below)] == below]:
            del marks[known]
        if value is None and key in here:
            del here[key]
            continue
        here[key] = deepcopy(value)
        marks.update({known: mark for known, mark in child_marks.items() if known[: len(below)] == below})
