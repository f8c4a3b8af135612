"""Sensitivity studies: which trainings are wanted and what is said of them; test_quick.py trains
and drives."""

import shutil
from pathlib import Path

import pytest

from rudc.data import data_folder
from rudc.errors import InputError
from rudc.evaluation.store import read_table
from rudc.evaluation.sweep import Silent
from rudc.studies import base, sensitivity
from rudc.studies.base import Order
from rudc.studies.catalogue import STUDIES
from rudc.studies.sensitivity import BETA, ENSEMBLE, critics_ms, study_of, weights
from rudc.studies.trained import Trained, Wanted
from rudc.training.config import TrainConfig
from tests.studies.test_trained import TINIER


@pytest.fixture
def small(monkeypatch):
    """One task, two values, trainings of seconds."""
    monkeypatch.setattr("rudc.evaluation.manifest.code_version", lambda: "v0")
    monkeypatch.setattr(base, "IN_DISTRIBUTION", ("dense_left_turn",))
    monkeypatch.setattr(sensitivity, "TRAINING", {"quick": TINIER, "full": TINIER})
    monkeypatch.setattr(sensitivity, "ASKED", 5)


def test_a_training_at_the_usual_value_is_the_algorithm_itself():
    assert BETA.wanted(0.25) == Wanted("rudc-t", "rudc-t")
    assert BETA.wanted(1.0) == Wanted("rudc-t-beta1", "rudc-t", {"learner.beta": 1.0})
    assert ENSEMBLE.wanted(3).name == "rudc-t-members3"


@pytest.mark.parametrize("budget", sensitivity.TRAINING)
@pytest.mark.parametrize("swept", [BETA, ENSEMBLE], ids=lambda swept: swept.short)
def test_every_training_has_settings_that_work(swept, budget):
    for value in swept.values[budget]:
        TrainConfig.of("rudc-t", {**sensitivity.TRAINING[budget], **swept.wanted(value).changes})


def test_weights_are_those_of_policy_critics_and_priors():
    folder = data_folder("results/checkpoints") / "rudc-t"
    shipped = Trained("rudc-t", 0, "rudc-t", Path(folder), 100_000)
    small = Trained("rudc-wo-cbf", 0, "sac", Path(folder), 100_000)
    assert weights(shipped) > 5 * weights(small)
    assert critics_ms(shipped) > 0.0


def test_trainings_made_before_are_taken_and_the_others_said_to_be_missing(tmp_path, small):
    shutil.copytree(data_folder("results/checkpoints") / "rudc-t", tmp_path / "rudc-t-seed0")
    order = Order(tmp_path / "out", trainings=tmp_path, episodes=1)
    report = STUDIES["sensitivity-beta"].run(order, lambda _: Silent())
    assert [note for note in report.notes if "rudc-t-beta0.1-seed0: no training" in note]
    (task, both) = read_table(tmp_path / "out" / "sensitivity_beta.csv")
    assert (task["beta"], task["scenario"], both["scenario"]) == ("0.25", "dense_left_turn", "both tasks")
    assert task["steps"] == "100000"
    none = Order(tmp_path / "x", trainings=tmp_path / "out", budget="quick")
    with pytest.raises(InputError, match="no training to drive with"):
        study_of(ENSEMBLE)(none, lambda _: Silent())
