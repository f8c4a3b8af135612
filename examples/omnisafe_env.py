"""RUDC as a constrained MDP of OmniSafe: its `CMDP` interface, with `info["cost"]` as the cost.

OmniSafe 0.5 asks for pandas 2.0.3 and, through safety-gymnasium, for an older gymnasium and an older Python,
which RUDC's do not go with. So it is run by hand, not by the tests, in an environment of its own that has
RUDC, then `pip install --no-deps omnisafe gymnasium==0.29.1` and what importing it still misses (moviepy,
wandb, seaborn, ...).

    python examples/omnisafe_env.py
"""

import sys
import types
from typing import Any, ClassVar

import gymnasium
import torch

# OmniSafe imports it for environments of its own; it runs on older Pythons only, and is not needed here.
sys.modules["safety_gymnasium"] = types.ModuleType("safety_gymnasium")

import omnisafe  # noqa: E402 -- finds the empty module above
from omnisafe.envs.core import CMDP, env_register  # noqa: E402 -- as above

import rudc  # noqa: E402 -- as above


@env_register
class RudcEnv(CMDP):
    """One environment; OmniSafe's wrappers normalise and scale."""

    _support_envs: ClassVar[list[str]] = ["RudcIntersection-v0"]
    need_auto_reset_wrapper = True
    need_time_limit_wrapper = False  # the scenario's own time limit truncates

    def __init__(self, env_id: str, num_envs: int = 1, device: str = "cpu", **arguments: Any) -> None:
        super().__init__(env_id)
        assert num_envs == 1
        self._num_envs, self._device = num_envs, torch.device(device)
        self._env = gymnasium.make(rudc.ENV_ID, observation="conflict", action="adjustment", **arguments)
        self._observation_space, self._action_space = self._env.observation_space, self._env.action_space

    def reset(self, seed: int | None = None, options: dict[str, Any] | None = None):
        """An observation (n,), and nothing else."""
        observation, _ = self._env.reset(seed=seed, options=options)
        return self._tensor(observation), {}

    def step(self, action: torch.Tensor):
        observation, reward, terminated, truncated, info = self._env.step(action.detach().cpu().numpy())
        values = (self._tensor(value) for value in (observation, reward, info["cost"], terminated, truncated))
        return *values, {"final_observation": self._tensor(observation)}

    @property
    def max_episode_steps(self) -> int:
        return self._env.spec.max_episode_steps

    def set_seed(self, seed: int) -> None:
        self.reset(seed=seed)

    def render(self) -> Any:
        return self._env.render()

    def close(self) -> None:
        self._env.close()

    def _tensor(self, value: Any) -> torch.Tensor:
        return torch.as_tensor(value, dtype=torch.float32, device=self._device)


if __name__ == "__main__":
    settings = {
        "train_cfgs": {"total_steps": 20_000, "vector_env_nums": 1},
        "algo_cfgs": {"steps_per_epoch": 2_000},
        "logger_cfgs": {"use_wandb": False},
    }
    agent = omnisafe.Agent("SACLag", "RudcIntersection-v0", custom_cfgs=settings)
    agent.learn()
