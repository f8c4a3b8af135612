"""The replay and n-step transitions: what is stored, drawn, forgotten, saved."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rudc.errors import InputError
from rudc.learning.config import ObservationLayout, Problem
from rudc.learning.nstep import NStep, Transition
from rudc.learning.replay import Replay

LAYOUT = ObservationLayout(ego=3, vehicles=0, waypoints=0, task=0)
PROBLEM = Problem(LAYOUT, seed=1)


def transition(i: int) -> Transition:
    """One that tells its number everywhere."""
    return Transition(
        observation=np.full(3, i, np.float32),
        executed=np.full(2, 0.01 * i, np.float32),
        proposed=np.full(2, -0.01 * i, np.float32),
        reward=float(i),
        cost=2.0 * i,
        discount=0.9,
        next_observation=np.full(3, i + 0.5, np.float32),
        terminal=i % 3 == 0,
    )


def filled(count: int, capacity: int = 8, probability: float = 0.9) -> Replay:
    replay = Replay(PROBLEM, capacity, masks=4, probability=probability)
    for i in range(count):
        replay.add(transition(i))
    return replay


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"reward": np.zeros(2, np.float32)}, "holds 2 of reward, not 5"),
        ({"reward": np.zeros(20, np.float32)}, "holds 20 of reward, not 5"),
        ({"state": np.array("[]")}, "is not a saved replay"),
        ({"state": np.array('{"capacity": 8}')}, "is not a saved replay"),
        ({"state": np.array('{"capacity": 8, "stored": 5, "generator": 3}')}, "is not a saved replay"),
    ],
)
def test_a_damaged_file_is_refused_and_changes_nothing(tmp_path, changes, said):
    filled(5).save(tmp_path / "replay.npz")
    with np.load(tmp_path / "replay.npz") as saved:
        arrays = {**saved, **changes}
    np.savez(tmp_path / "replay.npz", **arrays)
    replay, same = filled(3), filled(3)
    with pytest.raises(InputError, match=rf"replay\.npz: {said}"):
        replay.load(tmp_path / "replay.npz")
    assert np.array_equal(replay.sample(9).reward, same.sample(9).reward)


def test_the_last_ones_are_kept_whole() -> None:
    replay = filled(21)
    assert len(replay) == 8
    batch = replay.sample(400)
    number = batch.reward
    assert set(number.tolist()) == set(range(13, 21))
    assert np.array_equal(batch.observation, np.repeat(number[:, None], 3, axis=1))
    assert np.array_equal(batch.next_observation[:, 0], number + 0.5)
    assert batch.executed[:, 1] == pytest.approx(0.01 * number)
    assert batch.proposed[:, 1] == pytest.approx(-0.01 * number)
    assert np.array_equal(batch.terminal, number % 3 == 0)
    assert batch.discount == pytest.approx(0.9)
    assert batch.cost == pytest.approx(2 * number)
    assert replay.first(3).reward.tolist() == [13, 14, 15]


def test_masks_stay_with_their_transition() -> None:
    batch = filled(8).sample(300)
    for i in range(8):
        masks = batch.mask[batch.reward == i]
        assert len(masks) > 0
        assert (masks == masks[0]).all()


def test_masks_are_as_frequent_as_configured() -> None:
    replay = filled(3000, 3000, 0.7)
    assert replay.sample(3000).mask.mean() == pytest.approx(0.7, abs=0.03)


def test_learners_without_masks_have_none() -> None:
    replay = Replay(PROBLEM, 8)
    replay.add(transition(1))
    batch = replay.sample(3)
    assert batch.mask.shape == (3, 0)
    assert np.array_equal(batch.action("executed"), batch.executed)
    assert np.array_equal(batch.action("proposed"), batch.proposed)


def test_a_saved_replay_goes_on_as_if_never_stopped(tmp_path: Path) -> None:
    one = filled(11)
    one.sample(5)
    one.save(tmp_path / "replay.npz")
    two = Replay(replace(PROBLEM, seed=99), 8, 4, 0.9)
    two.load(tmp_path / "replay.npz")
    for replay in (one, two):
        replay.add(transition(11))
    for ours, theirs in zip(one.sample(50), two.sample(50), strict=True):
        assert np.array_equal(ours, theirs)
    assert [file.name for file in tmp_path.iterdir()] == ["replay.npz"]


def test_a_damaged_file_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "replay.npz"
    filled(5).save(path)
    whole = path.read_bytes()
    other_method = whole.replace(b"PK\x01\x02\x2d\x03\x2d\0\0\0\0\0", b"PK\x01\x02\x2d\x03\x2d\0\0\0\x63\0")
    assert other_method != whole
    for damaged in (b"", whole[:100], whole[:-1], whole[:100] + bytes(100) + whole[200:], other_method):
        path.write_bytes(damaged)
        with pytest.raises(InputError, match="is not a saved replay"):
            filled(5).load(path)


def test_what_does_not_fit_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "replay.npz"
    filled(5).save(path)
    with pytest.raises(InputError, match="holds 8 transitions, not 9"):
        Replay(PROBLEM, 9, 4).load(path)
    other = Problem(replace(LAYOUT, ego=4))
    with pytest.raises(InputError, match="observation has shape"):
        Replay(other, 8, 4).load(path)
    path.write_bytes(b"nothing")
    with pytest.raises(InputError, match="not a saved replay"):
        Replay(PROBLEM, 8, 4).load(path)
    with pytest.raises(InputError, match="empty"):
        Replay(PROBLEM, 8, 4).sample(1)


def episode(steps: int, rewards: list[float], *, terminal: bool, truncated: bool) -> list[Transition]:
    """Transitions of one episode whose states are numbered from 0."""
    collector = NStep(steps, 0.5)
    result = []
    for t, reward in enumerate(rewards):
        last = t == len(rewards) - 1
        state, after = np.full(3, t, np.float32), np.full(3, t + 1, np.float32)
        action = np.zeros(2, np.float32)
        result += collector.add(
            state,
            action,
            action,
            reward,
            2 * reward,
            after,
            terminal=terminal and last,
            truncated=truncated and last,
        )
    return result


def test_three_steps_by_hand() -> None:
    result = episode(3, [1.0, 2.0, 4.0, 8.0], terminal=True, truncated=False)
    assert [t.reward for t in result] == [1 + 1 + 1, 2 + 2 + 2, 4 + 4, 8]
    assert [t.cost for t in result] == [2 * t.reward for t in result]
    assert [t.discount for t in result] == [0.125, 0.125, 0.25, 0.5]
    assert [t.next_observation[0] for t in result] == [3, 4, 4, 4]
    assert [t.terminal for t in result] == [False, True, True, True]


def test_a_time_out_is_not_terminal() -> None:
    result = episode(3, [1.0, 2.0, 4.0, 8.0], terminal=False, truncated=True)
    assert [t.reward for t in result] == [3, 6, 8, 8]
    assert [t.next_observation[0] for t in result] == [3, 4, 4, 4]
    assert not any(t.terminal for t in result)


@given(
    st.integers(1, 5),
    st.lists(st.floats(-10, 10, width=32), min_size=1, max_size=12),
    st.booleans(),
    st.floats(-50, 50),
)
def test_values_agree_with_the_whole_return(
    steps: int, rewards: list[float], terminal: bool, final: float
) -> None:
    """Where every state's value is its true return, reward + discount * value gives that return again."""
    value = [0.0 if terminal else final]
    for reward in reversed(rewards):
        value.insert(0, reward + 0.5 * value[0])
    result = episode(steps, rewards, terminal=terminal, truncated=not terminal)
    assert [t.observation[0] for t in result] == list(range(len(rewards)))
    for t, one in enumerate(result):
        then = 0.0 if one.terminal else value[int(one.next_observation[0])]
        assert one.reward + one.discount * then == pytest.approx(value[t], abs=1e-9)


def test_episodes_do_not_run_into_each_other() -> None:
    collector = NStep(3, 0.5)
    state, action = np.zeros(3, np.float32), np.zeros(2, np.float32)
    assert collector.add(state, action, action, 100.0, 1.0, state, terminal=False) == []
    collector.clear()
    (only,) = collector.add(state, action, action, 1.0, 0.0, state, terminal=True)
    assert only.reward == 1.0
