"""Algorithms of somebody else's, trained, saved, driven: settings, learner and correction in one file, or the
learner, which imports torch, in a file beside it.
"""

import csv
import os
import sys

from tests.blocks import run_apart
from tests.offering import offer

OWN = """
from typing import Literal
import numpy as np
from rudc import register_algorithm
from rudc.agents.of_actions import OfActions
from rudc.agents.seat import ADJUSTMENT, CorrectionKind
from rudc.learning.algorithms import Algorithm
from rudc.learning.config import LearnerConfig


class CalmConfig(LearnerConfig):
    bonus: float = 0.5


class Calm(CorrectionKind):
    kind: Literal["calm"] = "calm"
    most: float = 0.5

    def make(self, arrays, percentiles=None, action=ADJUSTMENT):
        return Calmed(self.most, action)


class Calmed(OfActions):
    def __init__(self, most, action):
        super().__init__(action)
        self.most = most

    def instead(self, scene, observation, action, critics):
        calm = np.array([self.most, action[1]], np.float32)
        return None if action[0] <= self.most else (calm, "calmed", False)


here = f"{__name__}:"
register_algorithm("calm-sac", Algorithm(
    "Mine.", LEARNER, CalmConfig, {"correction": {"kind": "calm"}}, corrections={"calm": here + "Calm"},
))
"""
LEARNER = """
from rudc.learning.sac import SacLearner


class CalmLearner(SacLearner):
    pass
"""
SMALL = (
    "training.steps=50", "training.seed_steps=50", "training.learning_starts=16", "training.envs=1",
    "training.round_decisions=25", "training.evaluation_episodes=0", "learner.batch_size=16",
    "learner.policy.hidden=8", "learner.critic.hidden=8", "training.curriculum=null",
    "training.filtered_share=1",
)  # fmt: skip


SHORT = ("--set", "episode.timeout=5")


def test_algorithms_of_somebody_else_train_and_drive(tmp_path):
    """One by a package, one by a file; each drives beside itself without its correction."""
    offer(tmp_path, "[rudc.algorithms]\nmine = own\n")
    (tmp_path / "own_learner.py").write_text(LEARNER, encoding="utf-8")
    (tmp_path / "own.py").write_text(OWN.replace("LEARNER", '"own_learner:CalmLearner"'), encoding="utf-8")
    other = LEARNER + OWN.replace("LEARNER", 'f"{__name__}:CalmLearner"').replace('"calm', '"mild')
    (tmp_path / "other.py").write_text(other, encoding="utf-8")

    file, changes = ("--import", "other.py"), (*SMALL, "learner.bonus=1", "correction.most=-0.9")
    settings = [part for change in changes for part in ("--set", change)]
    drivers = ("calm", "calm:correction.kind=none", "mild", "mild:correction.kind=none")
    agents = [part for driver in drivers for part in ("-a", driver)]
    run_apart(
        ("rudc", "train", "calm-sac", *settings, "--out", "calm"),
        ("rudc", *file, "train", "mild-sac", *settings, "--out", "mild"),
        ("rudc", *file, "sweep", "random_destination", *agents, "-n", 1, "-w", 1, *SHORT, "-o", "out"),
        folder=tmp_path, PYTHONPATH=os.pathsep.join([str(tmp_path), *sys.path]),
    )  # fmt: skip
    with (tmp_path / "out/episodes.csv").open(newline="") as file:
        steps = {row["agent"]: int(row["interventions"]) for row in csv.DictReader(file)}
    assert steps["calm"] > steps["calm:correction.kind=none"]
    assert steps["mild"] > steps["mild:correction.kind=none"]
