"""`EpisodeRecord`: what is kept of one episode, a row of `episodes.csv`, and its `Conditions`."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

Cell = str | int | float | bool


@dataclass(frozen=True, slots=True)
class Conditions:
    """Under what conditions an episode took place: a row of `conditions.csv`, beside `episodes.csv`."""

    origin: str = ""
    """arm the ego came from"""
    destination: str = ""
    """arm it was to leave by"""
    turn: str = ""
    """left, straight or right"""
    priority: str = ""
    """`major` or `minor`: whether the arm it came from has priority"""
    redraws: int | None = None
    """how often the episode was drawn again because the ego could not start safely"""
    density: float = math.nan
    """veh/km on the road, mean over the episode"""
    sv_collisions: int | None = None
    """pairs of surrounding vehicles that came to overlap"""


@dataclass(frozen=True, slots=True)
class EpisodeRecord:
    """What is kept of one episode. Its columns are the fields in their order, `conditions` apart.

    An episode that could not be run has an `error`, and neither outcome nor numbers.
    """

    scenario: str
    agent: str
    seed: int
    outcome: str = ""
    """success, frozen (time limit) or violation; empty with an error"""
    violation: str = ""
    """collision, off_road or wrong_way; else empty"""
    steps: int | None = None
    """decisions taken"""
    duration_s: float = math.nan
    """s of simulated time"""
    route_completion: float = math.nan
    """share of the way along the reference path from start to destination, 0 to 1"""
    mean_speed_mps: float = math.nan
    """m/s, mean of the ego's speed after each decision"""
    episode_reward: float = math.nan
    """sum of the rewards"""
    min_dtc_m: float = math.nan
    """m, smallest gap between the ego and anything; nan if there never was anything"""
    interventions: int | None = None
    """decisions in which the filter changed the action noticeably (`INTERVENTION`)"""
    mean_correction: float = math.nan
    """mean over decisions of |u - u_rl|, both scaled to [-1, 1]; 0 without a filter"""
    infeasible_steps: int | None = None
    """decisions in which the filter's QP had no solution"""
    mean_sigma: float = math.nan
    """mean uncertainty; nan for agents that state none"""
    max_sigma: float = math.nan
    """largest uncertainty"""
    decision_ms_mean: float = math.nan
    """ms that the agent took for a decision, filter included"""
    decision_ms_max: float = math.nan
    """ms, the longest"""
    fault: str = ""
    """whose fault a collision was: ego, other or shared"""
    error: str = ""
    """why the episode could not be run, in one line"""
    conditions: Conditions = Conditions()

    @staticmethod
    def failed(scenario: str, agent: str, seed: int, error: str) -> EpisodeRecord:
        """The record of an episode that could not be run."""
        return EpisodeRecord(scenario, agent, seed, error=" ".join(error.split()) or "unknown")

    def row(self) -> list[str]:
        """Its cells as text, in the order of `COLUMNS`."""
        return [as_text(getattr(self, name)) for name in COLUMNS]

    def conditions_row(self) -> list[str]:
        """The cells of its conditions as text, in the order of `CONDITIONS`."""
        return [as_text(getattr(self.conditions, name)) for name in CONDITIONS]


COLUMNS: tuple[str, ...] = tuple(f.name for f in fields(EpisodeRecord) if f.name != "conditions")
"""of `episodes.csv`, before those of swept parameters"""
CONDITIONS: tuple[str, ...] = tuple(f.name for f in fields(Conditions))
"""of `conditions.csv`, after those that say which episode it was"""
TIMING: tuple[str, ...] = ("decision_ms_mean", "decision_ms_max")
"""columns that depend on the machine: the only ones that may differ between two runs of the same sweep"""


def as_text(value: object) -> str:
    """A cell of a CSV file: nothing for nan and None, shortest text that reads back as the same number."""
    if value is None:
        return ""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float):
        return "" if math.isnan(value) else repr(float(value))
    return str(value)
