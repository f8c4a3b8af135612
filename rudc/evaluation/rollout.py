"""Rolls out one episode with an agent at the wheel, and keeps what a row of `episodes.csv` says."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from rudc.evaluation.record import Conditions, EpisodeRecord
from rudc.vehicle import EgoVehicle
from rudc.world.scene import Scene

if TYPE_CHECKING:
    from rudc.agents.base import Agent, Decision
    from rudc.env.episode import Episode, StepResult
    from rudc.scenario.plan import EpisodePlan

Watcher = Callable[[Scene, "Decision", "StepResult"], None]
"""Is shown each decision: the scene it was taken in, the decision, and what came of it."""


def run_episode(
    episode: Episode,
    plan: EpisodePlan,
    agent: Agent,
    *,
    options: tuple[str, ...] = (),
    watch: Watcher | None = None,
) -> EpisodeRecord:
    """Drive the plan's episode to its end. `options` go to SUMO's command line. Errors: those of
    `World.reset`.
    """
    scene = episode.reset(plan, ego_driver=agent.ego_driver, options=options)
    agent.reset(scene, plan.seed)
    tally = _Tally(scene.vehicle)
    while episode.outcome is None:
        start = time.perf_counter()
        decision = agent.act(scene)
        tally.count(decision, 1000.0 * (time.perf_counter() - start))
        result = episode.step(decision.u)
        if watch is not None:
            watch(scene, decision, result)
        scene = result.scene
    return tally.record(episode, plan, agent)


class _Tally:
    """Adds up what the decisions of one episode say about themselves."""

    def __init__(self, vehicle: EgoVehicle) -> None:
        self._half_range = np.array([0.5 * (vehicle.a_max - vehicle.a_min), vehicle.delta_max])
        self._times: list[float] = []
        self._sigmas: list[float] = []
        self._corrections = 0.0
        self._interventions = 0
        self._infeasible = 0

    def count(self, decision: Decision, spent_ms: float) -> None:
        self._times.append(spent_ms)
        if not math.isnan(decision.sigma):
            self._sigmas.append(decision.sigma)
        corrected = decision.corrected
        if corrected is not None:
            self._corrections += float(np.hypot(*((decision.u - decision.u_rl) / self._half_range)))
            self._interventions += corrected.status != "nominal"
            self._infeasible += corrected.infeasible

    def record(self, episode: Episode, plan: EpisodePlan, agent: Agent) -> EpisodeRecord:
        metrics, route = episode.metrics(), episode.truth.route
        steps = max(metrics.steps, 1)
        return EpisodeRecord(
            scenario=plan.scenario,
            agent=agent.name,
            seed=plan.seed,
            outcome=metrics.outcome,
            violation=metrics.violation,
            steps=metrics.steps,
            duration_s=_rounded(metrics.duration_s),
            route_completion=_rounded(metrics.route_completion),
            mean_speed_mps=_rounded(metrics.mean_speed_mps),
            episode_reward=_rounded(metrics.episode_reward),
            min_dtc_m=_rounded(metrics.min_dtc_m),
            interventions=self._interventions,
            mean_correction=_rounded(self._corrections / steps),
            infeasible_steps=self._infeasible,
            mean_sigma=_rounded(float(np.mean(self._sigmas))) if self._sigmas else math.nan,
            max_sigma=_rounded(max(self._sigmas)) if self._sigmas else math.nan,
            decision_ms_mean=round(sum(self._times) / steps, 4),
            decision_ms_max=round(max(self._times), 4),
            fault=metrics.fault,
            conditions=Conditions(
                origin=route.origin,
                destination=route.destination,
                turn=route.turn,
                priority="major" if route.major else "minor",
                redraws=metrics.redraws,
                density=_rounded(metrics.density),
                sv_collisions=metrics.sv_collisions,
            ),
        )


def _rounded(value: float) -> float:
    """To six decimals, which no quantity here needs more than; nan for what is not finite."""
    return round(float(value), 6) if math.isfinite(value) else math.nan
