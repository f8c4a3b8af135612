"""Algorithms of somebody else's, trained, saved, driven: settings, learner and correction in one file, or the
learner, which imports torch, in a file beside it.
"""

import csv
import os
import sys
from types import SimpleNamespace

import pytest

from rudc.errors import PartFailedError
from rudc.learning.guarded import GuardedLearner
from rudc.learning.learner import Statistics
from tests.blocks import answers_apart, run_apart
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


FAILS = """
from rudc import register_algorithm
from rudc.learning.algorithms import Algorithm
from rudc.learning.config import LearnerConfig

PLACES = {
    "raises": "fails:Raises", "answers": "fails:Answers", "unmade": "fails:Unmade", "misspelt": "fails:Raise",
    "missing": "failz:Raises", "broken": "breaks:Raises", "vague": "fails",
}
for name, place in PLACES.items():
    register_algorithm(name, Algorithm("Mine.", place, LearnerConfig))
register_algorithm("unsettled", Algorithm("Mine.", "fails:Raises", "fails:Settings"))
"""
LEARNERS = """
from rudc.learning.sac import SacLearner


class Raises(SacLearner):
    def update(self, batch):
        if self.updates == 13:
            raise KeyError("gain")
        return super().update(batch)


class Answers(SacLearner):
    def update(self, batch):
        super().update(batch)


class Unmade(SacLearner):
    def __init__(self, config, problem, device):
        raise ValueError("no such network")
"""


def test_what_is_wrong_with_a_learner_of_somebody_elses_is_said_in_a_line(tmp_path):
    """One that is not there is refused before there is a folder."""
    files = {"own.py": FAILS, "fails.py": LEARNERS, "breaks.py": "import nowhere\n"}
    for name, text in files.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    settings = [part for change in SMALL[:-1] for part in ("--set", change)]
    on = "; --resume is for unchanged code"
    wanted = {
        "misspelt": (2, "the module fails has no 'Raise' (did you mean 'Raises'?)"),
        "missing": (2, "there is no module 'failz'"),
        "vague": (2, "'fails' is no place `module:Class`"),
        "broken": (2, "breaks cannot be imported: "
                      "ModuleNotFoundError: No module named 'nowhere' (breaks.py:1)"),
        "unmade": (1, "__init__ raised ValueError: no such network (fails.py:19)"),
        "answers": (1, "update answered None; expected a `Statistics` of numbers; "
                       f"there is no checkpoint yet, so --resume begins anew{on}"),
        "raises": (1, "update raised KeyError: 'gain' (fails.py:8); "
                      f"the last checkpoint is kept in raises/checkpoint{on}"),
        "unsettled": (2, "the module fails has no 'Settings'"),
    }  # fmt: skip
    who = {name: f"learner of algorithm {name}" for name in wanted} | {
        "answers": "learner of algorithm answers at step 0",
        "raises": "learner of algorithm raises at step 25",
        "unsettled": "settings fails:Settings",
    }
    answers = answers_apart(
        *(("--import", "own.py", "train", name, *settings, "--out", name) for name in wanted),
        folder=tmp_path, PYTHONPATH=os.pathsep.join([str(tmp_path), *sys.path]),
    )  # fmt: skip
    said = {name: (a.status, a.err.splitlines()[-1]) for name, a in zip(wanted, answers, strict=True)}
    assert said == {name: (status, f"error: {who[name]}: {line}") for name, (status, line) in wanted.items()}
    assert not any("Traceback" in answer.err for answer in answers)
    assert not any((tmp_path / name).exists() for name, (status, _) in wanted.items() if status == 2)
    assert (tmp_path / "raises/checkpoint/training.json").exists()


@pytest.mark.parametrize(
    ("has", "told"),
    [
        ({"statistics": None, "masks": (0, 1.0)}, "its statistics is None; expected a subclass of"),
        ({"statistics": Statistics, "masks": None}, "its masks is None; expected a pair"),
    ],
)
def test_what_a_learner_declares_is_looked_at(has, told):
    with pytest.raises(PartFailedError, match=f"learner of algorithm mine: {told}"):
        GuardedLearner(lambda: SimpleNamespace(**has), "mine", str)  # pyright: ignore[reportArgumentType]
