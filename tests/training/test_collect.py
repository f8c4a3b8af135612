"""One world's transitions: how they hang together, what a collision costs, where a round is broken off."""

import itertools
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from rudc.env.episode import Episode, StepResult
from rudc.env.reward import COLLISION, scene_cost
from rudc.errors import SimulationError
from rudc.learning.nstep import NStep
from rudc.learning.parameters import policy_arrays
from rudc.scenario import load_scenario
from rudc.scenario.plan import EpisodePlan
from rudc.training.collect import Collector
from rudc.training.config import TrainConfig
from rudc.world.scene import Scene

CONFIG = TrainConfig.of("rudc-wo-cbf", {"learner.n_step": 1})


@pytest.fixture(scope="module")
def collector() -> Iterator[Collector]:
    collector = Collector(CONFIG, 0)
    yield collector
    collector.close()


def _ends(collected) -> list[int]:
    """Lengths of the finished episodes, and where they end among the decisions."""
    return np.cumsum([episode.steps for episode in collected.finished]).tolist()


def test_decisions_of_an_episode_follow_one_another(collector: Collector):
    new, finished, *_ = collector.collect(0, 400, "reference", drop=True)
    assert len(new) == 400
    assert finished
    ends = set(_ends(collector.collect(0, 400, "reference", drop=True)))
    assert ends == set(np.cumsum([episode.steps for episode in finished]).tolist())
    for k, (before, after) in enumerate(itertools.pairwise(new), 1):
        assert np.array_equal(before.next_observation, after.observation) == (k not in ends)
        assert before.terminal == (k in ends and finished[sorted(ends).index(k)].outcome != "frozen")


def test_the_reference_driver_steers_along_the_path_but_for_noise(collector: Collector):
    new, *_ = collector.collect(1, 200, "reference", drop=True)
    steering = np.array([transition.executed[1] for transition in new])
    assert abs(steering.mean()) < 0.03
    assert steering.std() == pytest.approx(CONFIG.training.seed_noise, rel=0.25)


def test_a_round_can_be_taken_again(collector: Collector):
    first, again = (collector.collect(2, 60, "policy", drop=True) for _ in range(2))
    for one, other in zip(first.transitions, again.transitions, strict=True):
        for a, b in zip(one, other, strict=True):
            np.testing.assert_array_equal(a, b)


def test_the_cost_before_the_first_decision_is_that_of_the_world_as_it_is(
    collector: Collector, monkeypatch: pytest.MonkeyPatch
):
    """In fog the sensors show others elsewhere, in this episode one that is near."""
    costs = []

    class Watched(Episode):
        def reset(self, plan: EpisodePlan, **more: Any) -> Scene:
            perceived = super().reset(load_scenario("fog").plan(1), **more)
            costs.append((scene_cost(self.truth), scene_cost(perceived)))
            return perceived

    monkeypatch.setattr("rudc.training.collect.Episode", Watched)
    (first,) = collector.collect(8, 1, "reference", drop=True).transitions
    ((true, shown),) = costs
    assert abs(true - shown) > 0.01
    assert first.cost - first.cost_change == pytest.approx(true)


def test_an_episode_that_cannot_be_set_up_is_left_out(collector: Collector, monkeypatch: pytest.MonkeyPatch):
    refused, enough = [], 1

    class Refusing(Episode):
        def reset(self, plan: EpisodePlan, **more: Any) -> Scene:
            if len(refused) < enough:
                refused.append(plan.seed)
                raise SimulationError("no safe start")
            return super().reset(plan, **more)

    monkeypatch.setattr("rudc.training.collect.Episode", Refusing)
    new, _, drawn, left_out = collector.collect(4, 20, "reference", drop=True)
    assert (len(new), drawn, left_out) == (20, 2, 1)
    assert len(refused) == 1
    assert collector.collect(4, 1, "reference", drop=True)[2:] == (1, 0)
    refused.clear()
    first, second = collector.evaluate((("random_destination", 900_000), ("random_destination", 900_001)))
    assert (first, refused) == (None, [900_000])
    assert second is not None
    assert second.number("seed") == 900_001
    enough = 1000
    with pytest.raises(
        SimulationError, match=r"20 episodes in a row cannot be set up or driven to .*: no safe start"
    ):
        collector.collect(5, 20, "reference", drop=True)


def test_an_episode_that_fails_later_is_broken_off(collector: Collector, monkeypatch: pytest.MonkeyPatch):
    steps, failing = [], {30}

    class Failing(Episode):
        def step(self, u: Any) -> StepResult:
            steps.append(self)
            if len(steps) in failing:
                raise SimulationError("two in one place")
            return super().step(u)

    monkeypatch.setattr("rudc.training.collect.Episode", Failing)
    monkeypatch.setattr(collector, "_failed", 0)
    monkeypatch.setattr(collector, "_steps", NStep(3, 0.99))
    new, _, drawn, left_out = collector.collect(6, 40, "reference", drop=True)
    assert len(new) == 40 - 3  # the one that failed, and two before it that waited for its reward
    assert steps[29] is not steps[30]
    assert (drawn, left_out) == (2, 1)
    assert [k for k, (a, b) in enumerate(itertools.pairwise(steps)) if a is not b] == [29]
    failing.update(range(1, 1000))
    with pytest.raises(
        SimulationError, match=r"20 episodes in a row .* driven to their end: two in one place"
    ):
        collector.collect(7, 40, "reference", drop=True)
    assert len(steps) == 40 + 20  # the one in round 6 does not count: nor would it after resuming there


def test_collisions_cost_what_training_says(collector: Collector):
    arrays = policy_arrays(CONFIG.learner, CONFIG.given)
    arrays["out.bias"][..., 0] = 5.0  # full acceleration, whatever is ahead
    collector.load({f"policy/{name}": value for name, value in arrays.items()}, None)
    new, finished, *_ = collector.collect(3, 1000, "policy", drop=True)
    ends = np.cumsum([episode.steps for episode in finished]).tolist()
    losses = [
        new[end - 1].reward
        for end, episode in zip(ends, finished, strict=True)
        if episode.outcome == "collision"
    ]
    assert losses
    costs = [new[end - 1].cost for end, e in zip(ends, finished, strict=True) if e.outcome == "collision"]
    assert all(5.0 <= cost <= 6.0 for cost in costs)  # w_c, and up to w_d for the distances
    starts = [0, *ends[:-1]]
    for start, end, episode in zip(starts, ends, finished, strict=True):
        assert sum(t.cost for t in new[start:end]) == pytest.approx(episode.cost)
    assert all(CONFIG.training.collision_reward - 2 < loss < COLLISION - 10 for loss in losses)
