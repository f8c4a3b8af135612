"""Frames of `render_mode="rgb_array"`, 600 x 600 pixels: how many a second of processor time.

python -m tests.benchmarks.frames [--frames N]
"""

import argparse
import time

import gymnasium
import numpy as np

import rudc.env  # noqa: F401  # registers the environment

SCENARIOS = ("dense_left_turn", "blocked_left_turn", "blind_corner", "fog")


def main() -> None:
    """One line a scenario."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=100)
    wanted = parser.parse_args().frames
    for scenario in SCENARIOS:
        env = gymnasium.make("rudc/Intersection-v0", scenario=scenario, render_mode="rgb_array").unwrapped
        drawn, spent, seed = 0, 0.0, 0
        while drawn < wanted:
            env.reset(seed=seed)
            env.render()
            ended, seed = False, seed + 1
            while not ended and drawn < wanted:
                *_, terminated, truncated, _ = env.step(np.array([0.2, 0.0]))
                start = time.process_time()
                env.render()
                spent += time.process_time() - start
                drawn, ended = drawn + 1, terminated or truncated
        env.close()
        print(f"{scenario}: {drawn / spent:.0f} frames/s")


if __name__ == "__main__":
    main()
