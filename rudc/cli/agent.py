"""`rudc agent`: list, show."""

from __future__ import annotations

import json
from typing import Annotated

import typer

from rudc.cli.complete import complete_agents
from rudc.cli.console import print_table

app = typer.Typer(no_args_is_help=True, help="Who can drive the ego vehicle.")


@app.command("list")
def list_() -> None:
    """Every name that `--agent` takes."""
    from rudc.agents.registry import agent_names, agent_summary

    print_table(["name", "what it does"], [[name, agent_summary(name)] for name in agent_names()])


@app.command()
def show(
    name: Annotated[str, typer.Argument(help="Name of an agent.", autocompletion=complete_agents)],
) -> None:
    """What an agent does, and all its settings.

    **Example**: `rudc agent show gap-acceptance+ttcbf`
    """
    from rudc.agents.registry import agent_settings, agent_summary

    typer.echo(f"{name}: {agent_summary(name)}")
    typer.echo(json.dumps(agent_settings(name), indent=2))
