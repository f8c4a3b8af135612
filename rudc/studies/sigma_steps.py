"""What the sigma study keeps of every decision (rudc/studies/step_files.py): a table of columns.

A new column is one entry of `COLUMNS`: its name, its text, and how it is read off a decision.

The cause of a violation counts as one that could be seen if the car is an ordinary one (grip, delay) and, in
a collision, the ego's sensors showed whom it hit in at least half of the last HORIZON decisions.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from rudc.agents.base import Agent, Decision
from rudc.agents.conduct import Conduct
from rudc.arrays import Array, Flags
from rudc.env.episode import Episode, StepResult
from rudc.safety.plant import PlantEstimate
from rudc.vehicle import Actuation
from rudc.world.scene import Scene

HORIZON = 20
"""decisions, 2 s"""
NEAR_M = 40.0
"""m within which an event is near"""


class Seen(NamedTuple):
    """A decision, and the world it was taken in."""

    scene: Scene
    """as the ego's sensors showed it"""
    decision: Decision
    begun: bool
    """whether an event has begun and, if it has a body, was shown by the sensors"""
    bodies: frozenset[str]
    """names of whom those events put on the road or have taken hold of"""
    estimate: PlantEstimate | None
    """what the agent knows of the car; None if its outlook does not estimate that"""
    unusual: Flags
    """(N,) which of the others behave unlike ordinary traffic (rudc/agents/conduct.py)"""


@dataclass(frozen=True)
class StepColumn:
    """One number of each decision."""

    name: str
    text: str
    read: Callable[[Seen], float]


def _stated(kind: str, part: str) -> Callable[[Seen], float]:
    def read(seen: Seen) -> float:
        stated = seen.decision.uncertainty if kind == "paper" else seen.decision.by_route
        return math.nan if stated is None else float(getattr(stated, part))

    return read


def _exposed(seen: Seen) -> float:
    bodies = np.array([name in seen.bodies for name in seen.scene.ids], dtype=np.bool_)
    return float(seen.begun and bool((bodies & _ahead(seen.scene)).any()))


def _unusual(seen: Seen) -> float:
    return float(np.count_nonzero(seen.unusual & _ahead(seen.scene)))


def _ahead(scene: Scene) -> Flags:
    """(N,) who is ahead of the ego and near."""
    ego, offset = scene.ego, scene.position - scene.ego_position
    return (offset @ (math.cos(ego.psi), math.sin(ego.psi)) > 0.0) & (np.hypot(*offset.T) <= NEAR_M)


def mismatch(estimate: PlantEstimate | None) -> float:
    """How far the car that was identified is from an ordinary one: grip that it lacks (1 - mu), plus dead
    time and lag in s; 0 of an ordinary car.
    """
    if estimate is None or not estimate.unusual:
        return 0.0
    car = estimate.actuation
    lacking = 0.0 if car.friction is None else max(1.0 - car.friction, 0.0)
    return lacking + car.delay_s + car.lag_s


def _relaxed(seen: Seen) -> float:
    done = seen.decision.corrected
    return math.nan if done is None else float(done.slack)


COLUMNS = (
    StepColumn("time_s", "s since the episode began", lambda seen: seen.scene.time_s),
    StepColumn("epistemic", "sigma_epi, reward units", _stated("paper", "epistemic")),
    StepColumn("aleatoric", "sigma_ale", _stated("paper", "aleatoric")),
    StepColumn("total", "sigma_total", _stated("paper", "total")),
    StepColumn("route_epistemic", "sigma_epi by route", _stated("route", "epistemic")),
    StepColumn("route_aleatoric", "sigma_ale by route", _stated("route", "aleatoric")),
    StepColumn("route", "sigma_total by route", _stated("route", "total")),
    StepColumn(
        "mismatch", "how far the identified car is from an ordinary one", lambda s: mismatch(s.estimate)
    ),
    StepColumn(
        "unusual", f"how many who behave unlike ordinary traffic are ahead within {NEAR_M:g} m", _unusual
    ),
    StepColumn("slack", "delta of the filter; nan without one", _relaxed),
    StepColumn("disturbed", "1 once an event has begun and was shown", lambda seen: float(seen.begun)),
    StepColumn("exposed", f"1 while one is shown ahead within {NEAR_M:g} m", _exposed),
    StepColumn("seen", "1 in an episode whose violation has a cause that could be seen", lambda _: math.nan),
)
"""`seen` is known at the end of the episode only: nan without a violation"""
AT = {column.name: k for k, column in enumerate(COLUMNS)}
"""name of a column -> where it stands"""


class SigmaLog:
    """Keeps one episode."""

    columns = tuple(AT)

    def __init__(self, episode: Episode, agent: Agent) -> None:
        self._episode = episode
        self._conduct = Conduct()
        self._adaptation = getattr(getattr(agent, "outlook", None), "adaptation", None)
        self._rows: list[list[float]] = []
        self._shown: list[frozenset[str]] = []
        self._last: StepResult | None = None

    def watch(self, scene: Scene, decision: Decision, result: StepResult) -> None:
        """Keep a decision."""
        now = [
            event
            for event in self._episode.world.happenings()
            if event.visible_s is not None and event.visible_s <= scene.time_s
        ]
        bodies = frozenset[str]().union(*(event.bodies for event in now))
        estimate = None if self._adaptation is None else self._adaptation.estimate
        seen = Seen(scene, decision, bool(now), bodies, estimate, self._conduct.look(scene))
        self._rows.append([column.read(seen) for column in COLUMNS])
        self._shown.append(frozenset(scene.ids))
        self._last = result

    def steps(self) -> Array:
        """(steps, columns) of the episode."""
        found = np.array(self._rows).reshape(len(self._rows), len(COLUMNS))
        last = self._last
        if last is not None and last.outcome is not None and last.outcome.is_violation:
            found[:, AT["seen"]] = float(self._could_be_seen(last))
        return found

    def _could_be_seen(self, last: StepResult) -> bool:
        if (self._episode.truth.actuation or Actuation()) != Actuation():
            return False
        hit = last.advance.collision
        shown = self._shown[-HORIZON:]
        return hit is None or 2 * sum(hit.other in names for names in shown) >= len(shown)
