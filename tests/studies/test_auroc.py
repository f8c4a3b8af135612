"""AUROC against pairs counted one by one; its bootstrap against drawing the episodes' decisions for real."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rudc.studies.auroc import auroc, auroc_draws, percentile_interval


def by_pairs(scores, positive) -> float:
    """Every positive against every negative."""
    pairs = [(s > t) + 0.5 * (s == t) for s in scores[positive] for t in scores[~positive]]
    return sum(pairs) / len(pairs) if pairs else math.nan


@given(st.lists(st.tuples(st.integers(0, 6), st.booleans()), min_size=1, max_size=40))
def test_ranks_count_pairs(decisions):
    scores = np.array([score for score, _ in decisions], dtype=float)
    positive = np.array([flag for _, flag in decisions])
    assert auroc(scores, positive) == pytest.approx(by_pairs(scores, positive), nan_ok=True)


def test_what_is_known():
    flags = np.array([False, False, True, True])
    assert auroc(np.array([1.0, 2.0, 3.0, 4.0]), flags) == 1.0
    assert auroc(np.array([4.0, 3.0, 2.0, 1.0]), flags) == 0.0
    assert auroc(np.ones(4), flags) == 0.5
    assert math.isnan(auroc(np.ones(4), np.ones(4, dtype=bool)))


def drives(rng, episodes: int = 12):
    """Decisions of episodes of two scenarios, with ties and positives in some."""
    lengths = rng.integers(3, 9, size=episodes)
    episode = np.repeat(np.arange(episodes), lengths)
    scores = rng.integers(0, 8, size=len(episode)).astype(float)
    return scores, rng.random(len(episode)) < 0.4, episode, np.arange(episodes) % 2


def test_draws_are_those_of_episodes_taken_with_replacement():
    scores, positive, episode, stratum = drives(np.random.default_rng(5))
    found = auroc_draws(scores, positive, episode, stratum, resamples=20, seed=3)
    rng = np.random.default_rng(3)
    groups = [np.flatnonzero(stratum == value) for value in (0, 1)]
    drawn = np.hstack([inside[rng.integers(len(inside), size=(20, len(inside)))] for inside in groups])
    for value, taken in zip(found, drawn, strict=True):
        rows = np.concatenate([np.flatnonzero(episode == e) for e in taken])
        assert value == pytest.approx(by_pairs(scores[rows], positive[rows]))


def test_draws_depend_on_the_seed_and_not_on_the_order_of_decisions():
    scores, positive, episode, stratum = drives(np.random.default_rng(1))
    first = auroc_draws(scores, positive, episode, stratum, resamples=50)
    mixed = np.random.default_rng(2).permutation(len(scores))
    again = auroc_draws(scores[mixed], positive[mixed], episode[mixed], stratum, resamples=50)
    np.testing.assert_allclose(first, again)
    assert not np.allclose(first, auroc_draws(scores, positive, episode, stratum, resamples=50, seed=9))


def test_repeating_an_episodes_decisions_does_not_narrow_the_interval():
    rng = np.random.default_rng(0)
    level = rng.normal(size=30) + (np.arange(30) % 2)
    widths = []
    for length in (1, 50):
        episode = np.repeat(np.arange(30), length)
        flags = episode % 2 == 1
        value = auroc(level[episode], flags)
        found = percentile_interval(value, auroc_draws(level[episode], flags, episode, np.arange(30) % 2))
        assert found.low < value < found.high
        widths.append(found.high - found.low)
    assert widths[0] == pytest.approx(widths[1])


def test_many_scores_are_grouped_without_harm(monkeypatch):
    rng = np.random.default_rng(4)
    episode = np.repeat(np.arange(40), 200)
    scores = rng.normal(size=len(episode)) + np.repeat(rng.normal(size=40), 200)
    flags = rng.random(len(episode)) < 1 / (1 + np.exp(-scores))
    grouped = auroc_draws(scores, flags, episode, np.zeros(40, dtype=int), resamples=30)
    monkeypatch.setattr("rudc.studies.auroc.BINS", len(scores))
    exact = auroc_draws(scores, flags, episode, np.zeros(40, dtype=int), resamples=30)
    assert np.abs(grouped - exact).max() < 1 / 1024
    assert np.ptp(exact) > 0.01


def test_no_interval_where_draws_are_often_undefined():
    draws = np.array([0.5] * 8 + [math.nan] * 2)
    assert math.isnan(percentile_interval(0.5, draws).low)
