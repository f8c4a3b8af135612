"""Training with stable-baselines3, and its result in a sweep. Needs `pip install stable-baselines3`.

    python examples/sb3_agent.py --steps 20000 --out out/sac
    rudc sweep dense_left_turn --agent "examples/sb3_agent.py:Sb3Agent(path='out/sac/best_model.zip')" \\
        --agent rudc-t --episodes 4 --out out/sb3

Training and evaluation take an environment each; the second runs its SUMO in a process of its own.
"""

import argparse
from pathlib import Path

import gymnasium

import rudc  # registers the environment
from rudc.env.action import read_action
from rudc.env.observation import observe_flat

OBSERVATION, ACTION = "conflict", "adjustment"
"""what the policy sees, and what its actions mean: the same in training and in sweeps"""


class Sb3Agent:
    """A policy trained with stable-baselines3."""

    def __init__(self, path: str, algorithm: str = "SAC") -> None:
        import stable_baselines3

        self.model = getattr(stable_baselines3, algorithm).load(path, device="cpu")
        self.action = read_action(ACTION)

    def reset(self, scene, seed):
        """Nothing to prepare."""

    def act(self, scene):
        """The policy's mean, in m/s2 and rad."""
        action, _ = self.model.predict(observe_flat(scene, OBSERVATION), deterministic=True)
        return self.action.physical(action, scene)


def train(steps: int, out: Path, every: int, episodes: int, scenario: str = "dense_left_turn") -> Path:
    """Train SAC, and keep the model that did best in evaluations, without any the last; its file."""
    from stable_baselines3 import SAC
    from stable_baselines3.common.callbacks import EvalCallback
    from stable_baselines3.common.monitor import Monitor

    def make():
        return Monitor(gymnasium.make(rudc.ENV_ID, scenario=scenario, observation=OBSERVATION, action=ACTION))

    judge = EvalCallback(
        make(), eval_freq=every, n_eval_episodes=episodes, best_model_save_path=str(out), verbose=0
    )
    model = SAC("MlpPolicy", make(), learning_starts=min(500, steps // 2), train_freq=4, seed=0, device="cpu")
    model.learn(steps, callback=judge)
    best = out / "best_model.zip"
    if not best.is_file():  # it ended before the first evaluation
        model.save(best)
    judge.eval_env.close()
    model.get_env().close()
    return best


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--steps", type=int, default=20_000)
    parser.add_argument("--out", type=Path, default=Path("out/sac"))
    parser.add_argument("--every", type=int, default=2000, help="steps between two evaluations")
    parser.add_argument("--episodes", type=int, default=10, help="in each evaluation")
    arguments = parser.parse_args()
    print(train(arguments.steps, arguments.out, arguments.every, arguments.episodes))
