"""`rudc scenario`: list, show, keys, new, validate, preview, schema."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

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
from rudc.cli.validate import validate
from rudc.errors import InputError, ScenarioError

if TYPE_CHECKING:
    from rudc.drawing.view import View
    from rudc.scenario import Scenario

DISTRIBUTIONS = (
    "A number may be drawn: {uniform: [low, high]}, {normal: {mean: m, std: s, low: l, high: h}}, "
    "{choice: [a, b]} or {choice: {values: [a, b], weights: [1, 3]}}; so may words whose type says so. "
    "{shared: NAME} is a number of the section `shared`: one draw for several keys; it says which value of "
    "{choice: [a, b], shared: NAME} it is, 0 the first."
)
DRAWN = "distribution", "uniform", "normal", "choice", "values", "weights"
"""words that are explained by DISTRIBUTIONS"""

app = typer.Typer(no_args_is_help=True, help="Scenario files: find, write, check and draw them.")


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
        typer.Argument(
            metavar="[KIND]", help="A kind of event, `events`, `when`, or any key: `traffic.idm`."
        ),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """What may stand in a scenario file: every key, its type, unit and default, and what it means. Given a
    single key, such as `duration`, every place where it may stand.

    **Example**: `rudc scenario keys hard_brake`
    """
    from rudc.scenario.keys import sections

    with broken_left_out():
        found = [] if topic in DRAWN else sections(topic)
    if as_json:
        print_json([asdict(section) for section in found])
        return
    for k, section in enumerate(found):
        console().print(f"{chr(10) * bool(k)}{section.name}: {section.text}", markup=False)
        rows = [[key.name, key.type, key.unit, key.default, key.text] for key in section.keys]
        print_table(["key", "type", "unit", "default", "meaning"], rows)
    (note if found else typer.echo)(DISTRIBUTIONS)


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


app.command("validate")(validate)


@app.command()
def preview(
    source: Annotated[
        str, typer.Argument(metavar="FILE", help="File or shipped name.", autocompletion=complete_scenarios)
    ],
    seed: Annotated[int, typer.Option(min=0, help="Which episode is shown.")] = 0,
    out: Annotated[
        Path | None, typer.Option("--out", "-o", metavar="F.png", help="Image. Default: NAME.png.")
    ] = None,
    at: Annotated[
        float | None,
        typer.Option(min=0.0, metavar="S", help="The scene S s after the start, as `planner` drives."),
    ] = None,
    animate: Annotated[
        bool,
        typer.Option("--animate", help="A film instead, NAME.gif: the episode as `planner` drives it."),
    ] = False,
    overrides: Overrides = None,
) -> None:
    """Draw a scenario's first scene for one seed, or a later one: the ego (yellow) and its path, traffic
    (blue), events (orange, numbered), and a grid in metres, as a file's `position: [x, y]` counts them.

    **Examples**

    `rudc scenario preview blocked_left_turn --seed 3 --out blocked.png`

    `rudc scenario preview sudden_brake --at 4.5`
    """
    from rudc.drawing.picture_file import check_film, check_picture, save_picture
    from rudc.drawing.preview import draw_preview, picture_of
    from rudc.scenario import load_scenario
    from rudc.world.fitting import misfits

    if animate and at is not None:
        raise InputError("--animate shows the whole episode, and --at one scene: give one of them")
    scenario = load_scenario(source, parse_overrides(overrides), misfits, by="--set")
    note_sweep(scenario)
    path = out or Path(f"{scenario.name}.{'gif' if animate else 'png'}")
    if animate:
        check_film(path)
        _animate(scenario, seed, path)
    else:
        check_picture(path)
        if at is None:
            draw_preview(scenario, seed, path)
        else:
            save_picture(picture_of(scenario, _driven(scenario, seed, at)), path)
    typer.echo(path)


def _driven(scenario: Scenario, seed: int, at_s: float) -> View:
    """What there is to see `at_s` s after the start of an episode that `planner` drives. Raises InputError if
    the episode ends before.
    """
    from rudc.agents.registry import make_agent
    from rudc.drawing.view import view_of
    from rudc.env.episode import Episode
    from rudc.network.network import load_network
    from rudc.world.world import World

    driver = make_agent("planner")
    with World(load_network(scenario.network, scenario.junction)) as world:
        episode = Episode(world)
        scene = episode.reset(scenario.plan(seed), ego_driver=driver.ego_driver)
        driver.reset(scene, seed)
        half = 0.5 * world.config.decision_s
        while episode.truth.time_s < at_s - half:
            if episode.outcome is not None:
                end = f"{episode.truth.time_s:.1f} s ({episode.outcome})"
                raise InputError(f"--at {at_s:g}: with seed {seed} the episode ends at {end}")
            scene = episode.step(driver.act(scene).u).scene
        return view_of(world, episode.outcome or "")


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
