"""An algorithm of somebody else's, trained, saved, driven: settings, learner and correction in one file, or
the learner, which imports torch, in a file beside it.
"""

import csv
import os
import sys

import pytest

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
    "learner.policy.hidden=8", "learner.critic.hidden=8",
)  # fmt: skip


SHORT = ("--set", "episode.timeout=5")


@pytest.mark.parametrize("brought", ["by a file", "by a package"])
def test_an_algorithm_of_somebody_else_trains_and_drives(tmp_path, brought):
    if brought == "by a package":
        offer(tmp_path, "[rudc.algorithms]\nmine = own\n")
        (tmp_path / "own_learner.py").write_text(LEARNER, encoding="utf-8")
        own = OWN.replace("LEARNER", '"own_learner:CalmLearner"')
    else:
        own = LEARNER + OWN.replace("LEARNER", 'f"{__name__}:CalmLearner"')
    (tmp_path / "own.py").write_text(own, encoding="utf-8")

    rudc = ("rudc", *(("--import", "own.py") if brought == "by a file" else ()))
    changes = (*SMALL, "learner.bonus=1", "correction.most=-0.9")
    agents = ("-a", "calm", "-a", "calm:correction.kind=none")
    run_apart(
        (*rudc, "train", "calm-sac", *(part for c in changes for part in ("--set", c)), "--out", "calm"),
        (*rudc, "sweep", "random_destination", *agents, "-n", 1, "-w", 1, *SHORT, "-o", "out"),
        folder=tmp_path, PYTHONPATH=os.pathsep.join([str(tmp_path), *sys.path]),
    )  # fmt: skip
    with (tmp_path / "out/episodes.csv").open(newline="") as file:
        calm, bare = csv.DictReader(file)
    assert int(calm["interventions"]) > int(bare["interventions"])
