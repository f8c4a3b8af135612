"""The update: against a plain loop over separate critics, deterministic, resumable."""

import math

import numpy as np
import pytest
import torch
from torch._subclasses.fake_tensor import FakeTensorMode
from torch.utils._python_dispatch import TorchDispatchMode

from rudc.errors import AgentError
from rudc.learning import descent, temperature
from rudc.learning.config import ObservationLayout
from rudc.learning.rudc import RudcLearner
from tests.benchmarks.loop_learner import LoopLearner
from tests.learning.helpers import SMALL, SMALL_MLP, random_batch, small_case


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"layout": ObservationLayout(), "distortion": "expectation", "kappa": 3.0, "members": 5},
        {"critic": SMALL_MLP, "max_gradient": 0.05},
        {"policy": SMALL.model_copy(update={"vehicle_layers": 2, "hops": 1}), "distortion": "wang"},
    ],
    ids=["default", "expectation", "mlp critic, clipped", "deep policy"],
)
def test_same_numbers_as_a_loop_over_separate_critics(changes: dict[str, object]) -> None:
    case = small_case(temperature=0.3, **changes)
    stacked, loop = RudcLearner(*case), LoopLearner(*case)
    for seed in range(4):
        batch = random_batch(case, 24, seed)
        ours, plain = stacked.update(batch), loop.update(batch)
        for name, value in plain.items():
            assert getattr(ours, name) == pytest.approx(value, rel=2e-4, abs=1e-3)
    for n, critic in enumerate(loop.critics):
        for name, linear in critic.maps.items():
            weight = stacked.critics.trained[f"{name}.weight"][n].detach().T
            assert torch.allclose(weight, linear.weight, atol=2e-4), name  # pyright: ignore[reportArgumentType]
    for name, linear in loop.target_policy.maps.items():
        weight = stacked.policy.target[f"{name}.weight"][0].T
        assert torch.allclose(weight, linear.weight, atol=2e-4), name  # pyright: ignore[reportArgumentType]


def test_same_seed_same_numbers() -> None:
    case = small_case(seed=5)
    one, two = RudcLearner(*case), RudcLearner(*case)
    other = RudcLearner(*small_case(seed=6))
    for seed in range(3):
        batch = random_batch(case, 16, seed)
        losses = one.update(batch)
        assert losses == two.update(batch)
        assert losses != other.update(batch)
    for name, value in one.state().items():
        assert np.array_equal(value, two.state()[name]), name


def test_stopped_and_resumed_same_numbers() -> None:
    case = small_case(updates=6)
    through, first = RudcLearner(*case), RudcLearner(*case)
    batches = [random_batch(case, 16, seed) for seed in range(8)]
    expected = [through.update(batch) for batch in batches]
    for batch in batches[:4]:
        first.update(batch)
    second = RudcLearner(*case)
    second.update(batches[-1])  # whatever it did before
    second.load(first.state())
    assert [second.update(batch) for batch in batches[4:]] == expected[4:]
    for name, value in through.state().items():
        assert np.array_equal(value, second.state()[name]), name


class Readable(TorchDispatchMode):
    """Lets a number be read from tensors that hold none."""

    def __torch_dispatch__(self, func, types, args=(), kwargs=None):
        if func is torch.ops.aten._local_scalar_dense.default:
            return args[0].dtype == torch.bool or 0.5
        return func(*args, **(kwargs or {}))


@pytest.mark.parametrize(
    "changes",
    [{}, {"critic": SMALL_MLP, "prior_factor": 0.0}],
    ids=["attention", "mlp critic, no priors"],
)
def test_an_update_computes_on_the_learners_device_alone(
    changes: dict[str, object], monkeypatch: pytest.MonkeyPatch
) -> None:
    """On a GPU, too: torch's fake tensors refuse whatever mixes two devices, and need none of them."""
    case = small_case(**changes)
    for module in (descent, temperature):  # not fused
        monkeypatch.setattr(module, "adam", lambda weights, rate: torch.optim.Adam(list(weights), lr=rate))
    with FakeTensorMode(allow_non_fake_inputs=True), Readable():
        learner = RudcLearner(*case, "meta")
        for seed in range(2):
            batch = random_batch(case, 24, seed)
            learner.update(batch)
        seen, done = (
            torch.from_numpy(array).to(learner.device) for array in (batch.observation, batch.executed)
        )
        assert learner.critics.evaluate(seen, done).device == learner.device
    groups = (learner.critics.trained, learner.critics.target, learner.policy.trained, learner.policy.target)
    assert {tensor.device.type for group in groups for tensor in group.values()} == {"meta"}


def test_a_saved_state_is_a_copy() -> None:
    case = small_case()
    learner = RudcLearner(*case)
    learner.update(random_batch(case, 8))
    state = learner.state()
    before = {name: value.copy() for name, value in state.items()}
    learner.update(random_batch(case, 8, 1))
    assert all(np.array_equal(value, before[name]) for name, value in state.items())


@pytest.mark.parametrize("changes", [{"members": 2}, {"hidden": 16}])
def test_a_state_of_another_configuration_is_refused(changes: dict[str, int]) -> None:
    case = small_case()
    if "hidden" in changes:
        other = small_case(critic=SMALL.model_copy(update=changes))
    else:
        other = small_case(**changes)
    with pytest.raises(AgentError, match="does not fit"):
        RudcLearner(*case).load(RudcLearner(*other).state())


def test_nothing_follows_a_terminal_state() -> None:
    """What comes after does not matter there; after a time-out (not terminal) it does."""
    case = small_case()
    batch = random_batch(case, 8)
    other = batch._replace(next_observation=batch.next_observation[::-1].copy())
    for terminal, same in ((True, True), (False, False)):
        ended = np.full(8, terminal)
        one, two = (RudcLearner(*case).update(b._replace(terminal=ended)) for b in (batch, other))
        assert (one.critic_loss == two.critic_loss) is same
        if terminal:
            assert one.target == pytest.approx(batch.reward.mean(), rel=1e-5)


def test_learning_rates_fall_linearly() -> None:
    case = small_case(updates=4)
    learner = RudcLearner(*case)
    rates = []
    for seed in range(6):
        learner.update(random_batch(case, 8, seed))
        rates.append((learner.critic_descent.rate, learner.policy_descent.rate))
    assert [critic for critic, _ in rates] == pytest.approx([3e-3, 2.275e-3, 1.55e-3, 8.25e-4, 1e-4, 1e-4])
    assert rates[0][1] == pytest.approx(3e-4)
    assert rates[-1][1] == pytest.approx(1e-5)


def test_temperature_goes_after_the_entropy_and_stops_at_the_floor() -> None:
    case = small_case(temperature=0.2, temperature_floor=0.19, temperature_rate=0.02, target_entropy=-50.0)
    learner = RudcLearner(*case)
    seen = [learner.update(random_batch(case, 8, seed)).temperature for seed in range(5)]
    assert seen == sorted(seen, reverse=True)
    assert float(learner.temperature.value) == pytest.approx(0.19)
    upwards = RudcLearner(case.config.model_copy(update={"target_entropy": 50.0}), case.problem)
    upwards.update(random_batch(case, 8))
    assert float(upwards.temperature.value) > 0.2


def test_probabilities_of_squashed_actions_integrate_to_one() -> None:
    """exp(log pi) over a fine grid of one action, from the change of variables the policy uses."""
    case = small_case(actions=1, initial_log_std=-0.5)
    policy = RudcLearner(*case).policy
    seen = torch.zeros(1, case.problem.layout.size)
    mean, log_std = (float(x.detach()) for x in policy.distribution(policy.trained, seen))
    grid = np.linspace(-0.9999, 0.9999, 8_001)
    noise = (np.arctanh(grid) - mean) / math.exp(log_std)
    drawn = policy.draw(
        policy.trained, seen.expand(len(grid), -1), torch.tensor(noise, dtype=torch.float32)[:, None]
    )
    assert drawn.action[:, 0].detach().numpy() == pytest.approx(grid, abs=1e-5)
    assert np.trapezoid(drawn.log_probability.exp().detach().numpy(), grid) == pytest.approx(1.0, abs=2e-3)
