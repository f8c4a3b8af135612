"""`rudc scenario validate`: check scenario files, once or whenever one changes, and drive some episodes."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NoReturn

import typer

from rudc.cli.complete import complete_scenarios
from rudc.cli.console import AsJson, Quiet, note, print_json, warn
from rudc.errors import InputError, ScenarioError

if TYPE_CHECKING:
    from rudc.scenario import Scenario

WATCH_S = 0.5
"""s between two looks at files that are watched"""


def validate(
    files: Annotated[
        list[str],
        typer.Argument(
            metavar="FILE...", help="Files, shipped names, or patterns.", autocompletion=complete_scenarios
        ),
    ],
    seeds: Annotated[
        int,
        typer.Option(
            min=0, metavar="N", help="Drive N episodes, to see how they end and when its events happen."
        ),
    ] = 0,
    seed: Annotated[int | None, typer.Option(min=0, help="The first of these episodes. Default: 0.")] = None,
    watch: Annotated[
        bool, typer.Option("--watch", help="Do it again whenever a scenario beside it changes.")
    ] = False,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Check scenario files, that each fits its network, and that its first sixteen episodes can be set up.

    Of a sweep every value is checked, and sixteen points at most are set up; the answer says how many.
    A line for each file; every problem reads `FILE:LINE:COLUMN: key.path: what is wrong`, all at once. A
    warning names each event that waits for a time, a way, a speed or a place that no episode reaches, for a
    quantity `below` its least value, for a time between two decisions, for the end of an event that has no
    duration, or for a vehicle from where no arm is, or whose `probability` is 0, a start speed or a
    destination that no episode reaches, a kind of `traffic.mix` that may drive nowhere, and what is in the
    ego's exit beyond its destination. With `--seeds N`, `planner` drives N episodes, and the command says how
    they end (with whom the ego collides, and whose fault it is), how often and when events happen, and how
    near the ego comes to the road users that take part.

    **Examples**

    `rudc scenario validate my_scenarios/*.yaml`

    `rudc scenario validate sudden_brake --seeds 20 --seed 100`

    `rudc scenario validate my_scenario.yaml --watch`, in a terminal beside the editor
    """
    if watch and as_json:
        raise InputError("--json is written once, and --watch never ends: give one of them")
    if seed is not None and not seeds:
        raise InputError("--seed is the first of the episodes that --seeds N drives: give --seeds, too")
    driven = range(seed or 0, (seed or 0) + seeds)
    if watch:
        _validate_again_and_again(files, driven)
    checked: list[dict[str, Any]] = []
    problems = _problems(files, driven, checked.append if as_json else _say)
    if as_json:
        print_json(checked)
    if problems:
        raise ScenarioError("\n".join(problems))


def _problems(files: list[str], seeds: range, tell: Callable[[dict[str, Any]], None]) -> list[str]:
    """What is wrong in all files; `tell` gets what was found about each file."""
    from rudc.evaluation.preflight import TRIED, never_happening, tried_points, validated
    from rudc.scenario.library import existing_files, overlooked, shipped_scenarios, shown

    for text in overlooked(files):
        warn(f"warning: {text}")
    shipped = {path: name for name, path in shipped_scenarios().items()}
    paths, problems = existing_files(files)
    for path in paths:
        scenario, wrong = validated(path, 1 if seeds else TRIED)  # what is driven is set up anyway
        problems += wrong
        found: dict[str, Any] = {"scenario": shipped.get(path, shown(path)), "problems": wrong}
        if scenario is not None and not wrong:
            found |= {
                "events": len(scenario.events),
                "swept_points": len(scenario.points()) if scenario.sweep else 0,
                "set_up": len(tried_points(scenario)),
                "warnings": never_happening(scenario),
            }
            driven, unset = _tried(scenario, seeds)
            problems += (wrong := [f"{shown(path)}: {text}" for text in unset])
            found |= {"problems": wrong, **driven}
        tell(found)
    return list(dict.fromkeys(problems))


def _say(found: dict[str, Any]) -> None:
    """Print whether a file is fine, its warnings, and how often its events happen."""
    from rudc.scenario.dotted import value_text

    name, wrong = found["scenario"], len(found["problems"])
    if "events" not in found:
        typer.echo(f"{name}: {wrong} problem{'s' * (wrong != 1)}")
        return
    count, points, tried = found["events"], found["swept_points"], found["set_up"]
    swept = f", {points} swept points" if points else ""
    swept += f", of which {tried} were set up" if tried < points else ""
    state = f"{wrong} problem{'s' * (wrong != 1)}" if wrong else "ok"
    typer.echo(f"{name}: {state} ({count} event{'s' * (count != 1)}{swept})")
    for warning in found["warnings"]:
        typer.echo(f"  warning: {warning}")
    for firing in [*found["ends"], *found["firings"]]:
        values = "".join(f"{key}={value_text(value)}, " for key, value in firing["swept"].items())
        typer.echo(f"  {values}{firing['text']}")


def _validate_again_and_again(files: list[str], seeds: range) -> NoReturn:
    """Validate whenever one of the files changes, or another scenario beside it, which it may extend."""
    seen: dict[Path, int] | None = None
    while True:
        now = _states(files)
        if now != seen:
            seen = now
            for problem in _problems(files, seeds, _say):
                typer.echo(problem)
            note("watching; Ctrl-C ends it")
        time.sleep(WATCH_S)


def _states(files: list[str]) -> dict[Path, int]:
    """Each scenario file in the folders of these -> when it was written last, ns."""
    from rudc.scenario.library import SUFFIXES, existing_files

    found: dict[Path, int] = {}
    for folder in dict.fromkeys(path.parent for path in existing_files(files)[0]):
        for path in folder.iterdir():
            if path.suffix in SUFFIXES:
                with contextlib.suppress(OSError):  # editors replace files
                    found[path] = path.stat().st_mtime_ns
    return found


def _tried(scenario: Scenario, seeds: range) -> tuple[dict[str, list[Any]], list[str]]:
    """How these episodes of a scenario end and how often its events happen in them, for each swept value,
    and what is wrong with those that cannot be set up.
    """
    ends: list[dict[str, Any]] = []
    firings: list[dict[str, Any]] = []
    wrong: list[str] = []
    if seeds:
        from rudc.evaluation.firing import drive_and_count

        for swept, point in scenario.grid():
            driven = drive_and_count(point, seeds)
            if ended := driven.seeds:
                hits = {seed: met._asdict() for seed, met in driven.hits.items()}
                astray = {seed: where._asdict() for seed, where in driven.astray.items()}
                told = {"outcomes": driven.outcomes, "seeds": ended, "hits": hits, "astray": astray}
                ends.append({"swept": swept, **told, "text": driven.ends})
            firings += [
                {"swept": swept, **asdict(one), "fired": one.fired, "text": str(one)}
                for one in driven.firings
            ]
            wrong += driven.wrong
    return {"ends": ends, "firings": firings}, wrong
