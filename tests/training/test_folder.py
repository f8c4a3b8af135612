"""What a training may go on with."""

import pytest

from rudc.errors import InputError
from rudc.imports import import_first
from rudc.training.config import TrainConfig
from rudc.training.folder import check_folder, keep_inputs, sources_now
from rudc.training.log import Log
from rudc.training.trainer import Trainer
from tests.offering import offer


@pytest.mark.parametrize("changed", ["own_of_training.py", "crowd"])
def test_a_training_is_not_resumed_with_other_code(tmp_path, monkeypatch, changed):
    """A file that was imported first, and a package that offers events; where the code was not kept, a
    training that began before goes on.
    """
    monkeypatch.setattr("rudc.imports._asked", {})
    monkeypatch.syspath_prepend(tmp_path)
    file, folder, config = tmp_path / "own_of_training.py", tmp_path / "out", TrainConfig.of("sac", {})
    package = tmp_path / "crowd_of_training.py"
    for one in (file, package):
        one.write_text("MOST = 1\n", encoding="utf-8")
    offer(tmp_path, "[rudc.events]\ncrowd = crowd_of_training\n", name="crowd")
    import_first(str(file))
    folder.mkdir()
    sources = sources_now(config, folder)
    keep_inputs(config, folder, sources)
    check_folder(config, folder, sources, resume=True)
    (file if changed == file.name else package).write_text("MOST = 2\n", encoding="utf-8")
    with pytest.raises(
        InputError, match=rf"not what it was when the training began: {changed}\. To resume it"
    ):
        check_folder(config, folder, sources, resume=True)
    keep_inputs(config, folder, sources)
    with pytest.raises(InputError, match="is not what it was"):
        check_folder(config, folder, sources, resume=True)
    (folder / "code.json").unlink()
    check_folder(config, folder, sources, resume=True)


@pytest.mark.parametrize(
    ("seed_steps", "there", "lost"),
    [
        (1000, (), ""),
        (1000, ("checkpoint.new/agent.json",), ""),  # killed while it wrote the first
        (1000, ("checkpoint/agent.json",), "checkpoint"),
        (1000, ("checkpoint.old/replay.npz",), "checkpoint.old"),
        (1000, (100,), "progress.csv"),  # the first is written at step 0
        (0, (100, 200), ""),  # the first is written at step 200, after the rows of that step
        (0, (100, 200, 300), "progress.csv"),
        (0, ("checkpoint/agent.json", 300), "checkpoint, progress.csv"),
    ],
)
def test_a_training_whose_counters_are_lost_does_not_begin_anew(tmp_path, seed_steps, there, lost):
    """One that ended before its first checkpoint does. `there`: files, and steps of rows of progress.csv."""
    every = {"training.checkpoint_every": 200, "training.round_decisions": 50}
    config = TrainConfig.of("sac", {"training.seed_steps": seed_steps, **every})
    Log(tmp_path, 0, ()).close()
    for one in there:
        if isinstance(one, int):
            with (tmp_path / "progress.csv").open("a", encoding="utf-8") as file:
                file.write(f"{one}{',' * 13}\n")
        else:
            (tmp_path / one).parent.mkdir()
            (tmp_path / one).write_text("x", encoding="utf-8")
    if not lost:
        assert Trainer(config, tmp_path, Silent()).steps == 0
        return
    with pytest.raises(
        InputError, match=rf"training\.json is missing, .* \({lost}\)\. Put the file back, or"
    ):
        Trainer(config, tmp_path, Silent())


class Silent:
    """Shows nothing of a training."""

    def advance(self, steps):
        """Nothing."""

    def progress(self, row):
        """Nothing."""

    def note(self, text):
        """Nothing."""
