"""Plain SAC: against stable-baselines3 on the same batches, and on problems whose answer is known."""

from collections.abc import Iterator

import gymnasium
import numpy as np
import pytest
import torch
from stable_baselines3 import SAC
from stable_baselines3.common.logger import Logger
from stable_baselines3.common.type_aliases import ReplayBufferSamples
from torch.distributions import normal

from rudc.learning.batch import Batch
from rudc.learning.config import LearnerConfig, NetworkConfig, ObservationLayout, Problem
from rudc.learning.sac import SacLearner
from tests.learning.helpers import TOY

PLAIN = NetworkConfig(encoder="mlp", hidden=24)
PROBLEM = Problem(ObservationLayout(ego=5, vehicles=0, waypoints=0, task=0), actions=2, seed=4)
CONFIG = LearnerConfig(
    policy=PLAIN,
    critic=PLAIN,
    value_scale=1.0,
    actor_rate=(1e-3, 1e-3),
    critic_rate=(2e-3, 2e-3),
    temperature=0.3,
    temperature_rate=5e-3,
    max_gradient=1e9,
    log_std=(-20.0, 2.0),
)


class Anything(gymnasium.Env):
    """Spaces for stable-baselines3; nobody steps it."""

    observation_space = gymnasium.spaces.Box(-9.0, 9.0, (5,), np.float32)
    action_space = gymnasium.spaces.Box(-1.0, 1.0, (2,), np.float32)


def batch(seed: int, count: int = 32) -> Batch:
    rng = np.random.default_rng(seed)

    def floats(*shape: int) -> np.ndarray:
        return rng.normal(size=shape).astype(np.float32)

    return Batch(
        observation=floats(count, 5),
        executed=np.tanh(floats(count, 2)),
        proposed=np.tanh(floats(count, 2)),
        reward=floats(count),
        cost=np.abs(floats(count)),
        discount=np.full(count, 0.99, np.float32),
        next_observation=floats(count, 5),
        terminal=rng.random(count) < 0.3,
        mask=np.zeros((count, 0), np.bool_),
    )


def copy_layer(linear: torch.nn.Module, weight: torch.Tensor, bias: torch.Tensor) -> None:
    assert isinstance(linear, torch.nn.Linear)
    with torch.no_grad():
        linear.weight.copy_(weight.T)
        linear.bias.copy_(bias.reshape(-1))


def reference(learner: SacLearner) -> SAC:
    """stable-baselines3's SAC with our initial weights and settings."""
    config = learner.config
    model = SAC(
        "MlpPolicy",
        Anything(),
        learning_rate=1.0,
        tau=config.target_rate,
        gamma=0.99,
        ent_coef=f"auto_{config.temperature}",
        policy_kwargs={"net_arch": [24, 24], "activation_fn": torch.nn.GELU},
    )
    model.set_logger(Logger(None, []))
    model._update_learning_rate = lambda optimizers: None
    rates = (
        (model.actor.optimizer, config.actor_rate[0]),
        (model.critic.optimizer, config.critic_rate[0]),
        (model.ent_coef_optimizer, config.temperature_rate),
    )
    for optimizer, rate in rates:
        assert optimizer is not None
        optimizer.param_groups[0]["lr"] = rate
    w = learner.policy.trained
    for layer, name in ((model.actor.latent_pi[0], "fuse"), (model.actor.latent_pi[2], "hidden")):
        copy_layer(layer, w[f"{name}.weight"][0], w[f"{name}.bias"][0])
    for head, part in ((model.actor.mu, slice(0, 2)), (model.actor.log_std, slice(2, 4))):
        copy_layer(head, w["out.weight"][0][:, part], w["out.bias"][0][:, part])
    w = learner.critics.trained
    for critic in (model.critic, model.critic_target):
        for n, network in enumerate(critic.q_networks):
            joint = torch.cat([w["fuse.weight"][n], w["action.weight"][n]])
            copy_layer(network[0], joint, w["fuse.bias"][n])
            for layer, name in ((network[2], "hidden"), (network[4], "out")):
                copy_layer(layer, w[f"{name}.weight"][n], w[f"{name}.bias"][n])
    return model


def test_same_numbers_as_stable_baselines3(monkeypatch: pytest.MonkeyPatch) -> None:
    """Ten updates on the same batches with the same noise: critics, policy, temperature, targets."""
    learner = SacLearner(CONFIG, PROBLEM)
    model = reference(learner)
    drawn: list[torch.Tensor] = []
    plain = learner.noise

    def noise(rows: int, columns: int) -> torch.Tensor:
        drawn.append(plain(rows, columns))
        return drawn[-1]

    learner.noise = noise  # pyright: ignore[reportAttributeAccessIssue]

    def replayed() -> Iterator[torch.Tensor]:
        while True:  # theirs draws for the policy first, ours for the target
            yield drawn[-1]
            yield drawn[-2]

    source = replayed()
    monkeypatch.setattr(normal, "_standard_normal", lambda shape, dtype, device: next(source))
    for seed in range(10):
        b = batch(seed)
        learner.update(b)
        samples = [b.observation, b.executed, b.next_observation, b.terminal[:, None], b.reward[:, None]]
        tensors = [torch.from_numpy(np.asarray(x, np.float32)) for x in samples]
        monkeypatch.setattr(
            model.replay_buffer, "sample", lambda *_, t=tensors, **__: ReplayBufferSamples(*t)
        )
        model.train(gradient_steps=1, batch_size=32)
    assert model.log_ent_coef is not None
    assert float(learner.temperature.value) == pytest.approx(
        float(model.log_ent_coef.detach().exp()), rel=1e-4
    )
    for ours, theirs in (
        (learner.critics.trained, model.critic),
        (learner.critics.target, model.critic_target),
    ):
        for n, network in enumerate(theirs.q_networks):
            assert torch.allclose(ours["hidden.weight"][n].T, network[2].weight, atol=2e-5)
            assert torch.allclose(ours["out.weight"][n].T, network[4].weight, atol=2e-5)
    assert torch.allclose(
        learner.policy.trained["hidden.weight"][0].T, model.actor.latent_pi[2].weight, atol=5e-5
    )
    assert torch.allclose(learner.policy.trained["out.weight"][0][:, :2].T, model.actor.mu.weight, atol=5e-5)


def test_stopped_and_resumed_same_numbers() -> None:
    through, first, second = (SacLearner(CONFIG, PROBLEM) for _ in range(3))
    expected = [through.update(batch(seed)) for seed in range(6)]
    for seed in range(3):
        first.update(batch(seed))
    second.load(first.state())
    assert [second.update(batch(seed)) for seed in range(3, 6)] == expected[3:]


def chain(rng: np.random.Generator, count: int = 64) -> Batch:
    """First state: reward 20, on to the second; there 100 x, x = (1 + a) / 2, and the end. With a at its
    best, values are 20 + 0.9 * 100 and 100.
    """
    first = rng.random(count) < 0.5
    action = rng.uniform(-1, 1, size=(count, 1)).astype(np.float32)
    observation = np.where(first[:, None], [1.0, 0.0], [0.0, 1.0]).astype(np.float32)
    return Batch(
        observation=observation,
        executed=action,
        proposed=action,
        reward=np.where(first, 20.0, 50 * (1 + action[:, 0])).astype(np.float32),
        cost=np.zeros(count, np.float32),
        discount=np.full(count, 0.9, np.float32),
        next_observation=np.tile(np.float32([0.0, 1.0]), (count, 1)),
        terminal=~first,
        mask=np.zeros((count, 0), np.bool_),
    )


def test_values_of_a_chain_are_recovered() -> None:
    network = NetworkConfig(encoder="mlp", hidden=32)
    config = LearnerConfig(
        policy=network,
        critic=network,
        critic_rate=(3e-3, 3e-4),
        actor_rate=(3e-3, 3e-4),
        target_rate=0.05,
        temperature=0.1,
        temperature_rate=0.0,
    )
    learner, rng = SacLearner(config, Problem(TOY.layout, 1, updates=800)), np.random.default_rng(0)
    for _ in range(800):
        learner.update(chain(rng))
    states = torch.eye(2)
    mean, _ = learner.policy.distribution(learner.policy.trained, states)
    assert float(mean[1].detach().tanh()) > 0.9
    best = torch.tensor([[0.0], [1.0]])
    with torch.no_grad():
        values = learner.critics.value(states, best).numpy()
    assert values == pytest.approx([110.0, 100.0], abs=4.0)
