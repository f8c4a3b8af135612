"""`EpisodeRecord`: what is kept of one episode, a row of `episodes.csv`."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from rudc.evaluation.columns import COLUMNS, Cell
from rudc.evaluation.store import one_line

LONGEST_ERROR = 2_000
"""characters of an error that a row keeps at most"""


@dataclass(frozen=True, slots=True)
class EpisodeRecord:
    """The values of the columns of one episode; what `rudc/evaluation/columns.py` says of each.

    An episode that could not be run has an `error`, and neither outcome nor numbers.
    """

    values: Mapping[str, Cell]
    """column -> value; a column that is not there is empty"""
    traceback: str = ""
    """traceback of what went wrong, in lines; goes to a file of its own"""

    @staticmethod
    def failed(scenario: str, agent: str, seed: int, error: str, traceback: str = "") -> EpisodeRecord:
        """The record of an episode that could not be run. A long error is cut: readers of CSV files refuse
        cells beyond some size; a traceback stays whole.
        """
        told = " ".join(error.split()) or "unknown"
        told = told if len(told) <= LONGEST_ERROR else f"{told[: LONGEST_ERROR - 3]}..."
        return EpisodeRecord({"scenario": scenario, "agent": agent, "seed": seed, "error": told}, traceback)

    @property
    def scenario(self) -> str:
        """Its name."""
        return self.text("scenario")

    @property
    def agent(self) -> str:
        """Its name."""
        return self.text("agent")

    @property
    def seed(self) -> int:
        """Which episode of the scenario."""
        return int(self.text("seed"))  # not by way of a float, which rounds those above 2^53

    @property
    def outcome(self) -> str:
        """How it ended (`rudc.env.outcome.Outcome`); empty with an error."""
        return self.text("outcome")

    @property
    def error(self) -> str:
        """Why it could not be run; else empty."""
        return self.text("error")

    def text(self, column: str) -> str:
        """A cell of its row."""
        return as_text(self.values.get(COLUMNS[column].name))

    def number(self, column: str) -> float:
        """A column's number; nan where it is empty."""
        text = self.text(column)
        return float(text) if text else math.nan

    def row(self) -> list[str]:
        """Its cells as text, in the order of `COLUMNS`."""
        return [self.text(name) for name in COLUMNS]


def as_text(value: object) -> str:
    """A cell of a CSV file: nothing for nan and None, shortest text that reads back as the same number."""
    if value is None:
        return ""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float):
        return "" if math.isnan(value) else repr(float(value))
    return one_line(str(value))
