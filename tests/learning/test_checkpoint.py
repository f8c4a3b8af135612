"""Checkpoint folders: written whole, read back the same, refused when they do not fit."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rudc.errors import AgentError, StorageError
from rudc.learning.checkpoint import (
    DESCRIPTION,
    WEIGHTS,
    Checkpoint,
    load_checkpoint,
    load_state,
    save_checkpoint,
    save_state,
)
from rudc.learning.inference import Decider
from rudc.learning.rudc import RudcLearner
from tests.learning.helpers import observations, random_batch, small_case

CASE = small_case(seed=3)
SETTINGS = {
    "algorithm": "rudc-t",
    "observation": "conflict",
    "action": {"kind": "adjustment"},
    "correction": {"kind": "none"},
    "sigma": "paper",
    "outlook": {"course": False, "plant": "off"},
    "learner": {"n_step": 3},
    "training": {"seed": 3},
}


@pytest.fixture
def saved(tmp_path: Path) -> tuple[Path, Checkpoint]:
    learner = RudcLearner(*CASE)
    learner.update(random_batch(CASE, 8))
    checkpoint = Checkpoint(
        SETTINGS, learner.weights(), sigma=(3.5, 4.25), prior="ab", trained={"steps": 1000, "seed": 3}
    )
    save_checkpoint(tmp_path / "agent", checkpoint)
    return tmp_path / "agent", checkpoint


def change(folder: Path, **values: object) -> None:
    path = folder / DESCRIPTION
    path.write_text(json.dumps(json.loads(path.read_text()) | values))


def test_read_back_the_same(saved: tuple[Path, Checkpoint]) -> None:
    folder, checkpoint = saved
    loaded = load_checkpoint(folder)
    for name in ("settings", "sigma", "prior", "trained", "spaces", "code"):
        assert getattr(loaded, name) == getattr(checkpoint, name)
    assert loaded.arrays.keys() == checkpoint.arrays.keys()
    assert sorted(file.name for file in folder.iterdir()) == [DESCRIPTION, WEIGHTS]
    observation = observations(CASE.problem.layout, 1, np.random.default_rng(0))[0]
    before, after = (Decider(CASE.config, CASE.problem.layout, c.arrays) for c in (checkpoint, loaded))
    action = before.action(observation)
    assert np.array_equal(action, after.action(observation))
    assert before.uncertainty(observation, action) == after.uncertainty(observation, action)


def test_one_from_before_there_were_kinds_of_sigma_states_the_papers(saved: tuple[Path, Checkpoint]) -> None:
    folder, _ = saved
    change(folder, sigma={"low": 3.5, "high": 4.25})
    loaded = load_checkpoint(folder)
    assert (loaded.settings["sigma"], loaded.sigma) == ("paper", (3.5, 4.25))
    change(folder, sigma=None)
    assert load_checkpoint(folder).sigma is None


def test_files_of_two_checkpoints_are_noticed(saved: tuple[Path, Checkpoint]) -> None:
    folder, checkpoint = saved
    save_state(folder / WEIGHTS, {name: value + 1 for name, value in checkpoint.arrays.items()})
    with pytest.raises(AgentError, match="not of the same checkpoint"):
        load_checkpoint(folder)


def test_one_is_replaced_whole_or_not_at_all(saved: tuple[Path, Checkpoint]) -> None:
    folder, checkpoint = saved
    other = replace(checkpoint, arrays={name: value + 1 for name, value in checkpoint.arrays.items()})
    for name in (WEIGHTS, DESCRIPTION):
        (folder / f".{name}.new").symlink_to("/dev/full")  # where the draft goes
        with pytest.raises(StorageError, match=f"{name}: the disk is full"):
            save_checkpoint(folder, other)
        loaded = load_checkpoint(folder)
        assert all(np.array_equal(value, loaded.arrays[key]) for key, value in checkpoint.arrays.items())
        assert sorted(file.name for file in folder.iterdir()) == [DESCRIPTION, WEIGHTS]


def test_what_cannot_be_read_is_refused(saved: tuple[Path, Checkpoint], tmp_path: Path) -> None:
    folder, _ = saved
    with pytest.raises(AgentError, match="no checkpoint here"):
        load_checkpoint(tmp_path)
    text = (folder / DESCRIPTION).read_text()
    (folder / DESCRIPTION).write_text(text.replace('"learner"', '"lerner"'))
    with pytest.raises(AgentError, match="learner is missing"):
        load_checkpoint(folder)
    (folder / DESCRIPTION).write_text(text)
    change(folder, format=99)
    with pytest.raises(AgentError, match="format 2"):
        load_checkpoint(folder)
    (folder / DESCRIPTION).write_text("{")
    with pytest.raises(AgentError, match="cannot be read"):
        load_checkpoint(folder)


def test_weights_that_cannot_be_read_are_refused(saved: tuple[Path, Checkpoint]) -> None:
    folder, _ = saved
    (folder / WEIGHTS).write_bytes(b"nothing")
    with pytest.raises(AgentError, match="cannot be read"):
        load_checkpoint(folder)
    (folder / WEIGHTS).unlink()
    with pytest.raises(AgentError, match="is missing"):
        load_checkpoint(folder)


def test_a_training_goes_on_from_its_stored_state(tmp_path: Path) -> None:
    """Through the file, to the same numbers."""
    one, two = RudcLearner(*CASE), RudcLearner(*CASE)
    one.update(random_batch(CASE, 8))
    save_state(tmp_path / "state.safetensors", one.state())
    two.load(load_state(tmp_path / "state.safetensors"))
    assert one.update(random_batch(CASE, 8, 1)) == two.update(random_batch(CASE, 8, 1))
    for name, value in one.state().items():
        assert np.array_equal(value, two.state()[name]), name


def test_a_full_disk_is_said_and_leaves_the_old_weights(tmp_path):
    path = tmp_path / WEIGHTS
    save_state(path, {"x": np.zeros(3)})
    (tmp_path / f".{WEIGHTS}.new").symlink_to("/dev/full")  # where the draft goes
    with pytest.raises(StorageError, match="the disk is full"):
        save_state(path, {"x": np.ones(100_000)})
    assert load_state(path)["x"].tolist() == [0, 0, 0]
