"""Stable-baselines3's SAC takes the environment as it is."""

import gymnasium
import numpy as np
import pytest

import rudc.env


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_sac_trains_unchanged():
    baselines = pytest.importorskip("stable_baselines3")
    torch = pytest.importorskip("torch")
    threads = torch.get_num_threads()
    torch.set_num_threads(1)  # many small products: more threads only wait for one another
    env = gymnasium.make(rudc.env.ENV_ID)
    small = {"policy_kwargs": {"net_arch": [32, 32]}, "batch_size": 32, "train_freq": 8, "buffer_size": 5000}
    model = baselines.SAC("MlpPolicy", env, learning_starts=100, seed=0, device="cpu", **small)
    model.learn(300)
    action, _ = model.predict(env.reset(seed=0)[0], deterministic=True)
    assert env.action_space.contains(action.astype(np.float32))
    assert model.num_timesteps >= 300
    env.close()
    torch.set_num_threads(threads)
