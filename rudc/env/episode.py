"""`Episode`: one drive through the junction, decision by decision: reward, cost, outcome, metrics.

rudc/env/outcome.py lists the outcomes. The Gymnasium environment and evaluation both use this class, so that
reward, outcome and metrics mean the same in both.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

from rudc.arrays import Array
from rudc.env.distances import Distances, measure
from rudc.env.outcome import Outcome
from rudc.env.reward import reward_terms, step_cost
from rudc.errors import SimulationError
from rudc.world.config import EgoDriver
from rudc.world.ego import refuse_no_action
from rudc.world.scene import Scene

if TYPE_CHECKING:
    from rudc.scenario.plan import EpisodePlan
    from rudc.world.isolated import AnyWorld
    from rudc.world.world import Advance

COLLISION, SUCCESS, BROKE_RULE = Outcome.COLLISION, Outcome.SUCCESS, (Outcome.OFF_ROAD, Outcome.WRONG_WAY)
"""kept here, since looking up a member of an enumeration takes a microsecond"""
BESIDE_M = 6.0
"""m from the path up to which the destination counts as reached: in the lane beside it too, but not on
another arm"""


class StepResult(NamedTuple):
    """What one decision led to."""

    scene: Scene
    """what the ego's sensors show now"""
    terms: dict[str, float]
    """the reward's terms, see rudc/env/reward.py"""
    reward: float
    """their sum"""
    cost: float
    """the unified step-wise cost"""
    outcome: Outcome | None
    """how the episode ended; None while it goes on"""
    advance: Advance
    """what the world reports about the decision"""
    distances: Distances
    """distances in the world as it is now"""


@dataclass(frozen=True, slots=True)
class EpisodeMetrics:
    """Metrics of an episode so far, or of the whole episode once it has an outcome."""

    outcome: str
    """see `Outcome`; empty while the episode goes on"""
    violation: str
    """the outcome if it is a violation, else empty"""
    fault: str
    """whose fault a collision was: `ego`, `other` or `shared`; empty without a collision"""
    hit: str
    """what the ego collided with (`car`, `pedestrian`, ...); empty without a collision"""
    steps: int
    """decisions taken"""
    duration_s: float
    """s of simulated time"""
    route_completion: float
    """share of the way along the reference path from start to destination, 0 to 1"""
    mean_speed_mps: float
    """m/s, mean of the ego's speed after each decision"""
    episode_reward: float
    """sum of the rewards"""
    episode_cost: float
    """sum of the costs"""
    min_dtc_m: float
    """m, smallest gap between the ego and anything so far; inf while there was nothing"""
    sv_collisions: int
    """pairs of surrounding vehicles that came to overlap"""
    density: float
    """veh/km on the road, mean over the decisions; nan before the first"""
    redraws: int
    """how often the episode was drawn again because the ego could not start safely"""
    events_fired: int | None = None
    """how many of the scripted events have happened so far; None if none are scripted"""
    first_event_s: float = math.nan
    """s, when the first of them began; nan if none did"""
    first_event_visible_s: float = math.nan
    """s, when the ego's sensors first showed one of them; nan if they never did"""


class Episode:
    """Runs one episode after another in a world. It does not close the world: whoever made that must."""

    def __init__(self, world: AnyWorld) -> None:
        self.world = world
        self._truth: Scene | None = None
        self._outcome: Outcome | None = None
        self._cut_off = False

    def reset(
        self,
        plan: EpisodePlan,
        *,
        ego_driver: EgoDriver = "agent",
        options: tuple[str, ...] = (),
    ) -> Scene:
        """Begin an episode; returns what the ego's sensors show. Arguments and errors are those of
        `World.reset`; after an error there is no episode.
        """
        self._truth = self._outcome = None
        self._cut_off = False
        self._begin(self.world.reset(plan, ego_driver=ego_driver, options=options))
        return self.world.perceived()

    @property
    def truth(self) -> Scene:
        """The world as it is, without the sensors' flaws. Raises SimulationError before the first `reset`,
        and once a decision was cut off.
        """
        if self._cut_off:
            raise SimulationError(
                "the episode was cut off in the middle of a decision; call reset() to begin another"
            )
        if self._truth is None:
            raise SimulationError("there is no episode yet; call reset(plan) first")
        return self._truth

    @property
    def distances(self) -> Distances:
        """Distances in the world as it is. Raises SimulationError where there is no episode, as `truth`."""
        _ = self.truth
        return self._distances

    @property
    def outcome(self) -> Outcome | None:
        """How the episode ended; None while it goes on."""
        return self._outcome

    def step(self, u: Array) -> StepResult:
        """Apply u = (acceleration m/s2, front-wheel angle rad) for one decision. Raises SimulationError if no
        episode has begun, or if it is over or was cut off, and InputError for what is no action.
        """
        before = self.truth
        if self._outcome is not None:
            raise SimulationError(f"the episode is over ({self._outcome}); call reset() to begin another")
        refuse_no_action(u)
        self._cut_off = True  # whatever ends it from here on (Ctrl-C) leaves the world in mid-decision
        advance = self.world.advance(u)
        after = self.world.scene()
        distances = measure(after, advance.gap_m)
        outcome = _judge(after, advance)
        collided = outcome is COLLISION
        broke_rule = outcome in BROKE_RULE
        terms = reward_terms(
            before, after, distances,
            collided=collided, broke_rule=broke_rule, arrived=outcome is SUCCESS,
        )  # fmt: skip
        reward = sum(terms.values())
        cost = step_cost(distances, collided=collided, broke_rule=broke_rule)
        self._truth, self._distances, self._outcome = after, distances, outcome
        self._count(after, advance, reward, cost)
        perceived = self.world.perceived()
        self._cut_off = False
        return StepResult(perceived, terms, reward, cost, outcome, advance, distances)

    def metrics(self) -> EpisodeMetrics:
        """The episode's metrics up to now."""
        truth, outcome, steps = self.truth, self._outcome, self._steps
        violated = outcome is not None and outcome.is_violation
        hit = self._last.collision if self._last else None
        whole = max(truth.goal_s - self._start_s, 1e-9)
        done = 1.0 if outcome is Outcome.SUCCESS else (self._farthest_s - self._start_s) / whole
        happenings = self.world.happenings()
        begun = [event.begun_s for event in happenings if event.begun_s is not None]
        seen = [event.visible_s for event in happenings if event.visible_s is not None]
        return EpisodeMetrics(
            outcome=str(outcome) if outcome else "",
            violation=str(outcome) if outcome and violated else "",
            fault=hit.fault if hit else "",
            hit=hit.kind.name.lower() if hit else "",
            steps=steps,
            duration_s=truth.time_s,
            route_completion=min(max(done, 0.0), 1.0),
            mean_speed_mps=self._speeds / steps if steps else truth.ego.v,
            episode_reward=self._reward,
            episode_cost=self._cost,
            min_dtc_m=self._min_dtc,
            sv_collisions=self._sv_collisions,
            density=self._densities / steps if steps else math.nan,
            redraws=self.world.plan.attempt,
            events_fired=len(begun) if self.world.plan.scripted else None,
            first_event_s=min(begun, default=math.nan),
            first_event_visible_s=min(seen, default=math.nan),
        )

    def _begin(self, scene: Scene) -> None:
        self._truth = scene
        self._distances = measure(scene)
        self._outcome = None
        self._last: Advance | None = None
        self._start_s = self._farthest_s = scene.ego_s
        self._min_dtc = self._distances.vehicle_m
        self._steps = self._sv_collisions = 0
        self._speeds = self._reward = self._cost = self._densities = 0.0

    def _count(self, scene: Scene, advance: Advance, reward: float, cost: float) -> None:
        self._last = advance
        self._steps += 1
        self._speeds += scene.ego.v
        self._reward += reward
        self._cost += cost
        self._densities += advance.density
        self._sv_collisions += advance.sv_collisions
        self._min_dtc = min(self._min_dtc, advance.min_dtc_m, self._distances.vehicle_m)
        if abs(scene.ego_offset) <= BESIDE_M:
            self._farthest_s = max(self._farthest_s, scene.ego_s)


def _judge(scene: Scene, advance: Advance) -> Outcome | None:
    if advance.collision is not None:
        return Outcome.COLLISION
    if advance.off_road:
        return Outcome.OFF_ROAD
    if advance.wrong_way:
        return Outcome.WRONG_WAY
    if scene.ego_s >= scene.goal_s and abs(scene.ego_offset) <= BESIDE_M:
        return Outcome.SUCCESS
    if scene.time_s >= scene.timeout_s - 1e-6:
        return Outcome.FROZEN
    return None
