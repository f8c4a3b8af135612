"""Numbers that are fixed or drawn: what files may say, what is drawn, what is refused."""

import json
import math
from typing import Annotated

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import TypeAdapter, ValidationError

from rudc.scenario.distributions import AnyDistribution, Bounds, Choice, Constant, Normal, distribution

finite = st.floats(-1e6, 1e6)
uniforms = st.tuples(finite, finite).map(lambda ends: {"uniform": sorted(ends)})
normals = st.builds(
    lambda mean, std, down, up: {
        "normal": {"mean": mean, "std": std, **({"low": mean - down} if down is not None else {}),
                   **({"high": mean + up} if up is not None else {})}
    },
    finite, st.floats(1e-3, 1e3), st.none() | st.floats(0, 1e3), st.none() | st.floats(0.01, 1e3),
)  # fmt: skip
choices = st.lists(finite, min_size=1, max_size=5).map(lambda values: {"choice": values})
weighted = st.lists(st.tuples(finite, st.floats(0.1, 9)), min_size=1, max_size=5).map(
    lambda pairs: {"choice": {"values": [v for v, _ in pairs], "weights": [w for _, w in pairs]}}
)
written = finite | uniforms | normals | choices | weighted


@given(written, st.integers(0, 2**32))
def test_samples_lie_in_the_support(value, seed):
    drawn = distribution(value)
    low, high = drawn.support
    rng = np.random.default_rng(seed)
    samples = [drawn.sample(rng) for _ in range(5)]
    assert all(low <= sample <= high and type(sample) is float for sample in samples)


@given(written)
def test_what_is_written_out_is_read_back_the_same(value):
    first = distribution(value)
    text = json.dumps(TypeAdapter(AnyDistribution).dump_python(first, mode="json", exclude_none=True))
    assert distribution(json.loads(text)) == first


@pytest.mark.parametrize(
    ("value", "mean"),
    [
        (3.5, 3.5),
        ({"uniform": [2, 6]}, 4.0),
        ({"choice": [1, 2, 6]}, 3.0),
        ({"choice": {"values": [0, 10], "weights": [3, 1]}}, 2.5),
        ({"normal": [7, 1]}, 7.0),
        # one-sided at the mean: mean + std * sqrt(2 / pi)
        ({"normal": {"mean": 1.0, "std": 2.0, "low": 1.0}}, 1.0 + 2.0 * math.sqrt(2 / math.pi)),
        ({"normal": {"mean": 1.0, "std": 2.0, "high": 1.0}}, 1.0 - 2.0 * math.sqrt(2 / math.pi)),
    ],
)
def test_mean_is_that_of_the_samples(value, mean):
    drawn = distribution(value)
    rng = np.random.default_rng(5)
    samples = [drawn.sample(rng) for _ in range(20_000)]
    assert drawn.mean == pytest.approx(mean)
    assert np.mean(samples) == pytest.approx(mean, abs=0.08)


@pytest.mark.parametrize(
    ("value", "drawn"),
    [
        ({"uniform": [6, 10]}, [6.342596668574497, 6.947242026384399, 9.205097860825587]),
        ({"normal": [7, 1]}, [5.631956097241979, 6.283400111313249, 7.846182272862275]),
        (
            {"normal": {"mean": 4.5, "std": 1.0, "low": 2.5, "high": 7}},
            [3.2514721970040563, 3.8339909386115276, 5.344553290322738],
        ),
        ({"choice": [1, 2, 6]}, [1.0, 1.0, 6.0]),
    ],
)
def test_a_seed_draws_the_same_values_in_every_version(value, drawn):
    rng = np.random.default_rng(3)
    assert [distribution(value).sample(rng) for _ in drawn] == drawn


@pytest.mark.parametrize(
    "value", [{"uniform": [6, 10]}, {"normal": {"mean": 4.5, "std": 1.0, "low": 2.5, "high": 7}}]
)
def test_a_quantile_is_the_value_below_which_a_share_of_the_samples_lies(value):
    drawn = distribution(value)
    rng = np.random.default_rng(5)
    samples = [drawn.sample(rng) for _ in range(20_000)]
    for share in (0.0, 0.1, 0.5, 0.9, 1.0):
        assert np.mean(samples <= np.float64(drawn.quantile(share))) == pytest.approx(share, abs=0.01)
    assert (drawn.quantile(0.0), drawn.quantile(1.0)) == pytest.approx(drawn.support)


@pytest.mark.parametrize("low", [0.0, 6.0, -math.inf])
def test_no_quantile_is_the_cut_itself(low):
    cut = distribution({"normal": {"mean": 7, "std": 1, "high": 12, **({"low": low} if low > -9 else {})}})
    values = [cut.quantile(share) for share in (0.0, 1e-300, 1e-19, 0.5, 1.0)]
    assert values == sorted(values)
    assert low < values[0] < values[3] < values[4] < 12.0


def test_a_normal_between_equal_limits_is_that_number():
    one = distribution({"normal": {"mean": 1, "std": 0.1, "low": 1, "high": 1}})
    assert one.mean == one.quantile(0.3) == one.sample(np.random.default_rng(0)) == 1.0


def test_weights_are_shares():
    drawn = distribution({"choice": {"values": [1, 2], "weights": [9, 1]}})
    rng = np.random.default_rng(0)
    assert np.mean([drawn.sample(rng) == 1 for _ in range(5_000)]) == pytest.approx(0.9, abs=0.02)


def test_a_normal_above_a_bound_is_written_out_cut_there_and_read_back():
    adapter = TypeAdapter(Annotated[AnyDistribution, Bounds(0, 12, above=True)])
    value = adapter.validate_python({"normal": [7, 1]})
    assert adapter.validate_python(value.model_dump()) == value
    with pytest.raises(ValidationError, match="0 is not above 0"):
        adapter.validate_python({"uniform": [0, 5]})


def test_a_fixed_number_draws_nothing():
    rng, untouched = np.random.default_rng(1), np.random.default_rng(1)
    assert distribution(4).sample(rng) == 4.0
    assert rng.random() == untouched.random()


def test_only_fixed_numbers_have_a_value():
    assert float(distribution(2.5)) == 2.5
    assert list(range(distribution(3))) == [0, 1, 2]
    with pytest.raises(TypeError, match="not fixed"):
        float(distribution({"uniform": [1, 2]}))
    with pytest.raises(TypeError, match="whole"):
        range(distribution(2.5))


@pytest.mark.parametrize(
    "value",
    [
        True, "3", None, math.nan, math.inf, -math.inf, [1, 2], {}, {"uniform": [2, 1]}, {"uniform": [1]},
        {"uniform": [1, 2, 3]}, {"uniform": [1, math.inf]}, {"uniform": [1, 2], "choice": [1]}, {"gauss": [1,
        2]}, {"normal": [1, 0]}, {"normal": [1, -2]}, {"normal": [1]}, {"normal": {"mean": 1, "std": 1, "low":
        2}}, {"normal": {"mean": 1, "std": 1, "high": 0}}, {"choice": []}, {"choice": ["a"]}, {"value": 3},
        {"choice": {"values": [1, 2], "weights": [1]}}, {"choice": {"values": [1, 2], "weights": [1, -1]}},
        {"choice": {"values": [1, 2], "weights": [0, 0]}}, {"uniform": [1, 2], "more": 3}, {"uniform": [True,
        2]}, {"choice": {"values": [1, 2], "weights": [1e308, 1e308]}},
    ],
)  # fmt: skip
def test_refused(value):
    with pytest.raises(ValidationError):
        distribution(value)


class TestBounds:
    def test_truncate_normals(self):
        bounded = Bounds(0, 10).check(distribution({"normal": [9, 100]}))
        rng = np.random.default_rng(2)
        samples = [bounded.sample(rng) for _ in range(500)]
        assert min(samples) >= 0
        assert max(samples) <= 10
        assert bounded.support == (0.0, 10.0)

    def test_keep_narrower_limits(self):
        value = {"normal": {"mean": 5, "std": 1, "low": 4, "high": 7}}
        assert Bounds(0, 10).check(distribution(value)).support == (4.0, 7.0)

    @pytest.mark.parametrize(
        "value",
        [
            -1, 11, {"uniform": [-1, 5]}, {"uniform": [5, 11]}, {"choice": [1, 12]}, {"normal": [11, 1]},
            {"normal": {"mean": 5, "std": 1, "high": 20}}, {"normal": {"mean": 5, "std": 1, "low": -3}},
        ],
    )  # fmt: skip
    def test_refuse_what_reaches_beyond(self, value):
        with pytest.raises(ValueError, match="between 0 and 10 m"):
            Bounds(0, 10, "m").check(distribution(value))

    def test_may_exclude_their_lower_end(self):
        assert Bounds(0, 1).check(Constant(value=0.0)) == Constant(value=0.0)
        with pytest.raises(ValueError, match="above 0"):
            Bounds(0, 1, above=True).check(Constant(value=0.0))

    @pytest.mark.parametrize("value", [1.5, {"choice": [1, 2.5]}, {"uniform": [1, 3]}, {"normal": [3, 1]}])
    def test_may_ask_for_whole_numbers(self, value):
        with pytest.raises(ValueError, match="whole"):
            Bounds(1, 9, whole=True).check(distribution(value))

    def test_accept_whole_numbers(self):
        assert isinstance(Bounds(1, 9, whole=True).check(distribution({"choice": [1, 3]})), Choice)


def test_equal_distributions_are_equal_and_hash_alike():
    one, other = distribution({"normal": [1, 2]}), distribution({"normal": {"mean": 1, "std": 2}})
    assert isinstance(one, Normal)
    assert one == other
    assert hash(one) == hash(other)
