"""One episode in full, for figures: the ego decision by decision, everybody else's way, and how it came out.

Which episode is shown is decided by a rule, never by hand. Of the seeds that were driven, it is the one in
which

    the first agent succeeds           before those in which it does not
    the most others do not             then
    their outcomes are most different  then
    the seed is lowest                 then

`h` is the least value of the paper's barrier towards all vehicles (m2), whatever the agent's own filter looks
at: ellipses, d_safe 0.5 m, no gate. The correction is the size of what the agent's own correction (such as
the filter) changed, both numbers scaled to [-1, 1]; what was applied differs from what was proposed by that
and by what course and grip allow (rudc/agents/outlook.py).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from rudc.agents.base import Agent, Decision
from rudc.agents.registry import make_agent
from rudc.arrays import Array
from rudc.env.episode import Episode, StepResult
from rudc.env.outcome import Outcome
from rudc.evaluation.record import EpisodeRecord
from rudc.evaluation.rollout import run_episode
from rudc.network.network import load_network
from rudc.reporting.case import Case, Track
from rudc.safety.config import FilterConfig
from rudc.safety.constraints import ConstraintBuilder
from rudc.scenario.model import Scenario
from rudc.studies.latency import CBF, PLACES, REST
from rudc.studies.stopwatch import Stopwatch, timing
from rudc.world.scene import Scene
from rudc.world.world import World

Row = Mapping[str, str]


@dataclass(frozen=True)
class Driver:
    """Who is shown, and what figures and tables call it."""

    label: str
    agent: str
    """what `--agent` takes"""


def drivers(named: Sequence[str], usual: Sequence[Driver]) -> tuple[Driver, ...]:
    """Those named, under their own names, or the usual ones. Raises AgentError where there is no such."""
    chosen = tuple(Driver(name, name) for name in dict.fromkeys(named)) or tuple(usual)
    for driver in chosen:
        make_agent(driver.agent)
    return chosen


def chosen_seed(rows: Sequence[Row], agents: Sequence[str]) -> int | None:
    """The seed that the rule takes, of one scenario's rows; None where no seed was driven by all."""
    outcomes: dict[int, dict[str, str]] = {}
    for row in rows:
        if not row["error"]:
            outcomes.setdefault(int(row["seed"]), {})[row["agent"]] = row["outcome"]

    def rank(seed: int) -> tuple[bool, int, int, int]:
        ends = [outcomes[seed][agent] for agent in agents]
        others = sum(end != Outcome.SUCCESS for end in ends[1:])
        return ends[0] == Outcome.SUCCESS, others, len(set(ends)), -seed

    whole = [seed for seed, ends in outcomes.items() if all(agent in ends for agent in agents)]
    return max(whole, key=rank, default=None)


def scaled_correction(decision: Decision, scene: Scene) -> float:
    """Size of what the correction itself did, both numbers scaled to [-1, 1]; 0 without one. Changes for
    course and grip are left out, which the column `mean_correction` counts, too.
    """
    return 0.0 if decision.corrected is None else scene.vehicle.scaled(*decision.corrected.correction)


def drive(scenario: Scenario, driver: Driver, seed: int) -> Case:
    """Drive an episode and keep all of it. It is driven twice: the first time warms up, and nothing of it is
    kept.
    """
    agent, plan = make_agent(driver.agent), scenario.plan(seed)
    with World(load_network(scenario.network, scenario.junction)) as world:
        episode = Episode(world)
        run_episode(episode, plan, agent)
        keeper = _Keeper(agent)
        with timing(keeper.stopwatch, PLACES):
            record = run_episode(episode, plan, agent, watch=keeper.watch)
        bodies = frozenset[str]().union(*(event.bodies for event in world.happenings()))
        return keeper.case(driver.label, record, episode, bodies)


MS = ("HOCBF", "critics", "policy", REST)
"""parts of a decision that are told apart"""
COLUMNS = (
    "time_s", "x_m", "y_m", "heading_rad", "speed_mps", "route_s_m", "h_m2", "proposed_acceleration_mps2",
    "acceleration_mps2", "proposed_steering_rad", "steering_rad", "correction", "sigma_total", "sigma_epi",
    "sigma_ale", *(f"{part}_ms" for part in MS),
)  # fmt: skip
"""of each decision; times are the processor's"""


class _Keeper:
    """Keeps one episode; `watch` is for `run_episode`."""

    def __init__(self, agent: Agent) -> None:
        self.stopwatch = Stopwatch()
        own = type(agent).act.__get__(agent)
        setattr(agent, "act", self.stopwatch.timed(REST, own))  # noqa: B010 -- to a checker, `act` is a method
        self._barrier = ConstraintBuilder(FilterConfig.preset("ttcbf", constrained="all", road=False))
        self._steps: list[list[float]] = []
        self._others: dict[str, list[list[float]]] = {}
        self._sizes: dict[str, Array] = {}

    def watch(self, scene: Scene, decision: Decision, result: StepResult) -> None:
        """Keep a decision; what keeping it takes is no time of the next."""
        spent, ego, unsure = self.stopwatch.take(), scene.ego, decision.uncertainty
        sigma = [math.nan] * 3 if unsure is None else [unsure.total, unsure.epistemic, unsure.aleatoric]
        cbf = sum(spent.get(part, 0.0) for part in CBF)
        named = [spent.get(part, 0.0) for part in ("critics", "policy")]
        self._steps.append(
            [
                scene.time_s, ego.x, ego.y, ego.psi, ego.v, scene.ego_s, self._h(scene),
                decision.u_rl[0], decision.u[0], decision.u_rl[1], decision.u[1],
                scaled_correction(decision, scene), *map(float, sigma),
                cbf, *named, sum(spent.values()) - cbf - sum(named),
            ]
        )  # fmt: skip
        self._look(scene)
        self.stopwatch.take()

    def _h(self, scene: Scene) -> float:
        return float(self._barrier.build(scene).terms(scene).h.min(initial=math.inf))

    def _look(self, scene: Scene) -> None:
        for i, name in enumerate(scene.ids):
            (x, y), psi = scene.position[i], float(scene.heading[i])
            s, offset = scene.route.path.project(x, y)
            self._others.setdefault(name, []).append([scene.time_s, float(x), float(y), psi, s, offset])
            self._sizes[name] = scene.size[i]

    def case(self, label: str, record: EpisodeRecord, episode: Episode, bodies: frozenset[str]) -> Case:
        """Everything. `bodies`: names of those whom events put on the road or take hold of."""
        truth = episode.truth
        table = np.array(self._steps).reshape(-1, len(COLUMNS))
        tracks = tuple(
            Track(name, name in bodies, self._sizes[name], np.array(rows))
            for name, rows in self._others.items()
        )
        ego = {name: table[:, k] for k, name in enumerate(COLUMNS)}
        return Case(
            label,
            record.text("outcome"),
            record.number("duration_s"),
            ego,
            min(float(ego["h_m2"].min(initial=math.inf)), self._h(truth)),
            tracks,
            np.array([truth.vehicle.length, truth.vehicle.width]),
            tuple(polygon - truth.network.center for polygon in truth.network.surface.polygons),
            truth.network.center,
            truth.route.path.xy - truth.network.center,
        )


def case_lines(case: Case) -> list[dict[str, Any]]:
    """Lines of a CSV: the ego, decision by decision."""
    columns = [case.ego[name] for name in COLUMNS]
    return [
        {"agent": case.label, **dict(zip(COLUMNS, map(float, values), strict=True))}
        for values in zip(*columns, strict=True)
    ]


def seeds_note(rows: Sequence[Row], seed: int, shown: Sequence[Driver]) -> str:
    """In a sentence, which seed is shown, of which."""
    seeds = sorted({int(row["seed"]) for row in rows})
    return (
        f"Shown is seed {seed}, of {seeds[0]} to {seeds[-1]}: of those that {shown[0].label} succeeds in (of "
        "all, if there is none) the one in which most others do not, then with the most different outcomes, "
        "then the lowest."
    )
