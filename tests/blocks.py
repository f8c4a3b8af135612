"""Code blocks of Markdown files, and how they are run: as their reader would, in an empty folder."""

import os
import re
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

FENCE = re.compile(r'^```(\w+)(?: title="([^"]+)")?\n(.*?)^```', re.M | re.S)
QUICK = " ".join(
    f"--set training.{key}" for key in ("seed_steps=400", "learning_starts=300", "evaluation_episodes=1")
)
LESS = (
    (r"--steps \d+", "--steps 200"),
    (r"--episodes \d+", "--episodes 1"),
    (r"--workers \d+", "--workers 1"),
    (r"--seeds \d+", "--seeds 1"),
    (r"rudc train (rudc-\S+|sac|dsac) ", rf"rudc train \1 {QUICK} "),
    (r"rudc study filter (.*)--agent rudc-t", r"rudc study filter \1--agent gap-acceptance+ttcbf"),
    (r"rudc train (rudc-\S+) ", r"rudc train \1 --set training.calibration_episodes=1 "),
)
"""what is run with smaller numbers, or fewer variants -> which"""


class Block(NamedTuple):
    """A block with its language; blocks without one are not run: output, set-up, what needs a cluster."""

    language: str
    file: str
    """that it is the content of; empty if it is to be run"""
    text: str


def blocks_of(path: Path) -> list[Block]:
    """All with a language, in their order."""
    return [Block(*found) for found in FENCE.findall(path.read_text(encoding="utf-8"))]


def smaller(script: str) -> str:
    """The same command with few steps and episodes."""
    for long, short in LESS:
        script = re.sub(long, short, script)
    return script


def run_script(script: str, folder: Path) -> None:
    """Run a bash block; what fails in it fails."""
    scripts = Path(sys.executable).parent
    _run(
        ["bash", "-euo", "pipefail", "-c", script], folder, PATH=f"{scripts}{os.pathsep}{os.environ['PATH']}"
    )


def run_python(code: str, folder: Path) -> None:
    """Run Python code."""
    _run([sys.executable, "-c", code], folder)


def _run(command: list[str], folder: Path, **more: str) -> None:
    env = {**os.environ, **more}
    run = subprocess.run(command, cwd=folder, env=env, capture_output=True, text=True, check=False)
    assert run.returncode == 0, f"{command[-1]}\n{run.stdout}\n{run.stderr}"
