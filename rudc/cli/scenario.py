"""`rudc scenario`: list, show, keys, new, validate, preview, schema."""

from __future__ import annotations

import contextlib
import json
import time
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NoReturn

import typer

from rudc.cli.complete import complete_scenarios
from rudc.cli.console import (
    AsJson,
    Quiet,
    broken_left_out,
    console,
    note,
    note_sweep,
    print_json,
    print_table,
    warn,
)
from rudc.cli.options import Overrides, parse_overrides
from rudc.errors import InputError, ScenarioError

if TYPE_CHECKING:
    from rudc.scenario import Scenario

app = typer.Typer(no_args_is_help=True, help="Scenario files: find, write, check and draw them.")

WATCH_S = 0.5
"""s between two looks at files that are watched"""


@app.command("list")
def list_(
    patterns: Annotated[
        list[str] | None,
        typer.Argument(metavar="[PATTERN]...", help="Names, files, patterns; all shipped by default."),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """The scenarios, what happens in them, and why they are out of distribution (those that are).

    **Example**: `rudc scenario list --json | jq -r '.[] | select(.out_of_distribution) | .name'`
    """
    from rich.text import Text

    from rudc.scenario import find_scenarios, shipped_scenarios
    from rudc.scenario.dotted import value_text

    with broken_left_out():
        found = find_scenarios(patterns or list(shipped_scenarios()))
    if as_json:
        print_json([_listed(scenario) for scenario in found])
        return
    rows = []
    for scenario in found:
        swept = "; ".join(
            f"{key}: {', '.join(map(value_text, values))}" for key, values in scenario.sweep.items()
        )
        extra = f"\nsweep of {swept}" if swept else ""
        why = f"\nOOD: {scenario.out_of_distribution}" if scenario.out_of_distribution else ""
        what = Text.assemble(scenario.description, extra, (why, "dim"))
        rows.append([scenario.name, scenario.network, what])
    print_table(["name", "network", "what happens"], rows)


def _listed(scenario: Scenario) -> dict[str, Any]:
    return {
        "name": scenario.name,
        "network": scenario.network,
        "description": scenario.description,
        "out_of_distribution": scenario.out_of_distribution,
        "events": [event.kind for event in scenario.events],
        "sweep": scenario.sweep,
    }


@app.command()
def show(
    source: Annotated[str, typer.Argument(metavar="NAME", help="Shipped name or file.")],
    resolved: Annotated[
        bool, typer.Option("--resolved", help="With all that it extends, and every default.")
    ] = False,
    as_json: Annotated[
        bool, typer.Option("--json", help="As JSON, with all that it extends, and every default.")
    ] = False,
) -> None:
    """Print a scenario file as it is, or all that it means, as a file of its own.

    **Example**: `rudc scenario show perfect_storm --resolved > storm.yaml`
    """
    from rudc.scenario import load_scenario
    from rudc.scenario.library import find_file, text_of

    if as_json:
        print_json(load_scenario(source).data())
    else:
        typer.echo(load_scenario(source).to_yaml() if resolved else text_of(find_file(source)), nl=False)


@app.command()
def keys(
    topic: Annotated[
        str | None,
        typer.Argument(metavar="[KIND]", help="A kind of event, `events`, `when`, or a part: `traffic.idm`."),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """What may stand in a scenario file: every key, its type, unit and default, and what it means.

    Wherever a number stands, a distribution may: `{uniform: [low, high]}`, `{normal: {mean: m, std: s,
    low: l, high: h}}` or `{choice: [a, b]}`.

    **Example**: `rudc scenario keys hard_brake`
    """
    from rudc.scenario.keys import sections

    with broken_left_out():
        found = sections(topic)
    if as_json:
        print_json([asdict(section) for section in found])
        return
    for k, section in enumerate(found):
        console().print(f"{chr(10) * bool(k)}{section.name}: {section.text}", markup=False)
        rows = [[key.name, key.type, key.unit, key.default, key.text] for key in section.keys]
        print_table(["key", "type", "unit", "default", "meaning"], rows)


@app.command()
def new(
    name: Annotated[str, typer.Argument(help="Name of the scenario; the file is NAME.yaml.")],
    folder: Annotated[Path, typer.Option("--in", metavar="DIR", help="Folder for the file.")] = Path("."),
    quiet: Quiet = False,
) -> None:
    """Write a scenario to start from, with its JSON Schema beside it so that editors complete and check.

    **Example**: `rudc scenario new my_junction`, then edit `my_junction.yaml`
    """
    from rudc.files import make_folder, write_atomically
    from rudc.scenario import json_schema, load_scenario, scenario_template, shipped_scenarios

    name, path = _new_file(name, folder)
    if path.exists():
        raise InputError(f"{path} is there already; choose another name, or delete it")
    make_folder(folder)
    schema = folder / "rudc-scenario.schema.json"
    write_atomically(schema, json.dumps(json_schema(), indent=2) + "\n")
    write_atomically(path, scenario_template(name, schema.name))
    try:
        load_scenario(path)
    except ScenarioError:
        path.unlink()
        raise
    note(f"{path} written; next: rudc scenario preview {path}, and rudc run {path} --agent gap-acceptance")
    if name in shipped_scenarios():
        warn(f"warning: `{name}` alone is the shipped scenario; this one is named by its file, {path}")


def _new_file(given: str, folder: Path) -> tuple[str, Path]:
    """Name and file of a new scenario, given by its name, with `.yaml` or without. Raises InputError."""
    from rudc.scenario.library import SUFFIXES
    from rudc.scenario.model import is_plain_name
    from rudc.scenario.yaml_text import LONGEST, read_value

    suffix = next((suffix for suffix in SUFFIXES if given.endswith(suffix)), "")
    name = given.removesuffix(suffix)
    if not is_plain_name(name):
        folder_too = "; give the folder by --in DIR" if Path(given).name != given else ""
        raise InputError(
            f"{given!r} cannot be a scenario's name: expected letters, digits, '_', '-' and '.'{folder_too}"
        )
    if not isinstance(read_value(name[:LONGEST]), str):
        raise InputError(f"{given!r} cannot be a scenario's name: YAML reads it as another thing than text")
    return name, folder / f"{name}{suffix or SUFFIXES[0]}"


@app.command()
def validate(
    files: Annotated[
        list[str],
        typer.Argument(
            metavar="FILE...", help="Files, shipped names, or patterns.", autocompletion=complete_scenarios
        ),
    ],
    seeds: Annotated[
        int, typer.Option(min=0, metavar="N", help="Drive N episodes, to see how often its events happen.")
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
    warning names each event that waits for a `simulation_time`, `traveled_distance` or `speed` that no
    episode reaches, for a quantity `below` its least value, for a time between two decisions, or whose
    `probability` is 0, a destination that no episode reaches, a kind of `traffic.mix` that may drive nowhere,
    and what is in the ego's exit beyond its destination. With `--seeds N`, `planner` drives N
    episodes, and the command says how they end and how often events happen.

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
    from rudc.scenario.library import existing_files, shipped_scenarios, shown

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
            driven, unset = _driven(scenario, seeds)
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


def _driven(scenario: Scenario, seeds: range) -> tuple[dict[str, list[Any]], list[str]]:
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
                outcomes = driven.outcomes
                ends.append({"swept": swept, "outcomes": outcomes, "seeds": ended, "text": driven.ends})
            firings += [{"swept": swept, **asdict(one), "text": str(one)} for one in driven.firings]
            wrong += driven.wrong
    return {"ends": ends, "firings": firings}, wrong


@app.command()
def preview(
    source: Annotated[
        str, typer.Argument(metavar="FILE", help="File or shipped name.", autocompletion=complete_scenarios)
    ],
    seed: Annotated[int, typer.Option(min=0, help="Which episode is shown.")] = 0,
    out: Annotated[
        Path | None, typer.Option("--out", "-o", metavar="F.png", help="Image. Default: NAME.png.")
    ] = None,
    animate: Annotated[
        bool,
        typer.Option("--animate", help="A film instead, NAME.gif: the episode as `planner` drives it."),
    ] = False,
    overrides: Overrides = None,
) -> None:
    """Draw a scenario's first scene for one seed: the ego (yellow) and its path, traffic (blue), events
    (orange, numbered), and a grid in metres, as a file's `position: [x, y]` counts them.

    **Example**: `rudc scenario preview blocked_left_turn --seed 3 --out blocked.png`
    """
    from rudc.drawing.picture_file import check_film, check_picture
    from rudc.drawing.preview import draw_preview
    from rudc.scenario import load_scenario
    from rudc.world.fitting import misfits

    scenario = load_scenario(source, parse_overrides(overrides), misfits)
    note_sweep(scenario)
    path = out or Path(f"{scenario.name}.{'gif' if animate else 'png'}")
    if animate:
        check_film(path)
        _animate(scenario, seed, path)
        typer.echo(path)
    else:
        check_picture(path)
        typer.echo(draw_preview(scenario, seed, path))


def _animate(scenario: Scenario, seed: int, path: Path) -> None:
    """Drive an episode by the driver that needs no training, and write it as a film."""
    from rudc.agents.registry import make_agent
    from rudc.env.episode import Episode
    from rudc.evaluation.film import Film
    from rudc.evaluation.rollout import run_episode
    from rudc.network.network import load_network
    from rudc.world.world import World

    driver = make_agent("planner")
    with World(load_network(scenario.network, scenario.junction)) as world:
        episode = Episode(world)
        film = Film(episode, driver.name)
        run_episode(episode, scenario.plan(seed), driver, watch=film.watch)
    film.save(path)


@app.command()
def schema(
    out: Annotated[
        Path | None, typer.Option("--out", "-o", metavar="F.json", help="File. Default: to the screen.")
    ] = None,
) -> None:
    """The JSON Schema of scenario files, for editors: they complete keys and underline mistakes.

    **Example**: `rudc scenario schema --out scenario.schema.json`, and as a file's first line
    `# yaml-language-server: $schema=scenario.schema.json`
    """
    from rudc.files import check_place, make_folder_of, write_atomically
    from rudc.scenario import json_schema

    text = json.dumps(json_schema(), indent=2) + "\n"
    if out is None:
        typer.echo(text, nl=False)
    else:
        check_place(out, "a JSON Schema", ".json")
        make_folder_of(out)
        write_atomically(out, text)
