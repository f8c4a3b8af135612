"""A safety filter behind learners of other libraries."""

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from stable_baselines3 import SAC

import rudc
from rudc.errors import InputError
from rudc.world.config import WorldConfig


def _made(correction="cbf", **arguments):
    return rudc.SafetyFilterWrapper(gymnasium.make(rudc.ENV_ID, **arguments), correction)


def test_corrects_what_is_proposed_and_says_so():
    """Full throttle behind traffic: the filter brakes, by more than any action of its kind steers."""
    env = _made({"kind": "cbf", "rule": "ttcbf"}, scenario="dense_left_turn", action="adjustment")
    try:
        env.reset(seed=4)
        seen, ended = [], False
        while not ended:
            _, _, terminated, truncated, info = env.step(np.array([1.0, 0.0], np.float32))
            done = info["correction"]
            np.testing.assert_allclose(info["scene"].last_u, done["u"])
            assert env.action_space.contains(done["action"])
            assert (done["status"] == "nominal") == np.array_equal(done["u"], done["u_rl"])
            seen.append(done["status"])
            ended = terminated or truncated
        assert {"nominal", "solved"} <= set(seen)
        assert info["outcome"] != "collision"
    finally:
        env.close()


@pytest.mark.filterwarnings("ignore:.*different from the unwrapped version:UserWarning")
def test_gymnasium_finds_no_fault_with_it():
    env = _made({"kind": "cbf", "rule": "ttcbf"}, observation="conflict")
    try:
        check_env(env, skip_render_check=True)
        assert env.spec is not None
        assert env.spec.additional_wrappers[-1].kwargs == {"correction": {"kind": "cbf", "rule": "ttcbf"}}
    finally:
        env.close()


def test_trains_with_stable_baselines():
    env = _made({"kind": "cbf", "rule": "ecbf", "residual": True}, observation="conflict")
    try:
        model = SAC("MlpPolicy", env, learning_starts=50, batch_size=32, seed=0, device="cpu")
        model.learn(100)
        action, _ = model.predict(env.reset(seed=0)[0], deterministic=True)
        assert "correction" in env.step(action)[4]
    finally:
        env.close()


@pytest.mark.parametrize(
    ("correction", "said"),
    [
        ("none", "corrects nothing"),
        ("cfb", "did you mean 'cbf'"),
        ({"kind": "cbf", "slack": {"gain": 1}}, "asks the critics for sigma"),
        ({"d_safe": 1.0}, "the mapping has no `kind`; it is one of none, cbf"),
    ],
)
def test_what_cannot_be_is_refused(correction, said):
    env = gymnasium.make(rudc.ENV_ID)
    with pytest.raises(InputError, match=said):
        rudc.SafetyFilterWrapper(env, correction)
    env.close()


def test_a_filter_for_another_decision_length_is_refused():
    slow, fits = WorldConfig(decision_s=0.2), {"kind": "cbf", "dt": 0.2}
    with pytest.raises(InputError, match=r"dt=0\.1 s, but .* holds them for 0\.2 s; give dt=0\.2"):
        _made(config=slow)
    with pytest.raises(InputError, match=r"give dt=0\.1"):
        _made(fits)
    _made(fits, config=slow).close()


def test_other_environments_are_refused():
    env = gymnasium.make("CartPole-v1")
    with pytest.raises(InputError, match="Intersection"):
        rudc.SafetyFilterWrapper(env)
    env.close()


def test_a_second_filter_is_refused():
    env = gymnasium.wrappers.ClipAction(_made())
    with pytest.raises(InputError, match="one stands around this environment already"):
        rudc.SafetyFilterWrapper(env)
    env.close()
