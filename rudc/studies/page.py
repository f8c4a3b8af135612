"""What every study prints and keeps to be read: what was driven, its tables, and what their words mean."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from rudc.imports import rudc_command
from rudc.studies.base import Order

OF_CONSTRAINED = {
    "constrained": "the vehicles that the filter keeps clear of: `gated`, those whose predicted path meets "
    "the EV's; `all`, every one",
}
OF_RATES = {
    "SR, VR, FR": "share of episodes that ended in success, in a violation, frozen; in brackets the 95 % "
    "interval",
}
"""words of several studies"""


def page(study: str, order: Order, said: str, tables: Iterable[str], words: Mapping[str, str]) -> str:
    """A study's page. `said`: what was driven or read, in sentences; `words`: what stands in the tables and
    what it means.
    """
    return "\n".join(
        [
            f"# Study {study}\n",
            f"{said} The command: `{command(study, order)}`.\n",
            *tables,
            "## Words\n",
            *(f"- {word}: {meaning}" for word, meaning in words.items()),
            "",
        ]
    )


def command(study: str, order: Order) -> str:
    """The command that gives the same again in another folder."""
    parts = ["study", study, *map(str, order.folders)]
    for agent in order.agents:
        parts += ["--agent", agent]
    given = {
        "--episodes": order.episodes,
        "--seed": order.seed or None,
        "--budget": None if order.budget == Order.budget else order.budget,
        "--seeds": ",".join(map(str, order.training_seeds)) or None,
        "--trainings": order.trainings,
        "--out": "DIR",
    }
    for option, value in given.items():
        parts += [] if value is None else [option, str(value)]
    return rudc_command(*parts)
