"""Corrections of proposed actions by what was learnt: gradients, loops that end, hand-over at a threshold."""

from collections.abc import Callable
from functools import cache

import numpy as np
import pytest
import torch
from pydantic import ValidationError

from rudc.agents.config import AgentConfig
from rudc.agents.correction import read_correction
from rudc.agents.filtered import FilteredAgent
from rudc.agents.follower import Follower
from rudc.agents.of_actions import QpslSettings, RecoverySettings, UslSettings
from rudc.agents.seat import Proposal
from rudc.arrays import Floats
from rudc.env.action import Adjustment, Direct
from rudc.env.reward import scene_cost
from rudc.errors import AgentError
from rudc.learning.algorithms import RecoveryConfig, UslConfig
from rudc.learning.batch import Batch
from rudc.learning.config import LearnerConfig, NetworkConfig, ObservationLayout, Problem
from rudc.learning.inference import Decider
from rudc.learning.recovery import RecoveryLearner
from rudc.learning.usl import UslLearner
from rudc.world.scene import Scene

NETWORK = NetworkConfig(encoder="mlp", hidden=32)
PROBLEM = Problem(ObservationLayout(ego=1, vehicles=0, waypoints=0, task=0), actions=2, updates=400)
SEEN = np.ones(1, np.float32)
SETTINGS = {
    "policy": NETWORK, "critic": NETWORK, "value_scale": 1.0, "cost_scale": 1.0, "critic_rate": (3e-3, 3e-4)
}  # fmt: skip


def costly(rng: np.random.Generator, count: int = 64) -> Batch:
    """One state, one step; it costs 1 + the first number of the action."""
    action = rng.uniform(-1, 1, size=(count, 2)).astype(np.float32)
    one = np.ones((count, 1), np.float32)
    return Batch(
        observation=one,
        executed=action,
        proposed=action,
        reward=np.zeros(count, np.float32),
        cost=1 + action[:, 0],
        discount=np.full(count, 0.9, np.float32),
        next_observation=one,
        terminal=np.ones(count, np.bool_),
        mask=np.zeros((count, 0), np.bool_),
    )


@cache
def trained(kind: type[UslLearner | RecoveryLearner]) -> Decider:
    """Who knows that cost."""
    made: dict[type, Callable[[], LearnerConfig]] = {
        UslLearner: lambda: UslConfig.model_validate(SETTINGS | {"cost_limit": 1.0}),
        RecoveryLearner: lambda: RecoveryConfig.model_validate(SETTINGS),
    }
    config = made[kind]()
    learner, rng = kind(config, PROBLEM), np.random.default_rng(0)  # pyright: ignore[reportArgumentType] -- its own
    torch.set_num_threads(1)
    for _ in range(PROBLEM.updates):
        learner.update(costly(rng))
    return Decider(config, PROBLEM.layout, learner.weights())


def proposal(scene: Scene, action: list[float], means: Direct | Adjustment) -> Proposal:
    numbers: Floats = np.array(action, np.float32)
    return Proposal(means.physical(numbers, scene), numbers, observation=SEEN)


@pytest.fixture
def scene(scene_on) -> Scene:
    return scene_on("south", "left", 50.0, 4.0)


@pytest.mark.parametrize("encoder", ["mlp", "attention"])
def test_the_gradient_of_the_cost_is_autograds(encoder: str):
    layout = ObservationLayout(conflict=4)
    network = NetworkConfig.model_validate({"encoder": encoder, "hidden": 24})
    config = UslConfig(policy=network, critic=network, cost_limit=0.3)
    learner = UslLearner(config, Problem(layout, actions=2, seed=3))
    decider, rng = Decider(config, layout, learner.weights()), np.random.default_rng(0)
    for _ in range(5):
        seen = rng.normal(size=layout.size).astype(np.float32)
        action = torch.tensor(rng.uniform(-1, 1, (1, 2)), dtype=torch.float32, requires_grad=True)
        cost = learner.costs.value(torch.from_numpy(seen)[None], action)
        (gradient,) = torch.autograd.grad(cost.sum(), action)
        excess, slope = decider.excess_at(seen)(action.detach().numpy()[0])
        assert excess == pytest.approx(float(cost.detach()) - 0.3, abs=1e-5)
        assert slope == pytest.approx(gradient.numpy()[0], abs=1e-5)
        assert decider.cost(seen, action.detach().numpy()[0]) == pytest.approx(excess + 0.3, abs=1e-6)


@pytest.mark.parametrize("means", [Direct(), Adjustment()])
def test_unrolled_corrections_end_where_the_limit_is_kept(scene: Scene, means: Direct | Adjustment):
    """The first number of the action may be 0 at most; each correction takes 0.05 off it."""
    decider = trained(UslLearner)
    excess = decider.excess_at(SEEN)
    correction = UslSettings().make({}, action=means)
    asked = proposal(scene, [0.8, 0.3], means)
    answer = correction.correct(scene, asked, decider)
    action = means.normalised(answer.u, scene).astype(np.float32)
    assert (answer.status, answer.infeasible) == ("unrolled", False)
    assert -0.08 < excess(action)[0] <= 1e-5
    assert action[0] == pytest.approx(0.0, abs=0.1)
    assert answer.correction == pytest.approx(answer.u - asked.u)
    few = UslSettings(steps=5).make({}, action=means).correct(scene, asked, decider)
    assert few.infeasible
    assert means.normalised(few.u, scene)[0] == pytest.approx(0.8 - 5 * 0.05, abs=1e-5)
    kept = correction.correct(scene, proposal(scene, [-0.5, 0.3], means), decider)
    assert (kept.status, kept.correction.tolist()) == ("nominal", [0.0, 0.0])


def test_recovery_takes_over_exactly_at_the_threshold(scene: Scene):
    decider, means = trained(RecoveryLearner), Adjustment()
    asked = proposal(scene, [0.4, -0.2], means)
    assert asked.action is not None
    risk = decider.cost(SEEN, asked.action)
    assert risk == pytest.approx(1.4, abs=0.1)
    at = RecoverySettings(cost_limit=risk).make({}, action=means).correct(scene, asked, decider)
    assert (at.status, at.u.tolist()) == ("nominal", asked.u.tolist())
    below = RecoverySettings(cost_limit=np.nextafter(risk, 0)).make({}, action=means)
    over = below.correct(scene, asked, decider)
    assert over.status == "recovery"
    other = np.tanh(decider.seen("recovery", SEEN)[:2])
    assert over.u == pytest.approx(means.physical(other, scene))
    assert other[0] < -0.8  # the least cost
    assert not over.infeasible
    assert RecoverySettings(cost_limit=0.0).make({}).correct(scene, asked, decider).infeasible


class Model:
    """g as it is known."""

    def __init__(self, g: Floats) -> None:
        self.g = g

    def seen(self, network: str, observation: Floats) -> Floats:
        assert network == "change"
        return self.g


def test_the_safety_layers_projection_is_the_closed_form(scene_on):
    """a - max(0, (g . a + c - d) / g . g) g, where that lies within [-1, 1]^2; else the nearest on its edge,
    or, where nothing is allowed, the least cost.
    """
    scene = scene_on("south", "right", 50.0, 4.0)  # in the outer lane, 1.75 m from the edge of the road
    means, rng, c = Direct(), np.random.default_rng(0), scene_cost(scene)
    assert c == pytest.approx(0.195, abs=0.01)
    seen = {"nominal": 0, "inside": 0, "edge": 0, "infeasible": 0}
    grid = np.stack(np.meshgrid(*[np.linspace(-1, 1, 201)] * 2), axis=-1).reshape(-1, 2)
    for _ in range(200):
        g = (rng.choice([0.4, 0.8]) * c * rng.normal(size=2)).astype(np.float32)
        a, limit = rng.uniform(-1, 1, 2), float(rng.uniform(0, 1.2 * c))
        asked = proposal(scene, list(a), means)
        assert asked.action is not None
        answer = QpslSettings(cost_limit=limit).make({}, action=means).correct(scene, asked, Model(g))
        over = float(g @ asked.action) + c - limit
        closed = asked.action - max(0.0, over / float(g @ g)) * g
        action = means.normalised(answer.u, scene)
        if over <= 0:
            seen["nominal"] += 1
            assert answer.status == "nominal"
        elif answer.infeasible:
            seen["infeasible"] += 1
            assert c - np.abs(g).sum() > limit
            assert action == pytest.approx(-np.sign(g), abs=1e-6)
        elif np.abs(closed).max() <= 1:
            seen["inside"] += 1
            assert action == pytest.approx(closed, abs=1e-5)
        else:
            seen["edge"] += 1
            allowed = grid[grid @ g <= limit - c]
            assert g @ action <= limit - c + 1e-5
            best = np.linalg.norm(allowed - asked.action, axis=1).min(initial=9.0)
            assert np.linalg.norm(action - asked.action) <= best + 1e-5
    assert min(seen.values()) >= 10


@pytest.mark.parametrize("kind", ["usl", "recovery", "qpsl"])
def test_who_has_not_learnt_with_it_is_refused(scene: Scene, kind: str):
    with pytest.raises(ValidationError, match=r"asks the critics for .*those of 'sac' do not say"):
        AgentConfig.model_validate({"algorithm": "sac", "correction": kind})
    correction = read_correction(kind).make({})
    assert correction is not None
    with pytest.raises(AgentError, match=r"only an agent .* that has learnt with it"):
        FilteredAgent(Follower(), "follower", correction).act(scene)
