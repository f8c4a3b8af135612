"""TorchRL's GymEnv takes the environment as it is, two in one process, and reads the cost."""

import pytest

import rudc

# Not among what the tests install: its wheels are built for one release of torch each.
torchrl = pytest.importorskip("torchrl.envs")


@pytest.mark.filterwarnings("ignore")
def test_two_environments_and_their_costs():
    from torchrl.envs.libs.gym import default_info_dict_reader
    from torchrl.envs.utils import check_env_specs

    first, second = (torchrl.GymEnv(rudc.ENV_ID, scenario="dense_left_turn") for _ in range(2))
    check_env_specs(first)
    second.set_info_dict_reader(default_info_dict_reader(["cost"]))
    ahead, beside = first.rollout(5), second.rollout(5)
    assert ahead["observation"].shape == beside["observation"].shape == (5, 105)
    assert beside["next", "cost"].shape == (5,)
    assert (beside["next", "cost"] >= 0).all()
    first.close()
    second.close()
