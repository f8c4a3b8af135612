"""The one table of what is known of an episode: the columns of `episodes.csv`, and the metrics made of them.

A new column is one entry of `COLUMNS`: its name, its text, and how it is read off an episode that was driven.
It then stands in `episodes.csv`, in what `rudc run` prints, in `rudc table --by NAME` and, if it has an
`average`, in `rudc table --metrics NAME`. Folders written before it read as empty there.

The paper's seven metrics (Tab. "Evaluation Metrics"), `METRICS`, are rates of outcomes and means of columns.
Every episode ends in exactly one outcome: SR + FR + VR = 100 %. Episodes that could not be run (`error`) are
counted apart and enter no metric.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np

from rudc.env.outcome import Outcome
from rudc.errors import InputError

if TYPE_CHECKING:
    from rudc.agents.base import Decision
    from rudc.env.episode import EpisodeMetrics
    from rudc.network.route import Route
    from rudc.scenario.plan import EpisodePlan
    from rudc.vehicle import EgoVehicle

Cell = str | int | float | bool | None
Better = Literal["higher", "lower"]
Average = Literal["episodes", "decisions", "share"]
"""mean over the episodes; mean over all decisions, of a column that is itself a mean over decisions; share of
all decisions in percent, of a column that counts decisions"""

BOUND = 1e12
"""no episode has a number as large as this; statistics of larger ones overflow"""
INTERVENTION_MPS2, INTERVENTION_RAD = 0.1, 0.005
"""an intervention changes acceleration or steering by more than this; nobody would feel a smaller change"""


class Driven(NamedTuple):
    """An episode driven to its end: what columns are read off."""

    plan: EpisodePlan
    agent: str
    """its name"""
    vehicle: EgoVehicle
    route: Route
    metrics: EpisodeMetrics
    decisions: Sequence[Decision]
    """at least one"""
    spent_ms: Sequence[float]
    """ms that each took"""


@dataclass(frozen=True)
class Column:
    """A column of `episodes.csv`."""

    name: str
    text: str
    """what it says, in a line"""
    read: Callable[[Driven], Cell] | None = None
    """its value; None for a column that is not about an episode that was driven"""
    unit: str = ""
    better: Better | None = None
    average: Average | None = None
    """how its mean is taken; None for a column without one"""
    decimals: int = 6
    """decimals that are kept; no quantity here needs more than six"""
    is_timing: bool = False
    """whether it depends on the machine: only such columns may differ between two runs of the same sweep"""

    def value(self, driven: Driven) -> Cell:
        """The column's value for an episode; None where it is not finite. Raises InputError for a value that
        no cell can hold.
        """
        found = None if self.read is None else self.read(driven)
        if isinstance(found, np.generic):
            found = found.item()
        if wrong := self._wrong(found):
            raise InputError(f"column {self.name!r}: {wrong}, got {str(found)[:40]!r}")
        if not isinstance(found, float):
            return found
        return round(float(found), self.decimals) if math.isfinite(found) else None

    def _wrong(self, value: object) -> str:
        """What the value should have been, if no cell can hold it; empty if one can."""
        if value is None:
            return ""
        if self.average is not None:
            if not isinstance(value, (int, float)) or isinstance(value, bool):
                return "what has an average is a number"
            too_large = BOUND <= abs(value) < math.inf
            return f"what has an average is between -{BOUND:g} and {BOUND:g}" if too_large else ""
        if not isinstance(value, (str, int, float)):
            return "a value is a number, a text, true, false or None"
        return "a text is one line" if isinstance(value, str) and len(value.splitlines()) > 1 else ""


@dataclass(frozen=True)
class Metric:
    """A number that says how a group of episodes went."""

    name: str
    text: str
    unit: str = ""
    better: Better | None = None
    column: str = ""
    """column that it is the mean of; empty for a rate"""
    average: Average = "episodes"
    outcomes: tuple[str, ...] = ()
    """outcomes that it is the rate of; empty for a mean"""
    scale: float = 1.0
    """factor from the column's unit to its own"""
    decimals: int = 1
    """decimals shown in tables"""


# ---- what the columns read


def is_intervention(decision: Decision) -> bool:
    """Whether what was proposed was changed by more than `INTERVENTION_MPS2` or `INTERVENTION_RAD`: by a
    correction, or for course and grip.
    """
    acceleration, steering = np.abs(decision.u - decision.u_rl)
    return bool(acceleration > INTERVENTION_MPS2 or steering > INTERVENTION_RAD)


def _engaged(driven: Driven) -> int:
    return sum(d.corrected is not None and d.corrected.status != "nominal" for d in driven.decisions)


def _infeasible(driven: Driven) -> int:
    return sum(d.corrected is not None and d.corrected.infeasible for d in driven.decisions)


def _mean_correction(driven: Driven) -> float:
    changes = [d.u - d.u_rl for d in driven.decisions if d.corrected is not None]
    return sum(driven.vehicle.scaled(*change) for change in changes) / len(driven.decisions)


def _sigmas(driven: Driven) -> list[float]:
    return [d.sigma for d in driven.decisions if not math.isnan(d.sigma)]


def _mean(values: Sequence[float]) -> float:
    return float(np.mean(values)) if values else math.nan


# ---- the table

_TABLE = (
    Column("scenario", "name of the scenario", lambda e: e.plan.scenario),
    Column("agent", "name of the agent, settings included", lambda e: e.agent),
    Column("seed", "which episode of the scenario", lambda e: e.plan.seed),
    Column(
        "outcome",
        f"how it ended: {', '.join(Outcome)}; empty with an error",
        lambda e: e.metrics.outcome,
    ),
    Column("steps", "decisions taken", lambda e: e.metrics.steps, average="episodes"),
    Column("duration_s", "simulated time", lambda e: e.metrics.duration_s, "s", "lower", "episodes"),
    Column(
        "route_completion",
        "share of the way along the reference path from start to destination, 0 to 1",
        lambda e: e.metrics.route_completion,
        better="higher",
        average="episodes",
    ),
    Column(
        "mean_speed_mps",
        "mean speed of the ego, taken after each decision",
        lambda e: e.metrics.mean_speed_mps,
        "m/s",
        "higher",
        "episodes",
    ),
    Column(
        "episode_reward", "sum of the rewards", lambda e: e.metrics.episode_reward, "", "higher", "episodes"
    ),
    Column(
        "min_dtc_m",
        "smallest gap between the ego and anything; empty if there never was anything",
        lambda e: e.metrics.min_dtc_m,
        "m",
        "higher",
        "episodes",
    ),
    Column(
        "interventions",
        f"decisions whose acceleration was changed by more than {INTERVENTION_MPS2:g} m/s2, or steering by "
        f"more than {INTERVENTION_RAD:g} rad: by a correction, or for course and grip (outlook)",
        lambda e: sum(map(is_intervention, e.decisions)),
        average="share",
    ),
    Column(
        "engaged_steps",
        "decisions that the correction did not pass on at once (a status other than `nominal`), "
        "however little it changed",
        _engaged,
        average="share",
    ),
    Column(
        "mean_correction",
        "mean over the decisions of the size of u - u_rl, both numbers scaled to [-1, 1]: all changes, also "
        "those for course and grip (a replay's largest correction leaves these out); 0 without a filter",
        _mean_correction,
        average="decisions",
    ),
    Column(
        "infeasible_steps",
        "decisions for which the filter's QP had no solution",
        _infeasible,
        average="share",
    ),
    Column(
        "mean_sigma",
        "mean of sigma_total, in units of reward; empty for agents that state no uncertainty",
        lambda e: _mean(_sigmas(e)),
        average="episodes",
    ),
    Column(
        "max_sigma", "largest sigma_total", lambda e: max(_sigmas(e), default=math.nan), average="episodes"
    ),
    Column(
        "decision_ms_mean",
        "mean time that the agent took for a decision, filter included",
        lambda e: sum(e.spent_ms) / len(e.spent_ms),
        "ms",
        "lower",
        "episodes",
        decimals=4,
        is_timing=True,
    ),
    Column(
        "decision_ms_max",
        "longest time that it took",
        lambda e: max(e.spent_ms),
        "ms",
        "lower",
        "episodes",
        decimals=4,
        is_timing=True,
    ),
    Column(
        "fault", "whose fault a collision was: ego, other or shared; else empty", lambda e: e.metrics.fault
    ),
    Column(
        "hit",
        "what the ego collided with: car, truck, bus, motorcycle, bicycle, pedestrian, obstacle; else empty",
        lambda e: e.metrics.hit,
    ),
    Column(
        "events_fired",
        "how many of the scripted events happened; empty where nothing is scripted",
        lambda e: e.metrics.events_fired,
        average="episodes",
    ),
    Column(
        "first_event_s",
        "when the first of them began; empty if none did",
        lambda e: e.metrics.first_event_s,
        "s",
        average="episodes",
    ),
    Column(
        "first_event_visible_s",
        "when the ego's sensors first showed one of them, or it came onto a slippery patch; empty if never",
        lambda e: e.metrics.first_event_visible_s,
        "s",
        average="episodes",
    ),
    Column("error", "why the episode could not be run, in one line"),
    # the conditions under which it took place
    Column("origin", "arm that the ego came from", lambda e: e.route.origin),
    Column("destination", "arm that it was to leave by", lambda e: e.route.destination),
    Column("turn", "left, straight or right", lambda e: e.route.turn),
    Column(
        "priority",
        "major or minor: whether the arm it came from has priority; minor where all are equal",
        lambda e: "major" if e.route.major else "minor",
    ),
    Column(
        "redraws",
        "how often the episode was drawn again because the ego could not start safely",
        lambda e: e.metrics.redraws,
        average="episodes",
    ),
    Column("density", "mean density on the road", lambda e: e.metrics.density, "veh/km", average="episodes"),
    Column(
        "sv_collisions",
        "pairs of surrounding vehicles that came to overlap",
        lambda e: e.metrics.sv_collisions,
        average="episodes",
    ),
)
COLUMNS: Mapping[str, Column] = {column.name: column for column in _TABLE}
"""name -> column of `episodes.csv`, in their order; those of swept parameters come after them"""
IDENTITY = ("scenario", "agent", "seed")
"""the first columns: with the swept values, what tells one episode from another"""
TIMING = tuple(column.name for column in _TABLE if column.is_timing)

VIOLATIONS = tuple(str(outcome) for outcome in Outcome if outcome.is_violation)
METRICS: tuple[Metric, ...] = (
    Metric("SR", "reached the destination", "%", "higher", outcomes=(str(Outcome.SUCCESS),)),
    Metric("FR", "ran into the time limit", "%", "lower", outcomes=(str(Outcome.FROZEN),)),
    Metric("RC", "route completion", "%", "higher", "route_completion", scale=100.0),
    Metric("AES", "average speed of the ego", "m/s", "higher", "mean_speed_mps"),
    Metric("AER", "sum of the rewards of an episode", "", "higher", "episode_reward"),
    Metric("VR", "collided, left the road or drove on its wrong side", "%", "lower", outcomes=VIOLATIONS),
    Metric("min_DTC", "smallest gap to anything", "m", "higher", "min_dtc_m", decimals=2),
)
"""the paper's, in its order"""
DECISION_MS = Metric("decision", "mean time for a decision", "ms", "lower", "decision_ms_mean", decimals=2)
RATES: Mapping[str, tuple[str, ...]] = {metric.name: metric.outcomes for metric in METRICS if metric.outcomes}
"""SR, FR, VR -> the outcomes that they are the rates of"""


def happened(rate: str, outcome: str) -> bool:
    """Whether an episode with this outcome counts in a rate (SR, FR or VR)."""
    return outcome in RATES[rate]


def rates_of(counts: Mapping[str, int]) -> dict[str, float]:
    """SR, FR and VR of episodes, so many with each outcome, in percent; nan without any."""
    n = sum(counts.values())
    return {
        name: 100.0 * sum(counts.get(end, 0) for end in ends) / n if n else math.nan
        for name, ends in RATES.items()
    }


def metric_of(name: str) -> Metric | None:
    """One of the metrics by its name, or the mean of a column that has one; None if there is neither."""
    known = {metric.name.lower(): metric for metric in (*METRICS, DECISION_MS)}
    if name.lower().replace("-", "_") in known:
        return known[name.lower().replace("-", "_")]
    column = COLUMNS.get(name)
    if column is None or column.average is None:
        return None
    is_share = column.average == "share"
    return Metric(
        name,
        column.text,
        "%" if is_share else column.unit,
        column.better,
        name,
        column.average,
        scale=100.0 if is_share else 1.0,
        decimals=2,
    )


def metric_names() -> list[str]:
    """All names that `metric_of` knows."""
    return [*(m.name for m in (*METRICS, DECISION_MS)), *(c.name for c in _TABLE if c.average)]


def read_off(driven: Driven) -> dict[str, Cell]:
    """All columns of an episode that was driven."""
    return {name: column.value(driven) for name, column in COLUMNS.items()}


def missing_columns(header: Iterable[str]) -> list[str]:
    """Columns that a file with this header lacks."""
    there = set(header)
    return [name for name in COLUMNS if name not in there]
