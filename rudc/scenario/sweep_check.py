"""Whether every point of a file's `sweep` is a scenario, and if not, which value is to blame."""

from __future__ import annotations

import itertools
import math
from collections.abc import Hashable
from contextlib import suppress
from typing import Any

from pydantic import ValidationError

from rudc.scenario.base import parts_of
from rudc.scenario.dotted import DottedKeyError, Path, dotted, value_at, value_text, with_value
from rudc.scenario.model import GRID_LIMIT, Scenario
from rudc.scenario.problems import FIXED, Problem, describe
from rudc.scenario.yaml_text import Report, Sheet

WITHIN = "lies within {}, which is swept, too; leave one of them out"
"""what is wrong with a key that is given besides a swept one which it is a part of"""


def sweep_reports(sheet: Sheet, data: dict[str, Any], known: set[tuple[Path, str]]) -> list[Report]:
    """Problems of the sweep that are not problems (`known`) of the scenario itself."""
    given = data.get("sweep")
    if not isinstance(given, dict):
        return []
    reported = {path[1] for path, _ in known if path[:1] == ("sweep",) and len(path) > 1}
    base = {key: value for key, value in data.items() if key != "sweep"}
    reports: list[Report] = []
    sweep: dict[str, list[Any]] = {}
    for key, values in given.items():
        if key in reported or not isinstance(key, str) or not isinstance(values, list):
            continue
        within = next((other for other in given if key.startswith(f"{other}.")), None)
        if within is not None:
            reports.append(sheet.report(("sweep", key), WITHIN.format(within), on_key=True))
            continue
        found = _axis_reports(sheet, base, key, values)
        reports += found
        if not found:
            sweep[key] = values
    size = math.prod(map(len, sweep.values()))
    if size > GRID_LIMIT:
        reports.append(sheet.report(("sweep",), f"has {size} combinations; {GRID_LIMIT} at most are allowed"))
        return reports
    for keys in _by_part(sweep, base):
        tops = {"name", "shared", *(key.split(".")[0] for key in keys)}
        part = base if keys[0].startswith("shared.") else {name: base[name] for name in base if name in tops}
        for choice in itertools.product(*(range(len(sweep[key])) for key in keys)):
            reports += _point_reports(sheet, part, sweep, dict(zip(keys, choice, strict=True)), known)
    return list(dict.fromkeys(reports))


def _by_part(sweep: dict[str, list[Any]], base: dict[str, Any]) -> list[list[str]]:
    """Swept keys of the same part of a file together: no rule is about two parts, so that the values in one
    need not be tried with all of those in another. Parts that name a shared number go with `shared`, whose
    keys come first.
    """
    parts: dict[tuple[str, ...], list[str]] = {}
    for key in sorted(sweep, key=lambda key: not key.startswith("shared.")):
        top, *rest = key.split(".")
        part = (top, *rest[:1]) if top == "events" else (top,)
        if ("shared",) in parts and _names_shared(value_at(base, ".".join(part))):
            part = ("shared",)
        parts.setdefault(part, []).append(key)
    return list(parts.values())


def _names_shared(value: Any) -> bool:
    """Whether a shared number is named within a part of a file."""
    within = isinstance(value, dict) and "shared" in value
    return within or any(_names_shared(part) for _, part in parts_of(value))


def _axis_reports(sheet: Sheet, base: dict[str, Any], key: str, values: list[Any]) -> list[Report]:
    """Problems of one swept key by itself."""
    path: Path = ("sweep", key)
    if key.split(".")[0] in FIXED:
        return [sheet.report(path, "cannot be swept", on_key=True)]
    if not values:
        return [sheet.report(path, "there is no value to sweep over")]
    first: dict[Any, int] = {}
    twice = [
        i for i, value in enumerate(values)
        if first.setdefault(_apart(value), i) != i
    ]  # fmt: skip
    if twice:
        return [sheet.report((*path, i), f"{_shown(values[i])} is given twice") for i in twice]
    try:
        with_value(base, key, values[0])
    except DottedKeyError as error:
        return [sheet.report(path, str(error), on_key=True)]
    return []


def _apart(value: Any) -> Hashable:
    """Equal for values that are the same in a file, where `true` is not 1, or in a row, where text has no
    quotes."""
    if isinstance(value, str):
        value = value.strip()
        with suppress(ValueError):
            return False, float(value)
    return (isinstance(value, bool), value) if isinstance(value, Hashable) else repr(value)


def _shown(value: Any) -> str:
    return repr(value) if isinstance(value, str) else value_text(value)


def _point_reports(
    sheet: Sheet,
    base: dict[str, Any],
    sweep: dict[str, list[Any]],
    choice: dict[str, int],
    known: set[tuple[Path, str]],
) -> list[Report]:
    """Problems of one combination, each laid on the value that causes it."""
    data, paths = base, {}
    try:
        for key, i in choice.items():
            data, paths[key] = with_value(data, key, sweep[key][i])
        Scenario.model_validate(data)
    except DottedKeyError as error:
        first = next(iter(choice))
        return [sheet.report(("sweep", first, choice[first]), str(error))]
    except ValidationError as error:
        problems = [p for p in describe(error, Scenario, data) if (p.path, p.text) not in known]
        return [_blamed(sheet, problem, paths, choice) for problem in problems]
    return []


def _blamed(sheet: Sheet, problem: Problem, paths: dict[str, Path], choice: dict[str, int]) -> Report:
    for key, path in paths.items():
        shared = min(len(path), len(problem.path))
        if path[:shared] == problem.path[:shared]:
            about = ("sweep", key) if problem.on_key else ("sweep", key, choice[key])
            where = "" if problem.path == path else f"{dotted(problem.path)}: "
            return sheet.report(about, where + problem.text, on_key=problem.on_key)
    key = next(iter(choice))
    return sheet.report(("sweep", key, choice[key]), f"{dotted(problem.path)}: {problem.text}")
