"""Environment steps per second of training: RUDC with five critics against stable-baselines3's SAC.

    python -m tests.benchmarks.training_speed [--steps 8000] [--rounds 2]

Both on `random_destination` with the same observation, hidden layers of 128 x 2, batches of 128, one gradient
step for four decisions, two worlds in processes of their own, filled replays, no evaluation. RUDC trains five
critics with 32 quantiles, priors and targets, and `rudc-t` drives with filter, residual and slack; SAC trains
two critics. Each runs in a process of its own, in turns; ratios are those of the best.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
import time
from pathlib import Path

WARM_UP = 2_000
"""decisions before the clock starts"""


def rudc(steps: int, algorithm: str) -> float:
    """Decisions per second of `rudc train`."""
    from rudc.training.config import TrainConfig
    from rudc.training.trainer import Trainer

    class Quiet:
        """Says nothing, and notes the time at each row of progress."""

        def __init__(self) -> None:
            self.at: list[tuple[int, float]] = []

        def advance(self, steps: int) -> None:
            """Nothing to show."""

        def progress(self, row) -> None:
            """One row."""
            self.at.append((row["steps"], time.perf_counter()))

        def note(self, text: str) -> None:
            """Nothing to say."""

    settings = {
        "steps": WARM_UP + steps,
        "seed_steps": 2_000,
        "log_every": 1_000,
        "checkpoint_every": 10**9,
        "evaluate_every": 10**9,
        "evaluation_episodes": 0,
        "calibration_episodes": 0,
    }
    changes = {f"training.{key}": value for key, value in settings.items()}
    config = TrainConfig.of(algorithm, {"learner.members": 5, **changes})
    watcher = Quiet()
    with tempfile.TemporaryDirectory() as folder:
        Trainer(config, Path(folder), watcher).run()
    (first, start), (last, end) = watcher.at[WARM_UP // 1_000 - 1], watcher.at[-1]
    return (last - first) / (end - start)


def stable_baselines(steps: int) -> float:
    """Decisions per second of SAC."""
    import gymnasium
    import torch
    from stable_baselines3 import SAC
    from stable_baselines3.common.callbacks import BaseCallback
    from stable_baselines3.common.vec_env import SubprocVecEnv

    def make() -> gymnasium.Env:
        import rudc.env  # noqa: F401 registers the environment, in the process of each world

        return gymnasium.make("rudc/Intersection-v0", scenario="random_destination", observation="conflict")

    class Clock(BaseCallback):
        """Notes when the warm-up is over."""

        start = 0.0

        def _on_step(self) -> bool:
            if not self.start and self.num_timesteps >= WARM_UP:
                self.start, self.first = time.perf_counter(), self.num_timesteps
            return True

    torch.set_num_threads(1)
    envs = SubprocVecEnv([make, make], start_method="spawn")
    model = SAC(
        "MlpPolicy",
        envs,
        batch_size=128,
        buffer_size=100_000,
        learning_starts=1_000,
        train_freq=2,
        gradient_steps=1,
        policy_kwargs={"net_arch": [128, 128]},
    )
    clock = Clock()
    model.learn(WARM_UP + steps, callback=clock)
    rate = (model.num_timesteps - clock.first) / (time.perf_counter() - clock.start)
    envs.close()
    return rate


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--steps", type=int, default=8_000)
    parser.add_argument("--rounds", type=int, default=2)
    parser.add_argument("--only", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.only:
        rate = stable_baselines(options.steps) if options.only == "sac" else rudc(options.steps, options.only)
        print(rate)
        return
    rates: dict[str, list[float]] = {"sac": [], "rudc-wo-cbf": [], "rudc-t": []}
    for _ in range(options.rounds):
        for name in rates:
            command = [sys.executable, "-m", "tests.benchmarks.training_speed", "--only", name]
            done = subprocess.run(
                [*command, "--steps", str(options.steps)], capture_output=True, text=True, check=True
            )
            rates[name].append(float(done.stdout.split()[-1]))
    for name, values in rates.items():
        print(f"{name:14s}{max(values):8.0f} decisions/s, {max(values) / max(rates['sac']):.2f} of SAC's")


if __name__ == "__main__":
    main()
