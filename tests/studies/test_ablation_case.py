"""Uncertainty against correction: bins and turning points. The study runs for real in test_quick.py."""

import math

import numpy as np
import pytest

from rudc.studies.ablation_case import cloud_of
from rudc.studies.turning import Bin, bins, turning_point


def decisions(turn: float, *, episodes: int = 40, steps: int = 50):
    """Corrections begin where sigma exceeds `turn`."""
    rng = np.random.default_rng(0)
    sigma = rng.uniform(0.0, 10.0, episodes * steps)
    correction = np.where(sigma > turn, 0.3, 0.0) * rng.uniform(0.5, 1.5, sigma.size)
    return sigma, correction, np.repeat(np.arange(episodes), steps)


def test_the_turning_point_is_where_corrections_begin():
    found = bins(*decisions(6.0))
    assert len(found) == 20
    assert turning_point(found) == pytest.approx(6.25, abs=0.2)
    assert found[0].corrected == 0.0
    assert found[-1].corrected == 100.0
    assert found[-1].median_low < found[-1].median < found[-1].median_high
    assert math.isnan(turning_point(bins(*decisions(11.0))))


def test_one_bin_alone_is_no_turning_point():
    def bin_at(sigma: float, low: float) -> Bin:
        return Bin(sigma, 50, 0.0, low, low, low, low, low, low)

    levels = [0.0, 0.2, 0.0, 0.2, 0.2]
    found = [bin_at(float(k), low) for k, low in enumerate(levels)]
    assert turning_point(found) == 3.0
    assert math.isnan(turning_point(found[:4]))


def test_intervals_are_of_episodes():
    """All decisions of an episode are alike: the interval is that of 10 numbers, not of 500."""
    rng = np.random.default_rng(1)
    episode = np.repeat(np.arange(10), 50)
    correction = rng.uniform(0.0, 1.0, 10)[episode]
    (one, *_) = bins(rng.uniform(0.0, 1.0, 500), correction, episode)
    assert one.median_high - one.median_low > 0.2


def test_fewer_decisions_make_fewer_bins_and_too_few_none():
    sigma, correction, episode = decisions(5.0, episodes=2, steps=50)
    assert len(bins(sigma, correction, episode)) == 4
    assert bins(sigma[:10], correction[:10], episode[:10]) == []


def test_who_states_no_sigma_has_no_cloud():
    assert not len(cloud_of([np.full((5, 2), math.nan)]).sigma)
    assert cloud_of([np.column_stack([np.ones(60), np.zeros(60)])]).bins == ()
