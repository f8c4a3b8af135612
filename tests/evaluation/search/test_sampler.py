"""A fault of probability 1e-4 is found and measured; the same seed asks for the same points."""

import numpy as np
import pytest
from scipy.special import ndtr

from rudc.evaluation.search.proposal import as_declared, fitted
from rudc.evaluation.search.rate import violation_rate
from rudc.evaluation.search.region import likeliest_region
from rudc.evaluation.search.sampler import BATCH, Sampler
from tests.evaluation.search.corners import corners, searched


def rate_of(violated, weights, fitted=None):
    every = np.ones(len(violated), bool)
    return violation_rate(violated, every, weights, every if fitted is None else fitted)


def test_a_rare_fault_is_found_and_its_rate_measured():
    rates = []
    for seed in range(6):
        z, violated, weights, fitted = searched(seed, corners(rate=1e-4))
        assert np.argmax(violated) < 250  # the first of them; plain sampling takes 10,000 on average
        assert violated.sum() > 50
        assert weights.max() <= 3.0
        rates.append(rate_of(violated, weights, fitted))
        region = likeliest_region(["a", "b"], ndtr(z), violated, weights)
        assert region.bounds["a"] == (pytest.approx(0.99, abs=0.005), np.inf)
        assert region.bounds["b"] == (-np.inf, pytest.approx(0.01, abs=0.005))
        assert region.violations >= 0.9 * region.of
    assert np.mean([rate.value for rate in rates]) == pytest.approx(1e-4, rel=0.15)
    assert sum(rate.low <= 1e-4 <= rate.high for rate in rates) >= 5


@pytest.mark.parametrize("count", [1, 2, 3])
def test_the_interval_holds_the_rate_of_several_regions(count):
    rates = [rate_of(*searched(seed, corners(count, 1e-2), episodes=240)[1:]) for seed in range(20)]
    assert sum(rate.low <= 1e-2 <= rate.high for rate in rates) >= 17
    assert sum(rate.low <= 1e-2 <= rate.ceiling for rate in rates) >= 19


def test_a_key_that_does_not_matter_stands_in_no_rule():
    z, violated, weights, fitted = searched(
        0, lambda shares: (shares[:, 0] > 0.95, 1.0 - shares[:, 0]), keys=3
    )
    rate = rate_of(violated, weights, fitted)
    assert rate.low <= 0.05 <= rate.high
    region = likeliest_region(["a", "b", "c"], ndtr(z), violated, weights)
    assert list(region.bounds) == ["a"]
    assert str(region).startswith("a >= 0.9")


def test_the_same_seed_gives_the_same_points_whatever_else_draws():
    np.random.seed(1)  # noqa: NPY002
    first = searched(3, corners())
    np.random.seed(2)  # noqa: NPY002
    assert np.array_equal(first[0], searched(3, corners())[0])
    assert not np.array_equal(first[0], searched(4, corners())[0])


@pytest.mark.parametrize("answer", [
    lambda shares: (np.ones(len(shares), bool), np.zeros(len(shares))),
    lambda shares: (np.zeros(len(shares), bool), np.full(len(shares), np.nan)),
    lambda shares: (np.zeros(len(shares), bool), np.zeros(len(shares))),
], ids=["all violate", "nobody is met", "no gap differs"])  # fmt: skip
@pytest.mark.parametrize("keys", [1, 12])
def test_a_search_that_can_learn_nothing_goes_on(answer, keys):
    z, violated, weights, fitted = searched(0, answer, keys=keys, episodes=10 * BATCH + 1)
    assert z.shape == (10 * BATCH + 1, keys)
    assert np.isfinite(z).all()
    assert (weights > 0.0).all()
    rate = rate_of(violated, weights, fitted)
    assert rate.low <= float(violated.all()) <= rate.ceiling


def test_a_weight_is_1_in_the_mean_however_the_points_were_drawn():
    _, _, weights, _ = searched(0, corners(rate=1e-2), episodes=2400)
    assert weights.mean() == pytest.approx(1.0, abs=0.05)


@pytest.mark.parametrize("count", [4, 12])
def test_the_first_of_a_batch_count_for_what_they_were_drawn_from(count):
    weights = []
    for seed in range(50):
        whole, cut = Sampler(2, seed), Sampler(2, seed)
        for sampler in (whole, cut):
            batch = sampler.ask()
            sampler.tell(batch, batch.z[:, 0] > 0.3, -batch.z[:, 0])
        every, first = whole.ask(), cut.ask(count)
        assert np.array_equal(first.z, every.z[:count])
        weights.append(first.weights.mean())
    assert np.mean(weights) == pytest.approx(1.0, abs=0.04)  # 1.4 and 1.3 by the weights of the whole batch


def test_a_mixture_has_a_part_for_each_group_and_the_density_that_it_is_drawn_from():
    rng = np.random.default_rng(0)
    points = np.concatenate([rng.normal((3, 3), 0.1, (20, 2)), rng.normal((-3, 2), 0.1, (10, 2))])
    mixture = fitted(10, points, np.ones(30))
    shares = sorted(part.share for part in mixture.parts)
    assert shares == pytest.approx([5 / 24, 5 / 24, 7 / 24, 7 / 24])
    assert {tuple(part.mean.round()) for part in mixture.parts} == {(3.0, 3.0), (-3.0, 2.0)}
    assert as_declared(7, 2).density(points) == pytest.approx(7.0)
    cells = 0.05 * np.stack(np.meshgrid(np.arange(-200, 200), np.arange(-200, 200)), axis=-1).reshape(-1, 2)
    declared = np.exp(-0.5 * np.sum(cells**2, axis=1)) / (2 * np.pi)
    assert np.sum(mixture.density(cells) * declared) * 0.05**2 == pytest.approx(10.0, rel=1e-6)
    many = mixture._replace(number=20_000).drawn(rng)
    assert np.mean(many[:, 0] > 0.0) == pytest.approx(7 / 12, abs=0.015)


def test_without_violations_the_rate_has_an_upper_end():
    rate = rate_of(np.zeros(100, bool), np.ones(100))
    assert rate.value == rate.low == 0.0
    assert rate.high == rate.ceiling == pytest.approx(0.0369, abs=1e-4)  # 1 - 0.025 ** (1 / 100)


def test_equal_weights_give_the_exact_interval_of_a_count():
    violated = np.arange(1000) < 4
    rate = rate_of(violated, np.ones(1000))
    assert rate == pytest.approx((0.004, 0.00109, 0.01024, 0.01024), rel=1e-3)  # Garwood: 1.09 to 10.24 of 4


def test_episodes_that_could_not_be_run_count_for_nothing():
    weights = np.repeat([0.5, 2.0], 50)
    able = np.arange(100) < 90
    none = np.zeros(100, bool)
    rate = violation_rate(np.arange(100) == 0, able, weights, none)
    assert rate.value == pytest.approx(0.5 / (100.0 - 20.0))
    assert np.isnan(violation_rate(none, none, weights, none).value)


def test_a_few_episodes_drawn_when_violations_were_known_replace_no_batch():
    violated, every = np.arange(BATCH + 2) % 2 == 0, np.ones(BATCH + 2, bool)
    few = np.arange(BATCH + 2) >= BATCH
    rate = violation_rate(violated, every, np.ones(BATCH + 2), few)
    assert rate == violation_rate(violated, every, np.ones(BATCH + 2), ~every)
    assert rate.low > 0.2


@pytest.mark.parametrize("episodes", [BATCH, BATCH + 2, BATCH + 12])
def test_the_rate_of_a_short_search_is_without_bias(episodes):
    rates = [
        rate_of(*searched(seed, lambda shares: (shares[:, 0] < 0.3, shares[:, 0]), episodes=episodes)[1:])
        for seed in range(50)
    ]
    assert np.mean([rate.value for rate in rates]) == pytest.approx(0.3, abs=0.03)
    assert np.std([rate.value for rate in rates]) < 0.15


def test_the_rate_is_that_of_the_batches_drawn_when_violations_were_known():
    violated, fitted = np.arange(100) % 10 == 0, np.arange(100) >= 50
    rate = violation_rate(violated & fitted, np.ones(100, bool), np.ones(100), fitted)
    assert rate.value == pytest.approx(0.1)
