"""What each choice of the default training is worth: every one of them switched off once.

    python -m tests.benchmarks.switches --out DIR [--steps 30000] [--episodes 200] [--only NAME]...

Each variant trains `rudc-t` with one value of the default configuration changed (one seed, fewer steps than
what ships) and is measured on both tasks. The default is also trained from two other seeds: what differs less
than those do is chance. Trainings and the sweep lie in DIR and are resumed; DIR/switches.md is the table. Two
trainings run at a time.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pandas as pd

SWITCHES: dict[str, tuple[str, ...]] = {
    "default": (),
    "default, seed 1": ("training.seed=1",),
    "default, seed 2": ("training.seed=2",),
    "paper's observation": ("observation=paper",),
    "steering chosen directly": ("action.kind=direct",),
    "all vehicles constrained": ("correction.constrained=all",),
    "filter in every episode": ("training.filtered_share=1",),
    "filter in every episode, proposals replayed": (
        "training.filtered_share=1",
        "learner.learns_from=proposed",
    ),
    "no last resort": ("correction.last_resort=false",),
    "filter may accelerate": ("correction.max_added_acceleration=.inf",),
    "no residual": ("correction.residual=false",),
    "no slack": ("correction.slack.gain=0",),
    "expectation for CVaR": ("learner.distortion=expectation",),
    "one-step returns": ("learner.n_step=1",),
    "no reference driver first": ("training.seed_steps=0",),
    "no curriculum": ("training.curriculum=null",),
    "collisions at -50": ("training.collision_reward=-50",),
    "attention": ("learner.policy.encoder=attention", "learner.critic.encoder=attention"),
    "five critics": ("learner.members=5",),
}
"""variant -> what is changed"""
TASKS = ("random_destination", "dense_left_turn")


def rudc(*arguments: object) -> None:
    """Run the command line, and stop where it fails."""
    subprocess.run([sys.executable, "-m", "rudc", *map(str, arguments)], check=True)


def folder(out: Path, name: str) -> Path:
    """Where a variant is trained."""
    return out / name.replace("'", "").replace(",", "").replace(" ", "-")


def train(out: Path, name: str, steps: int) -> None:
    """Train one variant."""
    changes = [part for change in SWITCHES[name] for part in ("--set", change)]
    quiet = ("--set", "training.evaluation_episodes=0")
    rudc("train", "rudc-t", "--steps", steps, *changes, *quiet, "--out", folder(out, name), "--resume")


def main() -> None:
    """Train, measure, print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--steps", type=int, default=30_000)
    parser.add_argument("--episodes", type=int, default=200)
    parser.add_argument("--only", action="append", choices=list(SWITCHES))
    options = parser.parse_args()
    names = options.only or list(SWITCHES)
    with ThreadPoolExecutor(2) as pool:
        list(pool.map(lambda name: train(options.out, name, options.steps), names))
    agents = [part for name in names for part in ("--agent", folder(options.out, name))]
    sweep = options.out / "sweep"
    rudc("sweep", *TASKS, *agents, "--episodes", options.episodes, "--out", sweep, "--resume")
    rows = pd.read_csv(sweep / "metrics.csv").set_index(["agent", "scenario"])
    lines = [
        "| switched | " + " | ".join(f"{task}: SR / FR / VR (%), AES (m/s)" for task in TASKS) + " |",
        "|---|---|---|",
    ]
    for name in names:
        cells = [rows.loc[(str(folder(options.out, name)), task)] for task in TASKS]
        shown = [
            " / ".join(f"{row[f'{rate}_mean']:.1f}" for rate in ("SR", "FR", "VR"))
            + f", {row['AES_mean']:.1f}"
            for row in cells
        ]
        lines.append(f"| {name} | {' | '.join(shown)} |")
    (options.out / "switches.md").write_text("\n".join(lines) + "\n", encoding="utf-8")
    print("\n".join(lines))


if __name__ == "__main__":
    main()
