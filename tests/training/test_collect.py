"""Transitions over several steps against a hand-computed case."""

import numpy as np
import pytest

from rudc.training.collect import StepsAhead, _Taken


def _run(rewards: list[float], *, terminal: bool, last: bool):
    steps = StepsAhead(3, 0.5)
    for k, reward in enumerate(rewards):
        end = k == len(rewards) - 1
        state, after = np.full(2, k, np.float32), np.full(2, k + 1, np.float32)
        taken = _Taken(state, state + 10, state + 20, reward)
        steps.add(taken, after, terminal=terminal and end, last=last and end)
    return steps


def test_n_step_returns_by_hand():
    new = _run([1, 2, 4, 8], terminal=True, last=True).take()
    # 1 + 2/2 + 4/4, 2 + 4/2 + 8/4, 4 + 8/2, 8
    np.testing.assert_array_equal(new.reward, [3, 6, 8, 8])
    np.testing.assert_array_equal(new.discount, [1 / 8, 1 / 8, 1 / 4, 1 / 2])
    np.testing.assert_array_equal(new.observation[:, 0], [0, 1, 2, 3])
    np.testing.assert_array_equal(new.action[:, 0], [10, 11, 12, 13])
    np.testing.assert_array_equal(new.nominal[:, 0], [20, 21, 22, 23])
    np.testing.assert_array_equal(new.next_observation[:, 0], [3, 4, 4, 4])
    np.testing.assert_array_equal(new.terminal, [False, True, True, True])


def test_time_outs_and_breaks_are_bootstrapped():
    ended = _run([1, 2, 4, 8], terminal=False, last=True).take()
    assert not ended.terminal.any()
    assert len(ended.reward) == 4
    broken = _run([1, 2, 4, 8], terminal=False, last=False)
    broken.end(np.full(2, 4, np.float32), terminal=False)
    for name, column in broken.take()._asdict().items():
        np.testing.assert_array_equal(column, getattr(ended, name))


def test_a_running_episode_keeps_its_last_decisions_for_later():
    running = _run([1, 2, 4, 8], terminal=False, last=False)
    assert len(running.take().reward) == 2
    running.end(np.full(2, 4, np.float32), terminal=True)
    assert running.take().terminal.tolist() == [True, True]
    with pytest.raises(ValueError, match="unpack"):
        running.take()
