"""Every algorithm trained twice with one seed: the same weights and curves, and how long it takes.

    python -m tests.benchmarks.train_each --out DIR [--steps 2000] [--only NAME]...

The settings are the default ones, but for the number of decisions, a short start by the reference driver and
few episodes for evaluation and calibration. Prints a line for each algorithm; the exit status says whether
all came out the same. tests/training/test_trainer.py does this with 200 decisions and small networks.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pandas as pd
from safetensors.numpy import load_file

from rudc.learning.algorithms import ALGORITHMS
from rudc.training.config import TrainConfig

SHORT = {
    "training.seed_steps": 600,
    "training.learning_starts": 500,
    "training.evaluate_every": 2000,
    "training.evaluation_episodes": 1,
}
"""settings of all, and of those that state sigma the next"""
CALIBRATED = {"training.calibration_episodes": 1}


def train(name: str, folder: Path, steps: int) -> float:
    """Train one; seconds."""
    settings = SHORT | (CALIBRATED if "sigma" in TrainConfig.of(name).learner.offers else {})
    command = [sys.executable, "-m", "rudc", "train", name, "--steps", str(steps), "--out", str(folder)]
    start = time.perf_counter()
    subprocess.run(
        [*command, *(f"--set={key}={value}" for key, value in settings.items())],
        check=True,
        stderr=subprocess.DEVNULL,
    )
    return time.perf_counter() - start


def differences(one: Path, other: Path) -> list[str]:
    """What two trainings have otherwise: arrays and curves."""
    arrays = [load_file(folder / "checkpoint" / "agent.safetensors") for folder in (one, other)]
    found = [key for key in arrays[0] if not np.array_equal(arrays[0][key], arrays[1].get(key))]
    for name in ("progress.csv", "evaluation.csv"):
        curves = [
            pd.read_csv(folder / name).drop(columns="wall_s", errors="ignore") for folder in (one, other)
        ]
        found += [] if curves[0].equals(curves[1]) else [name]
    return found


def main() -> int:
    """Train all, or those named."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--steps", type=int, default=2000)
    parser.add_argument("--only", action="append", choices=list(ALGORITHMS), default=[])
    given = parser.parse_args()
    failed = 0
    for name in given.only or ALGORITHMS:
        folders = [given.out / f"{name}-{k}" for k in (1, 2)]
        seconds = [train(name, folder, given.steps) for folder in folders]
        other = differences(*folders)
        failed |= bool(other)
        said = f"DIFFERENT: {', '.join(other)}" if other else "the same"
        print(f"{name:<16} {seconds[0]:6.1f} s {seconds[1]:6.1f} s   {said}", flush=True)
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
