"""Scenario files -> checked `Scenario`s, with every problem of a file at once and where it stands."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from os import PathLike
from pathlib import Path as File
from typing import Any

from pydantic import ValidationError

from rudc.errors import ScenarioError
from rudc.hints import did_you_mean
from rudc.scenario.dotted import DottedKeyError, Path, dotted, value_at, value_text, with_value
from rudc.scenario.fit import Fit, fit_reports
from rudc.scenario.inheritance import gives, inherit
from rudc.scenario.library import find_file, find_files, find_parent, parents_known, shown
from rudc.scenario.model import Scalar, Scenario
from rudc.scenario.networks import is_network_path
from rudc.scenario.problems import describe, got
from rudc.scenario.sweep_check import WITHIN, sweep_reports
from rudc.scenario.yaml_text import LONGEST, Mark, Report, Sheet, read_yaml


def load_scenario(
    source: str | File,
    overrides: Mapping[str, object] | None = None,
    fit: Fit | None = None,
    *,
    grid: Mapping[str, Sequence[object]] | None = None,
    by: str = "override",
) -> Scenario:
    """The scenario of a shipped name or a file. `overrides`: dotted key -> value to use instead; such a key
    is not swept any more; where a key and a part of it are both given, the part
    is put into the value given for the whole, whatever their order. `grid`: dotted key -> values
    to sweep it over; a key that takes a list, such as `events`, gets them as its value.

    `fit` finds what a file alone does not show (`rudc.world.fitting.misfits`: lanes that its network does
    not have). Raises ScenarioError, one line for every problem; `by`: how it calls what gave the overrides,
    such as an option of a command.
    """
    path = find_file(source)
    sheet, reports = _read(path, ())
    if sheet is None:
        raise _error(reports, path)
    swept: dict[str, Sequence[object]] = {}
    grid = grid or {}
    given: dict[str, Any] = {**(overrides or {}), **grid}
    for key in sorted(given, key=lambda key: key.count(".")):  # a whole, then what is to differ in it
        if key in grid and not _takes_list(sheet, key, given[key]):
            swept[key] = given[key]
        else:
            reports += _override(sheet, key, given[key], by)
    reports += _within_swept(given, swept, by)
    for key in grid:  # in the order given: the last varies fastest
        if key in swept:
            _sweep(sheet, key, swept[key], by)
    scenario, more = _checked(sheet, {report.path for report in reports}, sweeps=not reports)
    reports += more
    if fit is not None:
        reports += fit_reports(sheet, _without_empty(sheet.data), fit)
    if reports or scenario is None:
        raise _error([_with_hint(report, sheet.data, overrides or {}, by) for report in reports], path)
    return scenario.read_from(path.absolute(), _without_empty(sheet.data))


def find_scenarios(
    patterns: Sequence[str],
    fit: Fit | None = None,
    *,
    overrides: Mapping[str, object] | None = None,
    by: str = "override",
) -> list[Scenario]:
    """The scenarios that shipped names, paths and globs stand for, each once, in the order given.

    `overrides`: other values at some dotted keys of all of them; those of a list are swept. `fit` and `by` as
    in `load_scenario`. Raises ScenarioError with every problem of every file, when two files have the same
    `name`, and for a text instead of a list of them.
    """
    if isinstance(patterns, str | PathLike):
        raise ScenarioError(f"scenarios are given as a list of names: ['{patterns}'], not '{patterns}'")
    found: dict[str, Scenario] = {}
    failures: list[str] = []
    grid = {key: value for key, value in (overrides or {}).items() if isinstance(value, list)}
    single = {key: value for key, value in (overrides or {}).items() if key not in grid}
    for path in find_files(patterns):
        try:
            scenario = load_scenario(path, single, fit, grid=grid, by=by)
        except ScenarioError as error:
            failures.append(str(error))
            continue
        other = found.setdefault(scenario.name, scenario)
        if other is not scenario:
            first = shown(other.path) if other.path else other.name
            failures.append(
                f"{shown(path)}: name: {scenario.name!r} is also the name of {first}; results would mix"
            )
    if failures:
        raise ScenarioError("\n".join(failures))
    return list(found.values())


def _error(reports: list[Report], path: File) -> ScenarioError:
    """All reports: first of the file itself, then of those it extends, then of overrides."""
    files = list(dict.fromkeys([shown(path), *(report.file for report in reports if report.line)]))
    places = {file: place for place, file in enumerate(files)}
    ordered = sorted(reports, key=lambda r: (places.get(r.file, len(files)), r.line, r.column))
    return ScenarioError("\n".join(dict.fromkeys(str(report) for report in ordered)))


def _read(path: File, children: tuple[File, ...]) -> tuple[Sheet | None, list[Report]]:
    """What a file and those it extends say together, and problems."""
    if is_network_path(path.name):
        name = shown(path)
        raise ScenarioError(
            f"{name}: this is a network: a scenario names it as `network: {name}`; "
            f"`rudc network check {name}` says what is understood of it"
        )
    try:
        with path.open("rb") as file:
            start = file.read(4 * LONGEST + 4)  # a character takes at most 4 bytes
        cut = len(start) == 4 * LONGEST + 4  # perhaps in the middle of a character; it is too long anyway
        text = start.decode("utf-8-sig", errors="ignore" if cut else "strict")
    except UnicodeDecodeError as error:
        line = error.object[: error.start].count(b"\n") + 1
        column = error.start - error.object.rfind(b"\n", 0, error.start)
        return None, [Report(shown(path), line, column, (), "not valid UTF-8 text")]
    except OSError as error:
        raise ScenarioError(f"{shown(path)}: cannot be read: {error.strerror}") from None
    sheet, reports = read_yaml(text, shown(path))
    if sheet is None:
        return None, reports
    _anchor_networks(sheet, path.parent)
    parent_name = sheet.data.get("extends")
    if isinstance(parent_name, int | float) and not isinstance(parent_name, bool):
        parent_name = str(parent_name)
    if not isinstance(parent_name, str) or not parent_name.strip():
        return sheet, reports
    parent = find_parent(parent_name, path)
    chain = (*children, path.resolve())
    if parent is None:
        if parent_name in (path.name, path.stem):
            text = (
                f"the file extends itself; no other scenario {parent_name!r} is beside it, and none shipped"
            )
        else:
            near = did_you_mean(parent_name, parents_known(path))
            text = f"no scenario {parent_name!r} beside this file, and none shipped{near}"
        return sheet, [*reports, sheet.report(("extends",), text)]
    if parent.resolve() in chain:
        ring = " -> ".join(file.name for file in (*chain[chain.index(parent.resolve()) :], parent))
        return sheet, [*reports, sheet.report(("extends",), f"goes round in a circle: {ring}")]
    parent_sheet, parent_reports = _read(parent, chain)
    reports += parent_reports
    if parent_sheet is None:
        return sheet, reports
    return inherit(sheet, parent_sheet), reports


def _anchor_networks(sheet: Sheet, folder: File) -> None:
    """Make paths to networks absolute: they are relative to the file that names them."""
    if is_network_path(sheet.data.get("network")):
        sheet.data["network"] = str((folder / sheet.data["network"]).absolute())
    sweep = sheet.data.get("sweep")
    values = sweep.get("network") if isinstance(sweep, dict) else None
    if isinstance(values, list):
        values[:] = [
            str((folder / value).absolute()) if is_network_path(value) else value for value in values
        ]


def _override(sheet: Sheet, key: str, value: object, by: str) -> list[Report]:
    """Put a value at a dotted key of a sheet; an empty one takes back what stands there, if anything does, as
    in a file that extends another."""
    if key.partition(".")[0] == "extends":
        text = "cannot be set: a file is read with what it extends; write a file with another `extends`"
        return [Report(by, 0, 0, tuple(key.split(".")), text)]
    if key.startswith("sweep."):
        text = f"is not a key; give {key.removeprefix('sweep.')} itself a list"
        return [Report(by, 0, 0, tuple(key.split(".")), text)]
    swept = sheet.data.get("sweep")
    there = value_at(sheet.data, key) is not None or (isinstance(swept, dict) and key in swept)
    try:
        data, path = with_value(sheet.data, key, value)
    except DottedKeyError as error:
        return [Report(by, 0, 0, tuple(key.split(".")), str(error))]
    if value is None and not there and _is_known(data, path):
        _end_sweeps_below(data, key)  # the sheet's own data share its `sweep`
        return []
    sheet.data = data
    sheet.marks = {known: mark for known, mark in sheet.marks.items() if known[: len(path)] != path}
    made = [path[:n] for n in range(1, len(path) + 1) if path[:n] not in sheet.marks]
    sheet.marks.update(dict.fromkeys(made, Mark(by, 0, 0, 0, 0)))
    if isinstance(swept := sheet.data.get("sweep"), dict):
        for known in [known for known in swept if f"{key}.".startswith(f"{known}.")]:
            del swept[known]  # or the file's own values would take the place of those given
    _end_sweeps_below(sheet.data, key)
    above, _, last = key.rpartition(".")
    whole = value_at(sheet.data, above) if above else sheet.data
    if value is None and there and isinstance(whole, dict):  # in a list, others would take its number
        del whole[last]
    return []


def _is_known(data: dict[str, Any], path: Path) -> bool:
    """Whether the key at a path of data, which has no value there, is one that a file may have."""
    try:
        Scenario.model_validate(data)
    except ValidationError as error:
        problems = [p for p in describe(error, Scenario, data) if p.path == path[: len(p.path)]]
        return not any(p.text.startswith("unknown ") or p.text.endswith(got({})) for p in problems)
    return True


def _end_sweeps_below(data: dict[str, Any], key: str) -> None:
    """Sweep no part of what data have at a dotted key, where they give that part, too."""
    swept = data.get("sweep")
    if isinstance(swept, dict):
        for known in [known for known in swept if str(known).startswith(f"{key}.")]:
            if gives(data, known):
                del swept[known]


def _within_swept(given: Iterable[str], grid: Iterable[str], by: str) -> list[Report]:
    """A report for each key that lies within one that is swept."""
    pairs = [(key, swept) for key in given for swept in grid if key.startswith(f"{swept}.")]
    return [Report(by, 0, 0, tuple(key.split(".")), WITHIN.format(swept)) for key, swept in pairs]


def _with_hint(report: Report, data: dict[str, Any], overrides: Mapping[str, object], by: str) -> Report:
    """The report; where a list stands in the place of a single value, with a hint how to run each of its
    values."""
    key = dotted(report.path)
    value = value_at(data, key)
    single = report.text.endswith(got(value)) and not report.text.startswith("expected a mapping")
    if not (single and isinstance(value, list) and all(isinstance(each, Scalar) for each in value)):
        return report
    if report.file == by:
        if key not in overrides:
            return report
        return replace(report, text=f"{report.text} (`rudc sweep` takes one, and runs each of its values)")
    return replace(
        report, text=f"{report.text} (`sweep: {{{key}: {value_text(value)}}}` runs each of its values)"
    )


def _takes_list(sheet: Sheet, key: str, values: Sequence[object]) -> bool:
    """Whether a list may stand at a dotted key of a sheet, be it one of wrong length or content."""
    try:
        data, path = with_value(sheet.data, key, values)
    except DottedKeyError:
        return False
    try:
        Scenario.model_validate(_without_empty(data))
    except ValidationError as error:
        problems = describe(error, Scenario, data)
        return not any(p.path == path and p.text.endswith(got(values)) for p in problems)
    return True


def _sweep(sheet: Sheet, key: str, values: Sequence[object], by: str) -> None:
    """Sweep a dotted key of a sheet over values."""
    before = sheet.data.get("sweep")
    kept = before.items() if isinstance(before, dict) else ()
    others = {
        known: given
        for known, given in kept
        if known == key or not (str(known).startswith(f"{key}.") or key.startswith(f"{known}."))
    }
    sheet.data["sweep"] = {**others, key: list(values)}
    path: Path = ("sweep", key)
    sheet.marks = {known: mark for known, mark in sheet.marks.items() if known[:2] != path}
    sheet.marks[path] = Mark(by, 0, 0, 0, 0)


def _checked(sheet: Sheet, known: set[Path], sweeps: bool) -> tuple[Scenario | None, list[Report]]:
    """The scenario that a sheet describes, or what is wrong with it; `known` are paths reported already."""
    empty = [path for path in _empty(sheet.data, ()) if path not in known]
    text = "no value given; without one, leave the key out"
    reports = [
        sheet.report(path, "no value given, and it is required" if path == ("name",) else text)
        for path in empty
    ]
    data = _without_empty(sheet.data)
    scenario, problems = None, []
    try:
        scenario = Scenario.model_validate(data)
    except ValidationError as error:
        problems = [p for p in describe(error, Scenario, data) if p.path not in known and p.path not in empty]
    reports += [sheet.report(problem.path, problem.text, problem.on_key) for problem in problems]
    if sweeps:
        reports += sweep_reports(sheet, data, {(problem.path, problem.text) for problem in problems})
    return scenario, reports


def _empty(data: Any, path: Path) -> list[Path]:
    """Paths of the keys that have no value."""
    if isinstance(data, dict):
        here = [(*path, key) for key, value in data.items() if value is None]
        return here + [found for key, value in data.items() for found in _empty(value, (*path, key))]
    if isinstance(data, list):
        return [found for i, value in enumerate(data) for found in _empty(value, (*path, i))]
    return []


def _without_empty(data: Any) -> Any:
    if isinstance(data, dict):
        return {key: _without_empty(value) for key, value in data.items() if value is not None}
    if isinstance(data, list):
        return [_without_empty(value) for value in data]
    return data
