"""`rudc agent`: list, show, calibrate."""

from __future__ import annotations

import json
from contextlib import nullcontext
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rudc.cli.complete import complete_agents
from rudc.cli.console import AsJson, Quiet, broken_left_out, note, print_json, print_table, warn

if TYPE_CHECKING:
    from rudc.training.calibration import Calibration, Limits

app = typer.Typer(no_args_is_help=True, help="Who can drive the ego vehicle.")


@app.command("list")
def list_(
    as_json: Annotated[bool, typer.Option("--json", help="As JSON, with folders of checkpoints.")] = False,
    quiet: Quiet = False,
) -> None:
    """Everything that can drive, or be trained to: its name in the paper, whether it is shipped, and how it
    differs from rudc-t.

    **Example**, what can be trained:
    `rudc agent list --json | jq -r '.[].algorithm | select(. != "")' | sort -u`
    """
    from rudc.agents.drivers import offered_in_vain
    from rudc.agents.filtered import filters
    from rudc.agents.listing import entries
    from rudc.learning.algorithms import ALGORITHMS

    with broken_left_out():
        found = entries()
    for text in offered_in_vain():
        warn(f"warning: {text}")
    if as_json:
        print_json([asdict(entry) for entry in found])
        return
    rows = [[e.name, e.paper, e.status, e.text] for e in found]
    print_table(["name", "in the paper", "status", "what it is"], rows, widest=100)
    note("in the paper: its row of Tab. comparison or ablation (`rudc table DIR --against paper`)")
    folder = next((e.checkpoint.parent for e in found if e.checkpoint is not None), None)
    if folder is not None:
        note(f"shipped: {folder}/NAME")
    note(f"rudc train NAME --out DIR trains {', '.join(ALGORITHMS)}; then --agent DIR")
    note(f"{', '.join(f'NAME+{suffix}' for suffix in filters())}: a safety filter behind any but sumo")


@app.command()
def show(
    name: Annotated[str, typer.Argument(help="Name of an agent.", autocompletion=complete_agents)],
    as_json: AsJson = False,
) -> None:
    """What an agent does, and all its settings.

    **Example**: `rudc agent show gap-acceptance+ttcbf`
    """
    from rudc.agents.registry import agent_settings, agent_summary

    text, settings = agent_summary(name), agent_settings(name)
    if as_json:
        print_json({"name": name, "text": text, "settings": settings})
        return
    typer.echo(f"{name}: {text}")
    typer.echo(json.dumps(settings, indent=2))


@app.command()
def calibrate(
    folder: Annotated[
        Path, typer.Argument(metavar="DIR", help="Folder of a training, or of its checkpoint.")
    ],
    episodes: Annotated[
        int, typer.Option("--episodes", "-n", min=1, help="Episodes of each scenario.")
    ] = 200,
    scenario: Annotated[
        list[str] | None,
        typer.Option(metavar="SCENARIO", help="Instead of random_destination and dense_left_turn."),
    ] = None,
    write: Annotated[bool, typer.Option("--write", help="Store what is found in DIR.")] = False,
    quiet: Quiet = False,
) -> None:
    """Measure the percentiles of a trained agent's uncertainty, sigma_l and sigma_h, as it drives.

    The agent drives held-out episodes as in a sweep; those that succeed count. Measured are sigma as in the
    paper, and sigma by route, which `sigma=route` uses: sigma compared with what is usual where the ego is.
    The command also says how often the stored percentiles are exceeded (5 % and 2.5 % if they hold). Only
    `--write` changes the agent.

    **Example**: `rudc agent calibrate out/first`
    """
    from rudc.agents.checkpoint import checkpoint_in, find_checkpoint, save_learnt, shipped_checkpoints
    from rudc.errors import AgentError
    from rudc.files import past_links, try_place
    from rudc.learning.checkpoint import DESCRIPTION, WEIGHTS
    from rudc.training.calibration import SCENARIOS, calibrate
    from rudc.training.folder import CONFIG, held

    found = checkpoint_in(folder) or find_checkpoint(str(folder))
    if found is None:
        raise AgentError(f"no checkpoint in {folder}")
    if write and past_links(found) in map(past_links, shipped_checkpoints().values()):
        raise AgentError(
            f"{folder} is a shipped agent, which --write leaves as it is; give a folder of your own, "
            f"such as a copy of {found}"
        )
    names, done = scenario or list(SCENARIOS), 0

    def advance() -> None:
        nonlocal done
        done += 1
        if done % 10 == 0:
            note(f"{done}/{len(names) * episodes} episodes")

    goes_on = write and (found.parent / CONFIG).is_file()  # a training may replace its checkpoint meanwhile
    with held(found.parent, warn) if goes_on else nullcontext():
        for name in (WEIGHTS, DESCRIPTION) if write else ():
            try_place(found / name)
        result = calibrate(found, names, episodes, advance=advance)
        _print_calibration(result)
        if write:  # last: if it fails, what was found is told
            save_learnt(found, result.learnt)
    note("stored" if write else "not stored: add --write")


def _print_calibration(result: Calibration) -> None:
    print_table(
        ["sigma", "", "sigma_l", "sigma_h"],
        [line for kind, limits in result.kinds.items() for line in _lines(kind, limits)],
        right=(2, 3),
    )
    which = f"the {result.episodes} episodes that succeeded"
    if not result.succeeded:
        which = f"all {result.episodes} episodes"
        warn("warning: none of the episodes succeeded: sigma_l and sigma_h are not to be relied on")
    if result.left_out:
        warn(f"warning: {result.left_out} episodes could not be set up or driven to their end: left out")
    note(
        f"of {result.decisions} decisions in {which}; the route explains {result.explained:.0%} of log sigma"
    )


def _lines(kind: str, limits: Limits) -> list[list[str]]:
    lines = [[kind, "measured", *(f"{value:.3f}" for value in limits.found)]]
    if limits.before is not None:
        lines.append([kind, "stored so far", *(f"{value:.3f}" for value in limits.before)])
    if limits.above is not None:
        lines.append([kind, "decisions above those", *(f"{share:.1%}" for share in limits.above)])
    return lines
