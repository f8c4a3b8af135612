"""The slack delta(sigma): continuous, strictly decreasing, twice as steep beyond sigma_h."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rudc.errors import InputError
from rudc.safety.slack import Slack

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


@settings(deadline=None)
@given(SLACKS, SIGMA, st.floats(1e-3, 10))
def test_strictly_decreasing(slack: Slack, sigma: float, more: float) -> None:
    assert slack(sigma + more) < slack(sigma)


@settings(deadline=None)
@given(SLACKS)
def test_continuous_where_the_slope_doubles(slack: Slack) -> None:
    below = slack(math.nextafter(slack.high, -math.inf))
    assert below == pytest.approx(slack(slack.high), abs=1e-9)


@settings(deadline=None)
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
