"""The slack delta(sigma): continuous, strictly decreasing, twice as steep beyond sigma_h; as a level and as a
rate."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rudc.errors import InputError
from rudc.safety.config import FilterConfig
from rudc.safety.filter import SafetyFilter
from rudc.safety.rules import Ecbf, Ttcbf
from rudc.safety.slack import Slack, rate_factor
from tests.safety.scenes import Other, make_scene

SIGMA = st.floats(0, 100)
SLACKS = st.builds(
    lambda eta, low, more: Slack(eta, low, low + more),
    st.floats(0.01, 10),
    st.floats(0.1, 50),
    st.floats(0, 50),
)


def test_by_hand() -> None:
    slack = Slack(eta=0.5, low=10.0, high=12.0)
    assert [slack(s) for s in (0.0, 10.0, 11.0, 12.0, 14.0)] == [5.0, 0.0, -0.5, -1.0, -3.0]


@given(SLACKS, SIGMA, st.floats(1e-3, 10))
def test_strictly_decreasing(slack: Slack, sigma: float, more: float) -> None:
    assert slack(sigma + more) < slack(sigma)


@given(SLACKS)
def test_continuous_where_the_slope_doubles(slack: Slack) -> None:
    below = slack(math.nextafter(slack.high, -math.inf))
    assert below == pytest.approx(slack(slack.high), abs=1e-9)


@given(SLACKS, st.floats(0, 1), st.floats(0.1, 20))
def test_slopes(slack: Slack, share: float, step: float) -> None:
    beyond = (slack(slack.high + step) - slack(slack.high)) / step
    before = (slack(slack.high) - slack(slack.high - step)) / step
    assert before == pytest.approx(-slack.eta)
    assert beyond == pytest.approx(2 * before)
    assert slack(share * slack.low * 0.999) > 0


@pytest.mark.parametrize(
    ("eta", "low", "high"),
    [(0, 1, 2), (-1, 1, 2), (math.inf, 1, 2), (1, 2, 1), (1, math.nan, 2), (1, 1, math.inf)],
)
def test_wrong_ones_are_refused(eta: float, low: float, high: float) -> None:
    with pytest.raises(InputError):
        Slack(eta, low, high)


HEIGHT = st.floats(-50, 50)


@given(st.floats(-20, 20), HEIGHT, st.floats(1, 10))
def test_a_rate_has_the_sign_of_delta_whatever_h_is(delta: float, h: float, most: float) -> None:
    (k,) = rate_factor(delta, np.array([h]), most)
    assert 1 / most * (1 - 1e-12) <= k <= most * (1 + 1e-12)
    gain = (k - 1) * h  # what the row has more than the fixed filter's, in units of s0
    assert gain >= 0 if delta >= 0 else gain <= 0
    assert rate_factor(delta, np.zeros(1), most)[0] * 0.0 == 0.0


@given(st.floats(-5, 5), HEIGHT, st.floats(1e-3, 5), st.floats(1, 10))
def test_a_rate_is_a_class_k_function_of_h(delta: float, h: float, more: float, most: float) -> None:
    low, high = rate_factor(delta, np.array([h, h + more]), most) * [h, h + more]
    assert low < high


def test_a_rate_by_hand() -> None:
    h = np.array([2.0, -2.0, 2.0, -2.0])
    most = np.array([10.0, 10.0, 1.8, 1.8])
    assert rate_factor(math.log(4.0), h, most) == pytest.approx([4.0, 0.25, 1.8, 1 / 1.8])
    assert rate_factor(-math.log(4.0), h, most) == pytest.approx([0.25, 4.0, 1 / 1.8, 1.8])
    assert rate_factor(0.0, h, most).tolist() == [1.0] * 4


def test_how_much_a_rule_allows() -> None:
    """TTCBF: all of h in a step. ECBF: a double pole, by the discriminant of r^2 + (l1 + l2) r + k l1 l2."""
    assert Ttcbf(rate=0.1, road_rate=0.25).most(road=False) == pytest.approx(10.0)
    assert Ttcbf(rate=0.1, road_rate=0.25).most(road=True) == pytest.approx(4.0)
    rule = Ecbf(rate1=1.5, rate2=0.3)
    poles = np.roots([1.0, 1.8, rule.most(road=False) * 0.45])
    assert poles == pytest.approx([-0.9, -0.9], abs=1e-6)
    assert Ecbf(rate1=2.0, rate2=2.0).most(road=False) == 1.0


@pytest.mark.parametrize("rule", ["ttcbf", "ecbf"])
@pytest.mark.parametrize("delta", [-1.0, 0.0, 0.5])
@pytest.mark.parametrize("w", [-0.02, 0.0, 0.25])
def test_at_rest_a_row_holds_from_the_stated_h_on(rule: str, delta: float, w: float) -> None:
    """The ego stands some way behind a lorry that stands: the largest x at which the filter lets it be."""
    settings = {"constrained": "all", "road": False, "last_resort": False}
    filter = SafetyFilter(FilterConfig.preset(rule, **settings))
    weights = filter.config.row_weights(road=False)
    s0, c0 = float(weights.h), weights.required

    def held(x: float, *, level: bool) -> tuple[bool, float]:
        scene = make_scene([Other(x, 0.0, math.pi / 2, 0.0, 8.0, 2.5)], v=0.0)
        given = (delta * s0, 0.0) if level else (0.0, delta)
        answer = filter.filter(scene, np.zeros(2), given[0], np.array([w]), given[1])
        return answer.status == "nominal", float(answer.h[0])

    bound = math.log(filter.config.rule_settings.most(road=False))
    within = min(max(delta, -bound), bound)
    factor = math.exp(within) if c0 >= w else math.exp(-within)
    for level, stated in ((True, (c0 - w) / s0 - delta), (False, (c0 - w) / (s0 * factor))):
        near, far = 0.0, 80.0
        for _ in range(50):
            middle = 0.5 * (near + far)
            near, far = (near, middle) if held(middle, level=level)[0] else (middle, far)
        least = held(0.0, level=level)[1]
        assert held(far, level=level)[1] == pytest.approx(max(stated, least), abs=1e-3)
