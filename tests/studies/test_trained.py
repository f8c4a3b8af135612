"""Trainings are taken where there are such, and made where there are none."""

import json
import shutil
from pathlib import Path

import pytest

from rudc.agents.registry import make_agent
from rudc.data import data_folder
from rudc.errors import InputError
from rudc.studies.base import Order
from rudc.studies.trained import Wanted, trainings_for, trainings_there

SHIPPED = data_folder("results/checkpoints")
STEPS = {"training.steps": 100_000}
TINY = {
    "training.steps": 200,
    "training.seed_steps": 100,
    "training.learning_starts": 16,
    "training.round_decisions": 25,
    "training.evaluation_episodes": 0,
    "training.calibration_episodes": 0,
    "training.curriculum": None,
    "learner.batch_size": 16,
}
TINIER = {**TINY, "training.steps": 50, "training.seed_steps": 50}


def said(_: str) -> None:
    """Nobody listens."""


def test_of_a_folder_that_was_named_only_its_trainings_count(tmp_path):
    """Neither is a shipped one taken for what is missing there, nor one made."""
    shutil.copytree(SHIPPED / "rudc-t-seed1", tmp_path / "rudc-t-seed1")
    order = Order(tmp_path / "out", trainings=tmp_path)
    wanted = [Wanted("rudc-t", "rudc-t"), Wanted("beta", "rudc-t", {"learner.beta": 0.5})]
    found = trainings_for(wanted, (0, 1, 7), order, STEPS, said)
    assert [(t.agent, t.seed, t.steps) for t in found.of("rudc-t")] == [
        ("./rudc-t-seed1", 1, 100_000),
    ]
    names = ("rudc-t-seed0", "rudc-t-seed7", *(f"beta-seed{n}" for n in (0, 1, 7)))
    assert found.missing == tuple(f"{name}: no training there" for name in names)
    with found.named_from():
        make_agent("./rudc-t-seed1:outlook.course=false")
    assert not (tmp_path / "out").exists()


def test_one_that_is_not_at_its_end_is_named_with_how_far_it_is(tmp_path):
    """And no shipped one takes its place."""
    shutil.copytree(SHIPPED / "sac", tmp_path / "sac-seed0")
    file = tmp_path / "sac-seed0" / "agent.json"
    stored = json.loads(file.read_text(encoding="utf-8"))
    stored["trained"]["steps"] = 40_000
    file.write_text(json.dumps(stored), encoding="utf-8")
    order = Order(tmp_path / "out", trainings=tmp_path)
    found = trainings_for([Wanted("sac", "sac")], (0,), order, STEPS, said)
    assert (found.found, found.missing) == ((), ("sac-seed0: trained for 40000 of 100000 steps so far",))


def test_a_shipped_one_that_learnt_with_other_settings_is_not_taken(tmp_path, monkeypatch):
    monkeypatch.setattr(
        "rudc.studies.trained.shipped_checkpoints", lambda: {"rudc-t": SHIPPED / "rudc-t-paper"}
    )
    found = trainings_there([(Wanted("rudc-t", "rudc-t"), 0)], Order(tmp_path / "out"), STEPS)
    assert "no longer the default" in found.missing[0]


def test_a_training_that_is_another_is_refused(tmp_path):
    shutil.copytree(SHIPPED / "rudc-t-seed1", tmp_path / "rudc-t-seed0")
    order = Order(tmp_path / "out", trainings=tmp_path)
    with pytest.raises(InputError, match="rudc-t with seed 1, not by rudc-t with seed 0"):
        trainings_for([Wanted("rudc-t", "rudc-t")], (0,), order, STEPS, said)
    with pytest.raises(InputError, match="no folder"):
        trainings_for([], (0,), Order(tmp_path, trainings=tmp_path / "nowhere"), STEPS, said)
    shutil.copytree(SHIPPED / "rudc-t", tmp_path / "beta-seed0")
    with pytest.raises(InputError, match=r"learner.beta=0.25, not 0.5"):
        trainings_for([Wanted("beta", "rudc-t", {"learner.beta": 0.5})], (0,), order, STEPS, said)
    shutil.copytree(SHIPPED / "rudc-t", tmp_path / "as-written-seed0")
    with pytest.raises(InputError, match="observation=conflict, not paper"):
        trainings_for([Wanted("as-written", "rudc-t", configuration="paper")], (0,), order, STEPS, said)


def test_one_of_another_budget_is_refused_before_anything_is_trained(tmp_path):
    made = tmp_path / "trainings"
    shutil.copytree(SHIPPED / "rudc-t-seed1", made / "rudc-t-seed1")
    wanted, heard = [Wanted("sac-slow", "sac", {"learner.discount": 0.9}), Wanted("rudc-t", "rudc-t")], []
    with pytest.raises(
        InputError, match=r"trained for 100000 steps, not 200: give another --out, or take it"
    ):
        trainings_for(wanted, (1,), Order(tmp_path), TINY, heard.append)
    assert not heard
    found = trainings_for(wanted[1:], (1,), Order(tmp_path, trainings=made), TINY, said)
    assert [t.steps for t in found.found] == [100_000]
    own = [Wanted("rudc-t", "rudc-t", {"training.steps": 100_000})]
    assert trainings_for(own, (1,), Order(tmp_path), TINY, said) == found


def test_what_is_not_there_is_trained_and_the_next_time_taken(tmp_path):
    heard: list[str] = []
    order = Order(tmp_path)
    wanted = [Wanted("sac-slow", "sac", {"learner.discount": 0.9})]
    made = trainings_for(wanted, (3,), order, TINY, heard.append)
    assert [(t.agent, t.steps) for t in made.found] == [("./sac-slow-seed3", 200)]
    assert "training sac-slow-seed3, 50 of 300 decisions" in heard
    assert (made.found[0].logs / "progress.csv").is_file()
    heard.clear()
    assert trainings_for(wanted, (3,), order, TINY, heard.append) == made
    assert not heard
    (tmp_path / "trainings" / "sac-slow-seed3" / "checkpoint").rename(tmp_path / "aside")
    with pytest.raises(InputError, match="--resume"):
        trainings_for(wanted, (3,), order, TINY, heard.append)


def test_shipped_agents_of_another_budget_are_not_taken(tmp_path):
    order = Order(Path(tmp_path))
    made = trainings_for([Wanted("sac", "sac")], (0,), order, TINY, said)
    assert [(t.agent, t.steps) for t in made.found] == [("./sac-seed0", 200)]
    same = trainings_for([Wanted("rudc-e", "rudc-e")], (2,), order, STEPS, said)
    assert [t.agent for t in same.found] == ["rudc-e-seed2"]
