"""The ensemble against hand-computed cases: priors, masks, targets."""

import numpy as np
import pytest
import torch

from rudc.learning.ensemble import CriticEnsemble
from rudc.learning.parameters import frozen_arrays, prior_arrays
from rudc.learning.quantiles import quantile_huber
from rudc.learning.rudc import RudcLearner
from tests.learning.helpers import CPU, observations, random_batch, small_case, toy_case


def test_prior_equation_by_hand() -> None:
    """Eq. (fpn) with rho = 3: O = 4 * 50 * o, F = 20 f, Z = (O + 3 F) / 4."""
    critics = CriticEnsemble(*toy_case(prior_factor=3.0, prior_scale=20.0, value_scale=50.0), CPU)
    o, f = torch.tensor([0.1, -2.0]), torch.tensor([0.5, 1.0])
    by_hand = torch.tensor([(200 * 0.1 + 3 * 20 * 0.5) / 4, (200 * -2.0 + 3 * 20 * 1.0) / 4])
    assert torch.allclose(critics.combine(o, f), by_hand)


def test_learning_is_as_fast_with_a_prior_as_without() -> None:
    """The gain at the head makes up for 1 / (1 + rho): with a prior of no size the same step is taken."""
    after = []
    for case in (small_case(prior_factor=0.0), small_case(prior_scale=1e-12)):
        learner = RudcLearner(*case)
        learner.update(random_batch(case, 16))
        after.append(learner.critics.trained["out.weight"].detach())
    assert torch.allclose(*after, atol=1e-6)


def constant(critics: CriticEnsemble, trained: list[float], prior: list[float]) -> None:
    """Let every member answer a constant, whatever it is asked."""
    for weights, values in ((critics.trained, trained), (critics.prior, prior), (critics.target, trained)):
        with torch.no_grad():
            for tensor in weights.values():
                tensor.zero_()
            weights["out.bias"][:] = torch.tensor(values)[:, None, None]


def test_targets_are_the_mean_over_members_with_their_priors() -> None:
    critics = CriticEnsemble(*toy_case(prior_factor=1.0, prior_scale=2.0, value_scale=10.0), CPU)
    constant(critics, [1.0, 2.0, 6.0], [0.0, 3.0, 6.0])
    seen, action = torch.zeros(4, 2), torch.zeros(4, 1)
    members = critics.evaluate(seen, action)[:, 0, 0]
    assert members.tolist() == pytest.approx([10.0, 23.0, 66.0])
    assert critics.mean_target(seen, action).numpy() == pytest.approx(np.full((4, 32), 33.0))


def test_masked_members_do_not_learn() -> None:
    """By hand: constants of one quantile, kappa 1; member n's bias gradient is the masked mean of +-1/2."""
    z = torch.tensor([[[0.0], [0.0], [0.0], [0.0]], [[0.0], [0.0], [0.0], [0.0]]], requires_grad=True)
    target = torch.tensor([[5.0], [5.0], [-5.0], [0.5]])
    mask = torch.tensor([[1.0, 1.0, 1.0, 1.0], [1.0, 0.0, 0.0, 0.0]])
    loss = (mask * quantile_huber(z, target)).mean(dim=1)
    assert loss.tolist() == pytest.approx([0.5 * (4.5 + 4.5 + 4.5 + 0.125) / 4, 0.5 * 4.5 / 4])
    loss.sum().backward()
    assert z.grad is not None
    assert (z.grad.sum(dim=(1, 2)) * 4).tolist() == pytest.approx([-0.5 - 0.5 + 0.5 - 0.25, -0.5])


def test_a_member_masked_everywhere_stays_as_it_is() -> None:
    case = small_case()
    learner = RudcLearner(*case)
    before = learner.weights()
    batch = random_batch(case, 16)
    batch.mask[:, 1] = False
    learner.update(batch)
    for name, value in learner.weights().items():
        if name.startswith("critic/"):
            assert np.array_equal(value[1], before[name][1])
            assert not np.array_equal(value[0], before[name][0])


def test_priors_stay_and_are_rebuilt_from_the_seed() -> None:
    case = small_case(seed=11)
    learner = RudcLearner(*case)
    for seed in range(3):
        learner.update(random_batch(case, 16, seed))
    for name, value in prior_arrays(*case).items():
        assert np.array_equal(learner.critics.prior[name].numpy(), value)


def test_members_disagree_where_nothing_was_learnt() -> None:
    """Trained parts at zero: what is left are the priors, apart by about prior_scale."""
    case = small_case(prior_scale=10.0)
    critics = CriticEnsemble(*case, CPU)
    seen = torch.from_numpy(observations(case.problem.layout, 64, np.random.default_rng(0)))
    with torch.no_grad():
        critics.trained["out.weight"].zero_()
        critics.trained["out.bias"].zero_()
    z = critics.evaluate(seen, torch.zeros(64, 2))
    assert 2.0 < float(z.std(dim=0).mean()) < 50.0


def test_priors_are_normalised_on_what_was_seen() -> None:
    """Root mean square P over the first transitions, for each member; kept in the state, and rebuilt from
    the seed and what is stored.
    """
    case = small_case(prior_scale=4.0, seed=2)
    learner, batch = RudcLearner(*case), random_batch(case, 500)

    def priors(learner: RudcLearner) -> np.ndarray:
        critics = learner.critics
        latent = critics.prior_latent(torch.from_numpy(batch.observation))
        assert latent is not None
        return 4.0 * critics.stack.decode(critics.prior, latent, torch.from_numpy(batch.executed)).numpy()

    before = priors(learner)
    learner.start(batch)
    after = priors(learner)
    assert np.sqrt((before**2).mean(axis=(1, 2))) != pytest.approx(np.full(3, 4.0), rel=0.2)
    assert np.sqrt((after**2).mean(axis=(1, 2))) == pytest.approx(np.full(3, 4.0), rel=1e-4)
    for n in range(3):  # nothing but the size is another
        assert np.corrcoef(before[n].ravel(), after[n].ravel())[0, 1] == pytest.approx(1.0, abs=1e-5)
    learner.update(random_batch(case, 16))
    other = RudcLearner(*case)
    other.load(learner.state())
    assert np.array_equal(priors(other), priors(learner))
    assert other.update(random_batch(case, 16, 1)) == learner.update(random_batch(case, 16, 1))
    weights = learner.weights()
    stored = {k: v for k, v in weights.items() if not k.startswith("prior/")}
    for name, value in frozen_arrays(*case, stored).items():
        assert np.array_equal(value, weights[name]), name


def test_without_prior() -> None:
    case = small_case(prior_factor=0.0)
    critics = CriticEnsemble(*case, CPU)
    assert not critics.has_prior
    seen = torch.from_numpy(observations(case.problem.layout, 3, np.random.default_rng(0)))
    action = torch.zeros(3, 2)
    z = case.config.value_scale * critics.stack.decode(
        critics.trained, critics.stack.encode(critics.trained, seen), action
    )
    assert torch.allclose(critics.evaluate(seen, action), z)


@pytest.mark.parametrize(("rate", "expected"), [(0.25, 2.0), (1.0, 5.0)])
def test_targets_follow(rate: float, expected: float) -> None:
    """A share of the way (Polyak), or all of it (hard copy); priors stay."""
    critics = CriticEnsemble(*toy_case(target_rate=rate), CPU)
    prior = {name: value.clone() for name, value in critics.prior.items()}
    with torch.no_grad():
        for name, tensor in critics.trained.items():
            tensor.fill_(5.0)
            critics.target[name].fill_(1.0)
    critics.follow()
    for name, tensor in critics.target.items():
        assert torch.equal(tensor, torch.full_like(tensor, expected))
        assert torch.equal(critics.prior[name], prior[name])


def test_objective_is_the_mean_of_the_weighted_quantiles() -> None:
    case = small_case()
    learner = RudcLearner(*case)
    critics = learner.critics
    rng = np.random.default_rng(2)
    seen = torch.from_numpy(observations(case.problem.layout, 5, rng))
    action = torch.from_numpy(np.tanh(rng.normal(size=(5, 2))).astype(np.float32)).requires_grad_()
    weights = torch.tensor(case.config.risk().weights(case.config.quantiles), dtype=torch.float32)
    latent = critics.stack.encode(critics.trained, seen)
    value = critics.objective(latent, critics.prior_latent(seen), action, weights)
    expected = (critics.evaluate(seen, action) @ weights).mean(dim=0)
    assert torch.allclose(value, expected, rtol=1e-4, atol=1e-4)
    value.sum().backward()
    assert action.grad is not None
    step = torch.zeros_like(action)
    step[:, 0] = 1e-2
    ahead, behind = (
        (critics.evaluate(seen, (action + sign * step).detach()) @ weights).mean(dim=0) for sign in (1, -1)
    )
    assert action.grad[:, 0].numpy() == pytest.approx(((ahead - behind) / 2e-2).numpy(), rel=0.05, abs=0.05)
