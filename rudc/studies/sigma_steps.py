"""What the sigma study keeps of every decision: a table of columns, and the runner that fills it.

A new column is one entry of `COLUMNS`: its name, its text, and how it is read off a decision. Each episode is
an array (steps, columns) in a file of its own, written before its row of `episodes.csv`.

An episode that ends in a violation has a cause that could be seen if the car is an ordinary one (grip, delay)
and, in a collision, the ego's sensors showed whom it hit in at least half of the last HORIZON decisions.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from rudc.agents.base import Agent, Decision
from rudc.agents.registry import make_agent
from rudc.arrays import Array
from rudc.env.episode import Episode, StepResult
from rudc.errors import InputError, StorageError
from rudc.evaluation.record import EpisodeRecord
from rudc.evaluation.runner import EpisodeRunner
from rudc.evaluation.tasks import Task
from rudc.files import make_folder, replacing
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
    """what the agent knows of the car; None without an outlook on it"""


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
    scene, ego = seen.scene, seen.scene.ego
    rows = [i for i, name in enumerate(scene.ids) if name in seen.bodies]
    offset = scene.position[rows] - (ego.x, ego.y)
    ahead = offset @ (math.cos(ego.psi), math.sin(ego.psi)) > 0.0
    return float(seen.begun and bool((ahead & (np.hypot(*offset.T) <= NEAR_M)).any()))


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
    StepColumn("slack", "delta of the filter; nan without one", _relaxed),
    StepColumn("disturbed", "1 once an event has begun and was shown", lambda seen: float(seen.begun)),
    StepColumn("exposed", f"1 while one is shown ahead within {NEAR_M:g} m", _exposed),
    StepColumn("seen", "1 in an episode whose violation has a cause that could be seen", lambda _: math.nan),
)
"""`seen` is known at the end of the episode only: nan without a violation"""
AT = {column.name: k for k, column in enumerate(COLUMNS)}
"""name of a column -> where it stands"""


class StepLog:
    """Keeps one episode; `watch` is for `run_episode`."""

    def __init__(self, episode: Episode, agent: Agent) -> None:
        self._episode = episode
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
        seen = Seen(scene, decision, bool(now), bodies, estimate)
        self._rows.append([column.read(seen) for column in COLUMNS])
        self._shown.append(frozenset(scene.ids))
        self._last = result

    def steps(self) -> Array:
        """(steps, columns) of the episode."""
        found = np.array(self._rows).reshape(len(self._rows), len(COLUMNS))
        if self._last is not None and self._last.violation is not None:
            found[:, AT["seen"]] = float(self._could_be_seen(self._last))
        return found

    def _could_be_seen(self, last: StepResult) -> bool:
        if (self._episode.truth.actuation or Actuation()) != Actuation():
            return False
        hit = last.advance.collision
        shown = self._shown[-HORIZON:]
        return hit is None or 2 * sum(hit.other in names for names in shown) >= len(shown)


class StepRunner:
    """Runs episodes and writes the steps of each into a folder, before its row is written."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._log: StepLog | None = None
        self._run = EpisodeRunner(make_agent, watch=self._begin)

    def _begin(self, episode: Episode, agent: Agent) -> Callable[[Scene, Decision, StepResult], None]:
        self._log = StepLog(episode, agent)
        return self._log.watch

    def __call__(self, task: Task) -> EpisodeRecord:
        """Run the task's episode."""
        record = self._run(task)
        if record.error or self._log is None:
            return record
        path = steps_file(self._folder, task.agent, task.scenario.name, task.seed)
        try:
            make_folder(path.parent)
            with replacing(path) as file:
                np.save(file, self._log.steps().astype(np.float32))
        except (InputError, StorageError) as error:
            return EpisodeRecord.failed(record.scenario, record.agent, record.seed, str(error))
        return record

    def close(self) -> None:
        """Forget everything; the next task starts afresh."""
        self._run.close()


def steps_file(folder: Path, agent: str, scenario: str, seed: int) -> Path:
    """Where an episode's steps are."""
    return folder / re.sub(r"[^\w.+=,-]", "_", agent) / scenario / f"{seed}.npy"
